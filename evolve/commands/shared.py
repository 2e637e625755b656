"""What several commands share: their arguments, and words on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

if TYPE_CHECKING:
    from rich.console import Console

    from evolve import run as runs

__all__ = ["INTERRUPTED", "Folder", "Whole", "evolve_to_the_end", "print_written"]

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

Folder = Annotated[Positional[Path], arg(metavar="DIR")]
Whole = Annotated[int | None, arg(metavar="N", help_behavior_hint="")]


def evolve_to_the_end(together: Sequence[runs.Run], console: Console) -> int:
    """Evolve runs to their end, or until Ctrl-C, with everything a person wants to see."""
    import warp_springs as ws
    from evolve.fitness import UNITS
    from evolve.report import describe
    from evolve.run import evolve_together
    from evolve.screen import Screen, interruptible

    config = together[0].config
    folder = together[0].directory if len(together) == 1 else together[0].directory.parent
    console.print(f"[bold]{config.name}[/]  {config.about}", highlight=False, soft_wrap=True)
    facts = [*describe(config), ("folder", str(folder))]
    if len(together) > 1:
        facts.append(("seeds", ", ".join(str(run.config.seed) for run in together)))
    for subject, words in facts:
        console.print(f"[dim]{subject:<8}[/]{words}", highlight=False, soft_wrap=True)
    ws.quiet()
    screen = Screen(console, UNITS[config.task.fitness], len(together))
    watches = [partial(screen.update, which=i) for i in range(len(together))]
    try:
        with interruptible() as stopping, screen.showing(stopping):
            complete = evolve_together(together, watches, stopping.is_set)
        if complete:
            for run in together:
                _finish(run, console)
            return 0
    except KeyboardInterrupt:
        pass
    print(f"stopped; continue with: evolve resume {folder}")
    return INTERRUPTED


def _finish(run: runs.Run, console: Console) -> None:
    """Crown the champion, write everything, and say what came of the run."""
    from evolve.export import export
    from evolve.report import draw, results, verdict

    with console.status("looking twice at the best, writing animations and plots"):
        finalists, animations = export(run)
        plots = draw(run)
    console.print(f"[bold]{verdict(finalists, run.config)}[/]", highlight=False, soft_wrap=True)
    with run.read() as store:
        facts = dict(results(store, run.config))
    print(f"{facts['cost']}: {facts['speed']}; the driver took {facts['driver']}")
    print_written([run.record_path, *animations, *plots])


def print_written(paths: Sequence[Path]) -> None:
    """Say which files were written."""
    print("wrote")
    for path in paths:
        print(f"  {path}")
