"""``evolve report`` and ``evolve digest``: what came of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evolve.commands.shared import Flag, Folder, print_written
from evolve.errors import RunError

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Digest", "Report"]


@dataclass(frozen=True)
class Report:
    """Write the report of a run, also while it is going on: one HTML file that tells everything.

    The file needs no network and prints well: verdict, films of the best robots and a page in
    which they move, learning curve, every individual, diversity, energies, zoo, every parameter,
    and the commands that make it again. Also writes record.csv, learning_curve.png and
    dot_plot.png to the folder of the run, and prints parameters and results.

    Several folders are compared with each other: runs that differ in nothing but the seed are
    averaged, with the standard error; other optimizers (random, hill_climber) and encodings become
    curves beside them. The report is about the first.
    """

    directories: Annotated[Positional[tuple[Path, ...]], arg(metavar="DIR ...")]
    """Folders of runs, or of several that were started with --seeds."""
    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Where to write the report, otherwise report.html in the first folder."""
    notes: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """A text file whose paragraphs go into the report: what you tried, what worked."""
    plots_only: Flag = False
    """Only draw the two plots and print the table, which takes a second."""

    def __call__(self, console: Console) -> int:
        """Draw, write, and print the table."""
        import warp_springs as ws
        from evolve.reports.figures import draw, table
        from evolve.reports.page import REPORT
        from evolve.run import open_all

        if self.notes is not None and not self.notes.is_file():
            raise RunError(f"--notes: there is no file {self.notes}")
        if not self.directories:
            raise RunError("which run? give its folder, for example: evolve report runs/walker")
        runs = [run for directory in self.directories for run in open_all(directory)]
        notes = "" if self.notes is None else self.notes.read_text(encoding="utf-8")
        out = self.directories[0] / REPORT if self.out is None else self.out
        paths = draw(runs[0])
        if not self.plots_only:
            from evolve.reports.page import write_report

            ws.quiet()
            with console.status("writing the report") as status:
                paths += write_report(runs, out, notes, status.update)
        console.print(table(runs[0]), highlight=False)
        print_written(paths)
        return 0


@dataclass(frozen=True)
class Digest:
    """Print one hash of everything a run decided: genomes, scores, parents; not times.

    Two runs of the same configuration on the same machine have the same digest, however often
    they were interrupted and on however many cores.
    """

    directory: Folder
    """Folder of the run."""

    def __call__(self, console: Console) -> int:
        """Print it."""
        from evolve.run import Run as RunFolder

        with RunFolder.open(self.directory).read() as store:
            print(store.digest())
        return 0
