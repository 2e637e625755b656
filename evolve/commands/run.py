"""``evolve run`` and ``evolve resume``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evolve.commands.shared import Folder, Whole, evolve_to_the_end

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Resume", "Run"]


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
    """genetic, cma, age_fitness, crowding, steady_state, nsga2, map_elites, hill_climber or random,
    with its own defaults."""
    threads: Whole = None
    """Processor cores to use, otherwise all. Changes nothing but the time."""
    set: Annotated[tuple[str, ...], arg(metavar="KEY=VALUE ...", help_behavior_hint="")] = ()
    """Keys of the configuration by their full names, values as in TOML."""
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None
    """Folder of the run, otherwise runs/NAME. It must not hold anything yet."""

    def __call__(self, console: Console) -> int:
        """Make the folder, and evolve."""
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
        return evolve_to_the_end(RunFolder.create(config, folder), console)


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
        """Open the folder, and go on."""
        from evolve.run import Run as RunFolder

        run = RunFolder.open(self.directory)
        run.change(generations=self.generations, threads=self.threads)
        return evolve_to_the_end(run, console)
