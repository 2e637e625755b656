"""Does it pay to evolve bodies? Searches for bodies against controllers of a fixed body.

    python benchmarks/body_search.py                     # every search, five seeds; resumes
    python benchmarks/body_search.py --only critter walker --seeds 2
    python benchmarks/body_search.py --draw curves.png --gains

Equal evaluations, physics, cycles and amplitudes; the fitness is `steady`, body diameters per cycle
in the slower half of the measurement. Each search is a folder of runs, so that one that was stopped
goes on where it was. The table shows the mean over seeds of the fittest who survives the second
look.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import warp_springs as ws
from evolve import Run, load
from evolve.reports.comparison import Group, compare, groups
from evolve.reports.export import crown
from evolve.reports.plots import figure
from evolve.run import create_seeds, evolve_together, open_all
from evolve.store import Store

COMMON: Mapping[str, Any] = {
    "population": 96,
    "generations": 32,
    "encoding.period": 1.0,
    "encoding.amplitude": 0.2,
    "task.fitness": "steady",
    "task.settle": 1.0,
    "task.measure": 4.0,
    "scene.damping": 4.0,
    "simulation.dt": 1e-3,
    "simulation.precision": "float32",
    "task.second_look.candidates": 8,
    "task.second_look.trials": 8,
}
GENETIC = {"optimizer.type": "genetic"}
HARMONICS = {"encoding.type": "harmonics", "encoding.harmonics": 3}
WALKER = {
    "body": {"shape": "voxels", "layers": [["#.#", "...", "#.#"], ["###", ".#.", "###"]]},
    "encoding.most_masses": 64,
    "encoding.most_springs": 400,
}
CUBE = {"body": {"shape": "cube"}, "encoding.most_masses": 24, "encoding.most_springs": 120}

SEARCHES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "walker, harmonics": ("walker", GENETIC | HARMONICS),
    "walker, regions": ("walker", GENETIC | {"encoding.type": "regions"}),
    "walker, direct": ("walker", GENETIC),
    "cube, harmonics": ("cube", GENETIC | HARMONICS),
    "walker, operators": (
        "creature",
        GENETIC | WALKER | {"encoding.body_rate": 0.0, "encoding.first_changes": 0},
    ),
    "cube, operators": (
        "creature",
        GENETIC | CUBE | {"encoding.body_rate": 0.0, "encoding.first_changes": 0},
    ),
    "creature from cube": (
        "creature",
        GENETIC | CUBE | {"encoding.body_rate": 0.1, "encoding.first_changes": 2},
    ),
    "creature from walker": (
        "creature",
        GENETIC | WALKER | {"encoding.body_rate": 0.1, "encoding.first_changes": 2},
    ),
    "creature": ("creature", GENETIC),
    "critter": ("critter", GENETIC),
    "strider": ("strider", GENETIC),
    "creature, learning": (
        "creature",
        {"optimizer": {"type": "learning", "bodies": {"type": "genetic"}}},
    ),
}
"""Name -> preset, and what differs from it. "walker, operators" and "cube, operators" have the
genes and operators of "creature from walker" and "... cube", but their bodies stay as they are."""


def runs_of(name: str, options: argparse.Namespace) -> list[Run]:
    """The runs of a search, one for each seed, evolved to their end and looked at twice."""
    folder = options.out / name.replace(", ", "-").replace(" ", "-")
    if folder.exists():
        runs = open_all(folder)
        for run in runs:
            run.change(generations=options.generations)
    else:
        preset, changes = SEARCHES[name]
        shorter = {"population": options.population, "generations": options.generations}
        whole = {**changes, **COMMON, **shorter, "simulation.threads": options.threads}
        runs = create_seeds(load(preset, whole), options.seeds, folder)
    told: list[int] = []
    evolve_together(runs, [lambda progress: told.append(progress.generation)] * len(runs))
    for run in runs:
        with Store.open(run.record_path, write=True) as store:
            if len(told) > len(runs) or not store.finalists():  # it went on
                crown(run, store)
    return runs


def row(name: str, group: Group, fixed: bool) -> str:
    """A line of the table."""
    champions = [seed.champion for seed in group.seeds]
    fitness = np.array([0.0 if one is None else one.fitness for one in champions])
    error = fitness.std(ddof=1) / np.sqrt(len(fitness)) if len(fitness) > 1 else np.nan
    lost = sum(one is None for one in champions)
    cells = [
        name,
        "fixed" if fixed else "evolves",
        f"{len(group.seeds[0].record.ids):,}",
        str(len(fitness)),
        *(f"{value:.3f}" for value in (fitness.mean(), error, fitness.max())),
        str(lost),
    ]
    return f"| {' | '.join(cells)} |"


def gains(runs: Sequence[Run]) -> str:
    """How many children are fitter than all their parents, by whether their bodies are theirs."""
    better, count = np.zeros(2), np.zeros(2)
    for run in runs:
        encoding = run.config.make_encoding()
        with run.read() as store:
            record = store.record()
            worth = np.where(np.isfinite(record.fitness), record.fitness, -np.inf)
            bodies: list[bytes] = []
            for blobs, _ in store.judged():
                robots = encoding.express(encoding.from_bytes(blobs))
                bodies += [r.topology + r.positions.tobytes() for r in robots]
            names, rows = store.table()
            first, second = names.index("parent_1"), names.index("parent_2")
            for row in rows:
                parents = [row[place] - 1 for place in (first, second) if row[place]]
                if parents:
                    child = row[0] - 1
                    changed = int(all(bodies[child] != bodies[one] for one in parents))
                    count[changed] += 1
                    better[changed] += worth[child] > max(worth[one] for one in parents)
    kinds = zip(("a parent's body", "a body of their own"), better, count, strict=True)
    return "; ".join(f"{n:,.0f} with {kind}: {b / max(n, 1):.1%} fitter" for kind, b, n in kinds)


def draw(several: Sequence[Group], path: Path) -> None:
    """The learning curves, with standard errors."""
    page = figure(10.0, 5.6)
    ax = compare(page.subplots(), several, "steady")
    ax.set_title("Evolving bodies against controllers of fixed bodies", loc="left")
    page.savefig(path)


def main() -> None:
    """Run the searches that have not been run, and print the table of all."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="*", default=list(SEARCHES), choices=SEARCHES)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--population", type=int, default=COMMON["population"])
    parser.add_argument("--generations", type=int, default=COMMON["generations"])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("runs") / "body-search")
    parser.add_argument("--gains", action="store_true", help="which children of bodies are fitter")
    parser.add_argument("--draw", type=Path, help="picture of the learning curves")
    options = parser.parse_args()
    ws.quiet()
    print("| search | body | evaluations | seeds | mean | error | best | no survivor |")
    print("|---|---|---|---|---|---|---|---|")
    found = []
    for name in options.only:
        started = time.perf_counter()
        runs = runs_of(name, options)
        (group,) = groups(runs)
        settings = runs[0].config.encoding
        fixed = runs[0].config.fixed_body or getattr(settings, "body_rate", 1.0) == 0.0
        label = f"{name}: body {'fixed' if fixed else 'evolves'}"
        found.append(replace(group, label=label))
        seconds = time.perf_counter() - started
        print(f"{row(name, group, fixed)}  {seconds:.0f} s", flush=True)
        if options.gains and not fixed:
            print(f"  children, against their fittest parent: {gains(runs)}", flush=True)
    if options.draw is not None:
        draw(found, options.draw)


if __name__ == "__main__":
    main()
