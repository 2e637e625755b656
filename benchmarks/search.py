"""How much better than random search? Optimizers x encodings, the same evaluations each.

    python benchmarks/search.py                           # the walker, 3 seeds, about 12 minutes
    python benchmarks/search.py --generations 15          # a smaller budget, about 2 minutes
    python benchmarks/search.py --preset cube --json search.json
    python benchmarks/search.py --optimizers all --encodings all --seeds 1 2 3 4 5

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
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

import warp_springs as ws
from evolve import ENCODINGS, OPTIMIZERS, Evaluator, Search, load

BASELINE = "random"
KEPT = 9


@dataclass(frozen=True)
class Options:
    """What to compare."""

    preset: str = "walker"
    """A preset or a TOML file."""
    optimizers: tuple[str, ...] = ("genetic", "hill_climber", BASELINE)
    """Which optimizers, "all" for all; each with its defaults, or with the preset's settings if it
    has any."""
    encodings: tuple[str, ...] = ()
    """Which encodings, "all" for all, otherwise that of the preset."""
    seeds: tuple[int, ...] = (1, 2, 3)
    """From which everything random follows."""
    generations: int | None = None
    """How many generations, otherwise as many as the preset has."""
    population: int | None = None
    """How many robots in each, otherwise as many as the preset has."""
    output: Annotated[Path | None, arg(name="json")] = None
    """File to write the results to."""


@dataclass(frozen=True)
class Outcome:
    """What one search found."""

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


def run(options: Options, optimizer: str, encoding: str, seed: int) -> Outcome:
    """Search with one optimizer over one encoding from one seed."""
    changes = {"encoding.type": encoding, "optimizer.type": optimizer, "seed": seed}
    budget = {"generations": options.generations, "population": options.population}
    changes |= {key: value for key, value in budget.items() if value is not None}
    search = Search(load(options.preset, changes))
    search.prepare()
    started, cost, simulating = time.perf_counter(), 0, 0.0
    genomes, fitness = None, np.empty(0)
    while not search.finished:
        generation = search.step()
        cost += int(generation.scores.spring_evaluations.sum())
        simulating += generation.scores.wall_time
        fitness = np.concatenate([fitness, generation.scores.worth])
        new = generation.candidates.genomes
        genomes = new if genomes is None else search.encoding.concatenate([genomes, new])
        kept = np.argsort(-fitness, kind="stable")[:KEPT]
        genomes, fitness = search.encoding.take(genomes, kept), fitness[kept]
    robots = search.encoding.express(genomes)
    look = Evaluator(search.config).second_look(robots, fitness)
    champion = int(look.survives.argmax())
    return Outcome(
        optimizer=optimizer,
        encoding=encoding,
        seed=seed,
        evaluations=search.optimizer.evaluations,
        best=float(fitness[champion]),
        again=float(look.halved[champion]),
        survives=bool(look.survives[champion]),
        seconds=time.perf_counter() - started,
        springs_per_second=cost / simulating,
    )


def tabulate(outcomes: list[Outcome], options: Options) -> Table:
    """Optimizers and encodings in the rows, seeds in the columns."""
    baseline = {(o.encoding, o.seed): o.best for o in outcomes if o.optimizer == BASELINE}
    config = load(options.preset)
    budget = f"{outcomes[0].evaluations:,} evaluations"
    table = Table(title=f"{config.name}: {config.task.fitness}, {budget}")
    table.add_column("encoding")
    table.add_column("optimizer")
    for seed in options.seeds:
        table.add_column(f"seed {seed}", justify="right")
    for column in ("mean", "standard error", "lead", "springs/s"):
        table.add_column(column, justify="right")
    for encoding, optimizer in dict.fromkeys((o.encoding, o.optimizer) for o in outcomes):
        row = [o for o in outcomes if (o.encoding, o.optimizer) == (encoding, optimizer)]
        best = np.array([o.best for o in row])
        first = np.array([baseline.get((encoding, o.seed), np.nan) for o in row])
        error = best.std(ddof=1) / np.sqrt(len(best)) if len(best) > 1 else np.nan
        rate = np.mean([o.springs_per_second for o in row]) / 1e9
        table.add_row(
            encoding,
            optimizer,
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
    usual = load(options.preset).encoding.type
    optimizers = chosen(options.optimizers, OPTIMIZERS, ())
    encodings = chosen(options.encodings, ENCODINGS, (usual,))
    ws.quiet()
    console = Console()
    outcomes = []
    for encoding, seed, optimizer in product(encodings, options.seeds, optimizers):
        what = f"{optimizer} over {encoding}, seed {seed}"
        with console.status(what):
            outcomes.append(run(options, optimizer, encoding, seed))
        last = outcomes[-1]
        console.print(f"{what}: {last.best:.3f} in {last.seconds:.0f} s")
        if options.output is not None:
            options.output.write_text(json.dumps([asdict(o) for o in outcomes], indent=2) + "\n")
    console.print(tabulate(outcomes, options))
    if options.output is not None:
        console.print(f"wrote {options.output}")


if __name__ == "__main__":
    main()
