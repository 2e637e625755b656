"""The shell: `evolve presets | run | resume | report | export | digest`."""

from __future__ import annotations

import sqlite3
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Union

import tyro
from tyro.conf import Positional, arg, subcommand

from evolve.errors import RunError

if TYPE_CHECKING:
    from rich.console import Console

    from evolve import run as runs

__all__ = ["main"]

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

FAILURES = (RunError, ValueError, OSError, RuntimeError, MemoryError, sqlite3.Error)
"""What may happen to a person; anything else is our own mistake and shows where it was made."""

Folder = Annotated[Positional[Path], arg(metavar="DIR")]
Whole = Annotated[int | None, arg(metavar="N", help_behavior_hint="")]


@dataclass(frozen=True)
class Presets:
    """List the packaged presets: name, fixed body or evolving body, what each evolves.

    To read one or to start a file of your own from it, run it for a generation and look at the
    run.toml in its folder.
    """

    def __call__(self, console: Console) -> int:
        from evolve.toml import load, preset_names

        configs = [load(name) for name in preset_names()]
        width = max(len(config.name) for config in configs)
        for config in configs:
            kind = "fixed body" if config.fixed_body else "evolving body"
            print(f"{config.name:<{width}}  {kind:<13}  {config.about}")
        return 0


@dataclass(frozen=True)
class Run:
    """Start a run: evolve robots from a preset or from a TOML file of your own.

    Everything goes to one folder: run.toml (what was asked), run.sqlite (every evaluation),
    champion.usdc and zoo.usdc (animations), zoo.png, learning_curve.png, dot_plot.png. Ctrl-C
    ends the run cleanly; `evolve resume` continues it, with the same result to the last bit.

    Any key of the configuration can be set, for example
    evolve run walker --set encoding.period=0.8 task.measure=6
    """

    preset: Annotated[Positional[str], arg(metavar="PRESET|FILE.toml")] = "walker"
    """A name that `evolve presets` lists, or a file."""
    seed: Whole = None
    """From which everything random follows."""
    generations: Whole = None
    """How many generations."""
    population: Whole = None
    """How many robots are evaluated in each generation."""
    optimizer: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """genetic, hill_climber or random, with its own defaults."""
    threads: Whole = None
    """Processor cores to use, otherwise all. Changes nothing but the time."""
    set: Annotated[tuple[str, ...], arg(metavar="KEY=VALUE ...", help_behavior_hint="")] = ()
    """Keys of the configuration by their full names, values as in TOML."""
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None
    """Folder of the run, otherwise runs/NAME. It must not hold anything yet."""

    def __call__(self, console: Console) -> int:
        from evolve.run import Run as RunFolder
        from evolve.toml import load, parse_settings

        flags = {
            "seed": self.seed,
            "generations": self.generations,
            "population": self.population,
            "optimizer.type": self.optimizer,
            "simulation.threads": self.threads,
        }
        given = {key: value for key, value in flags.items() if value is not None}
        config = load(self.preset, parse_settings(self.set) | given)
        folder = self.out if self.out is not None else Path("runs") / config.name
        return _evolve(RunFolder.create(config, folder), console)


@dataclass(frozen=True)
class Resume:
    """Continue a run that was stopped, killed, or is to have more generations.

    The record ends up the same, bit for bit, as if the run had never been interrupted. A run that
    is complete already gets its champion, zoo and plots written again.
    """

    directory: Folder
    """Folder of the run."""
    generations: Whole = None
    """A new number of generations, to make the run longer."""
    threads: Whole = None
    """Processor cores to use. Changes nothing but the time."""

    def __call__(self, console: Console) -> int:
        from evolve.run import Run as RunFolder

        run = RunFolder.open(self.directory)
        run.change(generations=self.generations, threads=self.threads)
        return _evolve(run, console)


@dataclass(frozen=True)
class Report:
    """Draw the plots of a run and print its parameters and results, also while it is going on.

    Writes learning_curve.png and dot_plot.png to its folder.
    """

    directory: Folder
    """Folder of the run."""

    def __call__(self, console: Console) -> int:
        from evolve.report import draw, table
        from evolve.run import Run as RunFolder

        run = RunFolder.open(self.directory)
        paths = draw(run)
        console.print(table(run), highlight=False)
        _print_written(paths)
        return 0


