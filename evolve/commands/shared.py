"""What several commands share: their arguments, and words on the screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

if TYPE_CHECKING:
    from rich.console import Console

    from evolve import run as runs

__all__ = ["INTERRUPTED", "Extras", "Flag", "Folder", "Whole", "evolve_to_the_end", "print_written"]

ANYWHERE = "127.0.0.1:0"
"""On this machine, at a port that is free."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

Folder = Annotated[Positional[Path], arg(metavar="DIR")]
Flag = FlagCreatePairsOff[bool]
Whole = Annotated[int | None, arg(metavar="N", help_behavior_hint="")]


@dataclass(frozen=True)
class Extras:
    """What a run may do and leave besides."""

    live: Flag = False
    """Serve a page with the best robot and the curve while the run lasts, to this machine only; its
    address is printed."""
    live_at: Annotated[str, arg(metavar="ADDRESS:PORT")] = ANYWHERE
    """Where to serve it; port 0 takes one that is free."""
    report: Flag = False
    """Also write report.html at the end, which takes some seconds of filming."""
    csv: Flag = False
    """Also write record.csv at the end: every evaluation as a row."""
    parquet: Flag = False
    """The same as record.parquet; needs the extra "parquet"."""
    tensorboard: Flag = False
    """Also write the curve for TensorBoard, into the folder of the run, as it grows; needs the
    extra "tensorboard"."""

    def check(self) -> None:
        """Refuse a place to serve that is none, or that nothing is served at."""
        import warp_springs as ws

        ws.LiveServer.place(self.live_at)
        if self.live_at != ANYWHERE and not self.live:
            raise ValueError(f"--live-at {self.live_at} goes with --live")


def evolve_to_the_end(
    together: Sequence[runs.Run], console: Console, extras: Extras = Extras()
) -> int:
    """Evolve runs to their end, or until Ctrl-C, with everything a person wants to see."""
    from rich.markup import escape

    import warp_springs as ws
    from evolve.fitness import UNITS
    from evolve.reports.figures import describe
    from evolve.run import evolve_together
    from evolve.screen import Screen, interruptible

    config = together[0].config
    folder = together[0].directory if len(together) == 1 else together[0].directory.parent
    console.print(
        f"[bold]{escape(config.name)}[/]  {escape(config.about)}", highlight=False, soft_wrap=True
    )
    facts = [*describe(config), ("folder", str(folder))]
    if len(together) > 1:
        facts.append(("seeds", ", ".join(str(run.config.seed) for run in together)))
    for subject, words in facts:
        console.print(f"[dim]{subject:<8}[/]{escape(words)}", highlight=False, soft_wrap=True)
    ws.quiet()
    screen = Screen(console, UNITS[config.task.fitness], len(together))
    try:
        with ExitStack() as stack:
            tell = [screen.update, *_live(stack, together, extras, console)]
            if extras.tensorboard:
                from evolve.reports.tensorboard import Curves

                tell.append(stack.enter_context(Curves(together)).update)
            watches = [partial(_tell_all, tell, i) for i in range(len(together))]
            with interruptible() as stopping, screen.showing(stopping):
                complete = evolve_together(together, watches, stopping.is_set)
        if complete:
            for run in together:
                _finish(run, console, extras)
            if extras.report:
                _report(together, folder, console)
            return 0
    except KeyboardInterrupt:
        pass
    print(f"stopped; continue with: evolve resume {folder}")
    return INTERRUPTED


def _live(
    stack: ExitStack, together: Sequence[runs.Run], extras: Extras, console: Console
) -> list[Callable[..., None]]:
    """Begin to serve the page, if it is asked for; returns whom to tell of generations."""
    if not extras.live:
        return []
    import warp_springs as ws
    from evolve.reports.live import Live

    title = f"{together[0].config.name} is evolving"
    server = stack.enter_context(ws.LiveServer(title, *ws.LiveServer.place(extras.live_at)))
    console.print(f"[dim]live    [/]{server.url}", highlight=False, soft_wrap=True)
    return [Live(together, server).update]


def _tell_all(
    listeners: Sequence[Callable[..., None]], which: int, progress: runs.Progress
) -> None:
    for listener in listeners:
        listener(progress, which)


def _report(together: Sequence[runs.Run], folder: Path, console: Console) -> None:
    """Write the report of a run, or of all its seeds, into its folder."""
    from evolve.reports.page import REPORT, write_report

    with console.status("writing the report") as status:
        written = write_report(together, folder / REPORT, progress=status.update)
    print_written(written)


def _finish(run: runs.Run, console: Console, extras: Extras) -> None:
    """Crown the champion, write everything, and say what came of the run."""
    from rich.markup import escape

    from evolve.reports.export import export
    from evolve.reports.figures import draw, results, verdict

    with console.status("looking twice at the best, writing animations and plots"):
        finalists, animations = export(run)
        plots = draw(run)
    console.print(
        f"[bold]{escape(verdict(finalists, run.config))}[/]", highlight=False, soft_wrap=True
    )
    with run.read() as store:
        facts = dict(results(store, run.config))
    print(f"{facts['cost']}: {facts['speed']}; the driver took {facts['driver']}")
    print_written([run.record_path, *_tables(run, extras), *animations, *plots])


def _tables(run: runs.Run, extras: Extras) -> list[Path]:
    """Write the tables that are asked for."""
    from evolve.reports.tables import write_table

    wanted = {"record.csv": extras.csv, "record.parquet": extras.parquet}
    return [write_table(run, run.directory / name) for name, asked in wanted.items() if asked]


def print_written(paths: Sequence[Path]) -> None:
    """Say which files were written."""
    print("wrote")
    for path in paths:
        print(f"  {path}")
