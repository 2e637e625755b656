"""``evolve lineage``: how an individual came about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from evolve.commands.shared import Flag, Folder

if TYPE_CHECKING:
    from rich.console import Console

    from evolve.store import Ancestor

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
        from evolve.run import Run

        run = Run.open(self.directory)
        with run.read() as store:
            crowned = [f.id for f in store.finalists()[:1] if f.survives] or store.best(1)
            if self.of is None and not crowned:
                raise RunError(f"{self.directory}: nobody has a fitness yet")
            everybody = store.ancestors(crowned[0] if self.of is None else self.of)
        line = _line(everybody)
        shown = line if self.whole else _steps(line)
        console.print(
            f"#{line[-1].id}: {len(everybody) - 1:,} ancestors, {len(line) - 1} steps from the "
            f"first, {len(shown)} individuals shown; fitness in {UNITS[run.config.task.fitness]}",
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


def _line(everybody: list[Ancestor]) -> list[Ancestor]:
    """From the first ancestor to the individual, always by the fitter parent."""
    known = {one.id: one for one in everybody}
    line = [everybody[0]]
    while line[-1].parents:
        parents = [known[parent] for parent in line[-1].parents]
        line.append(max(parents, key=lambda one: (one.fitness == one.fitness, one.fitness)))
    return line[::-1]


def _steps(line: list[Ancestor]) -> list[Ancestor]:
    """The first, whoever was fitter than all before, and the last."""
    shown = line[:1]
    for one in line[1:]:
        if not one.fitness <= shown[-1].fitness or one is line[-1]:
            shown.append(one)
    return shown
