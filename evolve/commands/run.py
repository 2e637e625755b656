"""``evolve run`` and ``evolve resume``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from evolve.commands.shared import Extras, Folder, Whole, evolve_to_the_end
from evolve.errors import RunError

if TYPE_CHECKING:
    from rich.console import Console

    from evolve.config import RunConfig

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
    seeds: Annotated[int, arg(metavar="N")] = 1
    """Evolve so many runs at once, from the seeds that follow each other, packed into one batch a
    generation: for learning curves with error bars. Their folders are DIR/seed-1, DIR/seed-2 ..."""
    generations: Whole = None
    """How many generations."""
    population: Whole = None
    """How many robots are evaluated in each generation."""
    encoding: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """direct, regions, harmonics, fourier, expression, neural or cppn, with what it has in common
    with the encoding of the preset."""
    optimizer: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """genetic, cma, age_fitness, crowding, steady_state, nsga2, map_elites, novelty, speciation,
    learning, coevolution, hill_climber or random, with its own defaults."""
    threads: Whole = None
    """Processor cores to use, otherwise all. Changes nothing but the time."""
    devices: Annotated[tuple[str, ...], arg(metavar="DEVICE ...", help_behavior_hint="")] = ()
    """A worker process for each, such as cpu cpu, or cuda:0 cuda:1. Changes nothing but the
    time."""
    cluster: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """Put those workers on a Ray cluster: its address, auto, or local for one of this machine."""
    set: Annotated[tuple[str, ...], arg(metavar="KEY=VALUE ...", help_behavior_hint="")] = ()
    """Keys of the configuration by their full names, values as in TOML."""
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None
    """Folder of the run, otherwise runs/NAME. It must not hold anything yet."""
    extras: OmitArgPrefixes[Extras] = field(default_factory=Extras)

    def __call__(self, console: Console) -> int:
        """Make the folder, and evolve."""
        from evolve.run import Run as RunFolder
        from evolve.run import create_seeds
        from evolve.toml import load, parse_settings

        self.extras.check()  # refused before a folder is made
        flags = {
            "seed": self.seed,
            "generations": self.generations,
            "population": self.population,
            "encoding.type": self.encoding,
            "optimizer.type": self.optimizer,
            "simulation.threads": self.threads,
            "simulation.devices": self.devices or None,
            "simulation.device": self.devices[0] if self.devices else None,
            "simulation.cluster": self.cluster,
        }
        given = {key: value for key, value in flags.items() if value is not None}
        # What a thing is comes before what it is told.
        config = load(self.preset, given | parse_settings(self.set))
        folder = self.out if self.out is not None else Path("runs") / config.name
        if self.seeds < 1:
            raise RunError(f"--seeds must be 1 or more, not {self.seeds}")
        _check_parts(config)
        if self.seeds == 1:
            return evolve_to_the_end([RunFolder.create(config, folder)], console, self.extras)
        runs = create_seeds(config, self.seeds, folder)
        return evolve_to_the_end(runs, console, self.extras)


def _check_parts(config: RunConfig) -> None:
    """Refuse parts that do not fit each other, or this machine, before a folder is made."""
    import warp_springs as ws

    ws.quiet()
    config.make_optimizer(config.make_encoding())
    if not config.simulation.cluster:  # whose devices are elsewhere
        for device in {config.simulation.device, *config.simulation.devices}:
            ws.device_named(device)


@dataclass(frozen=True)
class Resume:
    """Continue a run that was stopped, killed, or is to have more generations.

    The record ends up the same, bit for bit, as if the run had never been interrupted. A run that
    is complete already gets its champion, zoo and plots written again.
    """

    directory: Folder
    """Folder of the run, or of several that were started with --seeds."""
    generations: Whole = None
    """A new number of generations, to make the run longer."""
    threads: Whole = None
    """Processor cores to use. Changes nothing but the time."""
    extras: OmitArgPrefixes[Extras] = field(default_factory=Extras)

    def __call__(self, console: Console) -> int:
        """Open the folder, and go on."""
        from evolve.run import open_all

        self.extras.check()
        runs = open_all(self.directory)
        for run in runs:
            run.change(generations=self.generations, threads=self.threads)
        return evolve_to_the_end(runs, console, self.extras)
