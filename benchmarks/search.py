"""How much better than random search? Optimizers x seeds, the same number of evaluations each.

    python benchmarks/search.py                           # the walker, 3 seeds, about 12 minutes
    python benchmarks/search.py --generations 15          # a smaller budget, about 2 minutes
    python benchmarks/search.py --preset cube --json search.json

Every search keeps its nine best; they are simulated again, at half the time step in float64 and
from perturbed starts. The table shows the fittest who survives both, its fitness at half the step,
and its lead over the champion of random search with the same seed.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

import warp_springs as ws
from evolve import Search, load
from evolve.optimizers import OPTIMIZERS

BASELINE = "random"
KEPT = 9


@dataclass(frozen=True)
class Options:
    """What to compare."""

    preset: str = "walker"
    """A preset or a TOML file."""
    optimizers: tuple[str, ...] = ("genetic", "hill_climber", BASELINE)
    """Which optimizers, each with its defaults, or with the preset's settings if it has any."""
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
    seed: int
    evaluations: int
    best: float
    """Fitness of the champion."""
    again: float
    """Its fitness at half the time step in float64."""
    survives: bool
    seconds: float
    springs_per_second: float


def run(options: Options, optimizer: str, seed: int) -> Outcome:
    """Search with one optimizer from one seed."""
    changes = {"optimizer.type": optimizer, "seed": seed}
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
    look = search.evaluator.second_look(search.encoding.express(genomes), fitness)
    champion = int(look.survives.argmax())
    return Outcome(
        optimizer=optimizer,
        seed=seed,
        evaluations=search.optimizer.evaluations,
        best=float(fitness[champion]),
        again=float(look.halved[champion]),
        survives=bool(look.survives[champion]),
        seconds=time.perf_counter() - started,
        springs_per_second=cost / simulating,
    )


def tabulate(outcomes: list[Outcome], options: Options) -> Table:
    """Optimizers in the rows, seeds in the columns."""
    baseline = {o.seed: o.best for o in outcomes if o.optimizer == BASELINE}
    config = load(options.preset)
    budget = f"{outcomes[0].evaluations:,} evaluations"
    table = Table(title=f"{config.name}: {config.task.fitness}, {budget}")
    table.add_column("optimizer")
    for seed in options.seeds:
        table.add_column(f"seed {seed}", justify="right")
    table.add_column("mean", justify="right")
    table.add_column("springs/s", justify="right")
    for optimizer in options.optimizers:
        row = [o for o in outcomes if o.optimizer == optimizer]
        cells = [cell(o, baseline.get(o.seed)) for o in row]
        rate = np.mean([o.springs_per_second for o in row]) / 1e9
        mean = np.mean([o.best for o in row])
        table.add_row(optimizer, *cells, f"{mean:.3f}", f"{rate:.2f} G")
    return table


def cell(outcome: Outcome, baseline: float | None) -> str:
    """Fitness, fitness at half the step, lead over random search."""
    doubt = "" if outcome.survives else " [red]does not survive[/]"
    lead = f"  x{outcome.best / baseline:.2f}" if baseline else ""
    return f"{outcome.best:.3f} [dim]({outcome.again:.3f})[/]{lead}{doubt}"


def main() -> None:
    """Run every search in turn, then print the table."""
    options = tyro.cli(Options, description=__doc__)
    if unknown := set(options.optimizers) - OPTIMIZERS.keys():
        raise SystemExit(f"unknown optimizer {unknown.pop()!r}; known are {', '.join(OPTIMIZERS)}")
    ws.quiet()
    console = Console()
    outcomes = []
    for seed in options.seeds:
        for optimizer in options.optimizers:
            with console.status(f"{optimizer}, seed {seed}"):
                outcomes.append(run(options, optimizer, seed))
            last = outcomes[-1]
            console.print(f"{optimizer}, seed {seed}: {last.best:.3f} in {last.seconds:.0f} s")
    console.print(tabulate(outcomes, options))
    if options.output is not None:
        options.output.write_text(json.dumps([asdict(o) for o in outcomes], indent=2) + "\n")
        console.print(f"wrote {options.output}")


if __name__ == "__main__":
    main()
