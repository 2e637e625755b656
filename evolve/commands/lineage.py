"""``evolve lineage``: how an individual came about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from evolve.commands.shared import Flag, Folder

if TYPE_CHECKING:
    from rich.console import Console


__all__ = ["Lineage"]


@dataclass(frozen=True)
class Lineage:
    """Print the line of descent of the champion, or of any individual: how did it come about?

    A row for each step that made the line fitter, from the first ancestor to the individual;
    --whole shows every step. Each individual descends in this line from its fitter parent.
    """

    directory: Folder
    """Folder of the run."""
    of: Annotated[int | None, arg(metavar="ID", help_behavior_hint="")] = None
    """Whose ancestors, by the id in the record; otherwise the champion's, or the fittest's while
    there is no champion."""
    whole: Flag = False
    """Every step of the line."""

    def __call__(self, console: Console) -> int:
        """Look them up, and print the table."""
        from rich.box import SIMPLE_HEAD
        from rich.table import Table

        from evolve.errors import RunError
        from evolve.fitness import UNITS
        from evolve.reports.family import line, steps
        from evolve.reports.units import in_units
        from evolve.run import Run

        run = Run.open(self.directory)
        with run.read() as store:
            crowned = [f.id for f in store.finalists()[:1] if f.survives] or store.best(1)
            if self.of is None and not crowned:
                raise RunError(f"{self.directory}: nobody has a fitness yet")
            everybody = store.ancestors(crowned[0] if self.of is None else self.of)
        way = line(everybody)
        shown = way if self.whole else steps(way)
        console.print(
            f"#{way[-1].id}: ancestors {len(everybody) - 1:,}, steps from the first "
            f"{len(way) - 1}, individuals shown {len(shown)}; "
            f"{in_units('fitness', UNITS[run.config.task.fitness])}",
            highlight=False,
            soft_wrap=True,
        )
        table = Table(box=SIMPLE_HEAD)
        for column in ("individual", "generation", "fitness", "parents"):
            table.add_column(column, justify="right" if column != "parents" else "left")
        for one in shown:
            parents = " x ".join(f"#{parent}" for parent in one.parents) or "unrelated"
            table.add_row(f"#{one.id}", str(one.generation), f"{one.fitness:.4g}", parents)
        console.print(table, highlight=False)
        return 0
