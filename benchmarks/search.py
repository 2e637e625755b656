"""How much better than random search? Optimizers x encodings, the same evaluations each.

    python benchmarks/search.py                          # three bodies, five seeds, 61,440 tries
    python benchmarks/search.py --generations 60         # a smaller budget
    python benchmarks/search.py --presets cube --json search.json
    python benchmarks/search.py --optimizers all --encodings all --presets walker --seeds 1 2

Every search keeps its nine best; they are simulated again, at half the time step in float64 and
from perturbed starts. The table shows the fittest who survives both, its fitness at half the step,
and its lead over the champion of random search with the same seed.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

import warp_springs as ws
from evolve import ENCODINGS, OPTIMIZERS, Evaluator, Search, load
from evolve.encodings.base import Genomes
from evolve.judging.worlds import looked_at_again

BASELINE = "random"
KEPT = 9
WIDTH = 160
"""Of the table, in letters."""


@dataclass(frozen=True)
class Options:
    """What to compare."""

    presets: tuple[str, ...] = ("walker", "tripod", "worm")
    """Presets or TOML files."""
    optimizers: tuple[str, ...] = ("genetic", BASELINE)
    """Which optimizers, "all" for all; each with its defaults, or with the preset's settings if it
    has any. One that cannot search an encoding is passed over."""
    encodings: tuple[str, ...] = ()
    """Which encodings, "all" for all, otherwise that of the preset."""
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)
    """From which everything random follows."""
    generations: int = 240
    """How many generations."""
    population: int = 256
    """How many robots in each."""
    precision: Literal["float64", "float32", "mixed"] = "float32"
    """Of the searches; the second look at the champions is in float64."""
    output: Annotated[Path | None, arg(name="json")] = None
    """File to write the results to."""


@dataclass(frozen=True)
class Outcome:
    """What one search found."""

    preset: str
    optimizer: str
    encoding: str
    seed: int
    evaluations: int
    best: float
    """Fitness of the champion."""
    again: float
    """Its fitness at half the time step in float64."""
    survives: bool
    seconds: float
    springs_per_second: float


def run(options: Options, preset: str, optimizer: str, encoding: str, seed: int) -> Outcome:
    """Search with one optimizer over one encoding from one seed.

    Raises:
        ValueError: The optimizer cannot search this encoding.
    """
    changes = {"encoding.type": encoding, "optimizer.type": optimizer, "seed": seed}
    changes |= {"generations": options.generations, "population": options.population}
    changes["simulation.precision"] = options.precision
    search = Search(load(preset, changes))
    search.prepare()
    started = time.perf_counter()
    found = finish(search)
    look = looked_at_again(Evaluator(search.config), search.encoding, found.genomes, found.fitness)
    champion = int(look.survives.argmax())
    return Outcome(
        preset=preset,
        optimizer=optimizer,
        encoding=encoding,
        seed=seed,
        evaluations=search.optimizer.evaluations,
        best=float(found.fitness[champion]),
        again=float(look.halved[champion]),
        survives=bool(look.survives[champion]),
        seconds=time.perf_counter() - started,
        springs_per_second=found.cost / found.simulating,
    )


@dataclass(frozen=True)
class Found:
    """The fittest individuals of all generations of a search, and what they took."""

    genomes: Genomes
    fitness: np.ndarray
    """Of each, the best first."""
    first: float
    """The best fitness of the first generation."""
    cost: int
    """Spring evaluations."""
    simulating: float
    """Seconds."""


def finish(search: Search, kept: int = KEPT, seconds: float = float("inf")) -> Found:
    """Search to the end, or until so many seconds are over."""
    cost, simulating, genomes, fitness, first = 0, 0.0, None, np.empty(0), np.nan
    until = time.perf_counter() + seconds
    while not search.finished and (genomes is None or time.perf_counter() < until):
        generation = search.step()
        cost += int(generation.scores.spring_evaluations.sum())
        simulating += generation.scores.wall_time
        fitness = np.concatenate([fitness, generation.scores.worth])
        new = generation.candidates.genomes
        first = fitness.max() if genomes is None else first
        genomes = new if genomes is None else search.encoding.concatenate([genomes, new])
        best = np.argsort(-fitness, kind="stable")[:kept]
        genomes, fitness = search.encoding.take(genomes, best), fitness[best]
    return Found(genomes, fitness, float(first), cost, simulating)


def tabulate(outcomes: list[Outcome], options: Options) -> Table:
    """Bodies, encodings and optimizers in the rows, seeds in the columns."""
    baseline = {(o.preset, o.encoding, o.seed): o.best for o in outcomes if o.optimizer == BASELINE}
    table = Table(title=f"{outcomes[0].evaluations:,} evaluations each", box=MARKDOWN)
    for column in ("body", "encoding", "optimizer"):
        table.add_column(column)
    for column in (*map("seed {}".format, options.seeds), "mean", "error", "lead", "springs/s"):
        table.add_column(column, justify="right")
    for key in dict.fromkeys((o.preset, o.encoding, o.optimizer) for o in outcomes):
        row = [o for o in outcomes if (o.preset, o.encoding, o.optimizer) == key]
        best = np.array([o.best for o in row])
        first = np.array([baseline.get((*key[:2], o.seed), np.nan) for o in row])
        error = best.std(ddof=1) / np.sqrt(len(best)) if len(best) > 1 else np.nan
        rate = np.mean([o.springs_per_second for o in row]) / 1e9
        table.add_row(
            *key,
            *map(cell, row),
            f"{best.mean():.3f}",
            f"{error:.3f}",
            f"x{best.mean() / first.mean():.2f}",
            f"{rate:.2f} G",
        )
    return table


def cell(outcome: Outcome) -> str:
    """Fitness, and fitness at half the step."""
    doubt = "" if outcome.survives else " [red]does not survive[/]"
    return f"{outcome.best:.3f} [dim]({outcome.again:.3f})[/]{doubt}"


def chosen(
    given: tuple[str, ...], known: Mapping[str, object], usual: tuple[str, ...]
) -> list[str]:
    """Names that were asked for, all of them for "all"."""
    names = list(known) if given == ("all",) else list(given or usual)
    if unknown := set(names) - known.keys():
        raise SystemExit(f"unknown {unknown.pop()!r}; known are {', '.join(known)}")
    return names


def main() -> None:
    """Run every search in turn, then print the table."""
    options = tyro.cli(Options, description=__doc__)
    optimizers = chosen(options.optimizers, OPTIMIZERS, ())
    ws.quiet()
    console = Console()
    outcomes = []
    for preset in options.presets:
        config = load(preset)
        encodings = chosen(options.encodings, ENCODINGS, (config.encoding.type,))
        for encoding, seed, optimizer in product(encodings, options.seeds, optimizers):
            what = f"{config.name}: {optimizer} over {encoding}, seed {seed}"
            try:
                with console.status(what):
                    outcomes.append(run(options, preset, optimizer, encoding, seed))
            except ValueError as error:
                console.print(f"{what}: passed over: {error}")
                continue
            console.print(f"{what}: {outcomes[-1].best:.3f} in {outcomes[-1].seconds:.0f} s")
            if options.output is not None:
                data = json.dumps([asdict(outcome) for outcome in outcomes], indent=2)
                options.output.write_text(data + "\n")
    Console(width=max(console.width, WIDTH)).print(tabulate(outcomes, options))
    if options.output is not None:
        console.print(f"wrote {options.output}")


if __name__ == "__main__":
    main()