@dataclass(frozen=True)
class Export:
    """Simulate the best robots of a run again and write them as animations.

    Writes champion.usdc, zoo.usdc with the best different individuals side by side, and zoo.png to
    the folder of the run. The best are first simulated again, at half the time step in float64 and
    from perturbed starts; the champion is the fittest who keeps its fitness there, and whoever
    does not comes after all who do.
    """

    directory: Folder
    """Folder of the run."""
    best: Annotated[int, arg(metavar="N")] = 9
    """How many robots the zoo has, 1 to 100."""

    def __call__(self, console: Console) -> int:
        import warp_springs as ws
        from evolve.export import export
        from evolve.report import verdict
        from evolve.run import Run as RunFolder

        if not 1 <= self.best <= 100:
            raise RunError(f"--best must be 1 to 100, not {self.best}")
        run = RunFolder.open(self.directory)
        ws.quiet()
        finalists, paths = export(run, self.best)
        print(verdict(finalists, run.config))
        _print_written(paths)
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
        from evolve.run import Run as RunFolder

        with RunFolder.open(self.directory).read() as store:
            print(store.digest())
        return 0


def _evolve(run: runs.Run, console: Console) -> int:
    """Evolve a run to its end, or until Ctrl-C, with everything a person wants to see."""
    import warp_springs as ws
    from evolve.fitness import UNITS
    from evolve.report import describe
    from evolve.screen import Screen, interruptible

    config = run.config
    console.print(f"[bold]{config.name}[/]  {config.about}", highlight=False, soft_wrap=True)
    for subject, words in [*describe(config), ("folder", str(run.directory))]:
        console.print(f"[dim]{subject:<8}[/]{words}", highlight=False, soft_wrap=True)
    ws.quiet()
    screen = Screen(console, UNITS[config.task.fitness])
    try:
        with interruptible() as stopping, screen.showing(stopping):
            complete = run.evolve(screen.update, stopping.is_set)
        if complete:
            _finish(run, console)
            return 0
    except KeyboardInterrupt:
        pass
    print(f"stopped; continue with: evolve resume {run.directory}")
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
    _print_written([run.record_path, *animations, *plots])


def _print_written(paths: Sequence[Path]) -> None:
    print("wrote")
    for path in paths:
        print(f"  {path}")


Command = Presets | Run | Resume | Report | Export | Digest

COMMANDS: dict[str, type[Command]] = {
    "presets": Presets,
    "run": Run,
    "resume": Resume,
    "report": Report,
    "export": Export,
    "digest": Digest,
}


def main(argv: Sequence[str] | None = None) -> None:
    """Entry point of `evolve`.

    Exits with 0, with 1 after an error (one line on stderr), with 2 when the command line makes no
    sense, with 130 after Ctrl-C.
    """
    sys.exit(_run(_parse(list(sys.argv[1:] if argv is None else argv))))


def _parse(arguments: list[str]) -> Command:
    """Read the command line; helps and complains as asked for, and exits then."""
    if arguments and arguments[0] in COMMANDS:
        name, *rest = arguments
        return tyro.cli(COMMANDS[name], prog=f"evolve {name}", args=rest)
    # One line for each command here, all about it in its own help.
    choices = [
        Annotated[command, subcommand(name, description=command.__doc__.partition("\n")[0])]
        for name, command in COMMANDS.items()
    ]
    return tyro.cli(
        Union[tuple(choices)],  # noqa: UP007 (built at run time)
        prog="evolve",
        description="Evolve soft robots. Begin with: evolve run walker",
        args=arguments or ["--help"],
    )


def _run(command: Command) -> int:
    """Run a command; errors become one line."""
    from rich.console import Console

    try:
        return command(Console())
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has gone: there is nobody left to tell.
        sys.stdout = None
        return 1
    except FAILURES as error:
        words = " ".join(str(error).split()) or type(error).__name__
        print(f"evolve: {words}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    main()
