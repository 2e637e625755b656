"""``evolve export``: robots of a run as animations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from evolve.commands.shared import Folder, Whole, print_written
from evolve.errors import RunError

if TYPE_CHECKING:
    from rich.console import Console

    from evolve.reports.show import Watch
    from evolve.run import Run

__all__ = ["Export"]


@dataclass(frozen=True)
class Export:
    """Simulate robots of a run again and write them as OpenUSD animations.

    By itself: champion.usdc, zoo.usdc with the best different individuals side by side, and
    zoo.png, in the folder of the run, and films of both if asked. The best are first simulated
    again, at half the time step in float64 and from perturbed starts; the champion is the fittest
    who keeps its fitness there, and whoever does not comes after all who do.

    With --generation, every individual of that generation in one world, the fittest first, as
    generation_0012.usdc. With --robots, those individuals, as robots.usdc. Each robot has its id in
    its name, and its fitness, parameters and parents in its custom data.
    """

    directory: Folder
    """Folder of the run."""
    best: Annotated[int, arg(metavar="N")] = 9
    """How many robots the zoo has, 1 to 100."""
    film: Literal["mp4", "webp"] | None = None
    """Also film the champion and the zoo, each robot in a tile of its own; mp4 needs the extra
    "video"."""
    generation: Whole = None
    """A whole generation instead; -1 is the last."""
    robots: Annotated[tuple[int, ...], arg(metavar="ID ...", help_behavior_hint="")] = ()
    """These individuals instead, by the ids that the record gives them."""
    format: Literal["usdc", "usda", "usdz"] = "usdc"
    """Binary, text, or a package (for phones)."""
    color: Literal["stress", "material"] = "stress"
    """What the colour of a bar says."""
    geometry: Literal["auto", "skel", "points", "mesh"] = "auto"
    """As in warp-springs export."""

    def __call__(self, console: Console) -> int:
        """Simulate, and write."""
        import warp_springs as ws
        from evolve.run import Run as RunFolder

        if not 1 <= self.best <= 100:
            raise RunError(f"--best must be 1 to 100, not {self.best}")
        if self.robots and self.generation is not None:
            raise RunError("--robots and --generation are two choices; give one of them")
        if self.film and (self.robots or self.generation is not None):
            raise RunError("--film goes with champion and zoo, not with --robots or --generation")
        run = RunFolder.open(self.directory)
        ws.quiet()
        with _watching(console) as watch:
            words, paths = self._written(run, watch)
        print(words)
        print_written(paths)
        return 0

    def _written(self, run: Run, watch: Watch) -> tuple[str, Sequence]:
        """Write what is wanted; a line about it, and the paths."""
        from evolve.reports.export import export, export_generation, export_robots
        from evolve.reports.figures import verdict
        from evolve.reports.show import Style

        style = Style(self.format, self.color, self.geometry)
        if self.robots:
            path = export_robots(run, self.robots, style, watch)
            return f"{len(self.robots)} robots", [path]
        if self.generation is not None:
            count, path = export_generation(run, self.generation, style, watch)
            return f"{count} robots", [path]
        finalists, paths = export(run, self.best, self.film, style, watch)
        return verdict(finalists, run.config), paths


@contextmanager
def _watching(console: Console) -> Iterator[Watch]:
    """A bar on a terminal, nothing elsewhere; called with what is done and its share, 0 ... 1."""
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("looking twice", total=1.0)
        yield lambda words, done: bar.update(task, description=words, completed=done)
