"""The lanes by the numbers: threads, features, population, lone robots, what is not stepping.

    python benchmarks/lanes.py                        # all parts, about three minutes
    python benchmarks/lanes.py --parts speed health   # some of them
    python benchmarks/lanes.py --json lanes.json

Every robot that is timed is first stepped beside the independent reference in NumPy; where they
differ no speed is printed. What is compared runs in turns in one process, and ratios are medians
over the rounds, so that both share whatever else the machine does.
"""

import argparse
import json
import platform
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from lanes_costs import compiling, generation, health
from rich.console import Console
from rich.table import Table

import warp_springs as ws
from warp_springs.reference import Trial

DT = 1e-4
FULL = ws.Scene(ground=ws.Ground(friction="course"), damping=ws.damping_rate(0.9999, DT))
COULOMB = ws.Scene(ground=ws.Ground(), damping=ws.damping_rate(0.9999, DT))
BARE = ws.Scene(ground=None)
PRECISIONS = ("float32", "mixed", "float64")
#: Largest difference from the reference after some steps [m].
ALLOWED = {"float64": 1e-11, "float32": 1e-6, "mixed": 1e-6}
#: Spring evaluations of one timed run: some tens of milliseconds, so that what is done once a run
#: does not count.
WORK = 1.5e8


def cubes(count: int, actuated: bool = True) -> ws.Variants:
    """Cubes of 28 springs just above the ground."""
    return population(ws.shapes.cube(), count, actuated)


def lattices(count: int, actuated: bool = True) -> ws.Variants:
    """Lattices of 4 x 2 x 2 voxels, 296 springs, just above the ground."""
    return population(ws.shapes.lattice(4, 2, 2), count, actuated)


def population(body: ws.Robot, count: int, actuated: bool) -> ws.Variants:
    """Variants of a body that differ in stiffness and, if they breathe, in their phases."""
    rng, shape = np.random.default_rng(0), (count, body.n_springs)
    varied = {"stiffness": body.stiffness * rng.uniform(0.9, 1.1, shape)}
    if actuated:
        varied |= {
            "amplitude": np.broadcast_to(0.1 * body.rest_length, shape),
            "phase": rng.uniform(0.0, 2.0 * np.pi, shape),
            "omega": np.full(count, 2.0 * np.pi),
        }
    return body.moved((0.0, 0.0, 0.0005)).variants(**varied)


def unshared(count: int) -> list[ws.Robot]:
    """Bodies of 24 to 36 voxels, every one with a topology of its own."""
    rng, robots = np.random.default_rng(0), []
    while len(robots) < count:
        mask = np.ones((3, 3, 4), bool)
        mask[tuple(rng.integers(0, mask.shape, (rng.integers(2, 12), 3)).T)] = False
        body = ws.shapes.voxels(mask).moved((0.0, 0.0, 0.0005))
        phase = rng.uniform(0.0, 2.0 * np.pi, body.n_springs)
        breathing = {"amplitude": 0.1 * body.rest_length, "phase": phase, "omega": 2.0 * np.pi}
        # Springs in an order of its own make a topology its own, whatever the voxels are.
        order = rng.permutation(body.n_springs)
        springs = {name: getattr(body, name)[order] for name in ("stiffness", "rest_length")}
        robots.append(body.replace(springs=body.springs[order], **springs, **breathing))
    return robots


def simulate(robots: Sequence[ws.Robot], scene: ws.Scene, **options) -> ws.Simulation:
    """A simulation, if not told otherwise by symplectic Euler, that agrees with the reference.

    Its first and last robot are compared.
    """
    options = {"integrator": "euler", "precision": "float32"} | options
    sim, steps = ws.Simulation(robots, scene, DT, **options), 20
    result = sim.run(steps * DT)
    for index in (0, len(robots) - 1):
        substeps = int(sim.contact_substeps[index])
        truth = Trial(robots[index], scene, DT, sim.integrator, substeps).run(steps)[0][-1]
        error = np.abs(result.positions(index) - truth).max()
        if not error < ALLOWED[sim.precision]:
            raise SystemExit(f"robot {index} of {robots!r} is {error:.1e} m off the reference")
    return sim


def in_turns(sims: Sequence[ws.Simulation], rounds: int, steps: int = 1) -> np.ndarray:
    """Springs per second of each simulation in each round of so many steps or more, (n, rounds)."""
    rates = np.zeros((len(sims), rounds))
    durations = []
    for sim in sims:
        result = sim.run(DT)
        durations.append(max(steps, round(WORK / result.spring_evaluations)) * DT)
    for turn in range(rounds):
        for index, sim in enumerate(sims):
            result = sim.run(durations[index])
            rates[index, turn] = result.spring_evaluations / result.wall_time
    return rates


def ratio(rates: np.ndarray, of: int, to: int) -> float:
    """Median over the rounds of the rate of one simulation as a multiple of another's."""
    return float(np.median(rates[of] / rates[to]))


def giga(rates: np.ndarray) -> float:
    """Median rate in G springs/s."""
    return float(np.median(rates)) / 1e9


def speed(rounds: int) -> list[dict]:
    """1,024 robots with all features, without any, on one core and on all."""
    rows = []
    for name, make in (("1,024 cubes", cubes), ("1,024 lattices", lattices)):
        for precision in PRECISIONS:
            full, bare = make(1024), make(1024, actuated=False)
            one = {"precision": precision, "threads": 1}
            rates = in_turns(
                [
                    simulate(full, FULL, **one),
                    simulate(full, FULL, precision=precision),
                    simulate(bare, BARE, **one),
                    simulate(full, COULOMB, integrator="chin4", **one),
                    simulate(bare, BARE, integrator="chin4", **one),
                ],
                rounds,
            )
            rows.append(
                {
                    "robots": name,
                    "precision": precision,
                    "G springs/s, one core": giga(rates[0]),
                    "all cores": giga(rates[1]),
                    "all / one": ratio(rates, 1, 0),
                    "bare / full": ratio(rates, 2, 0),
                    "chin4, one core": giga(rates[3]),
                    "chin4, bare / full": ratio(rates, 4, 3),
                }
            )
    return rows


def mixture(rounds: int) -> list[dict]:
    """What a group without a feature loses when others of its batch have it."""
    rows = []
    for precision in PRECISIONS:
        still, moving = cubes(1024, actuated=False), lattices(128)
        parts = [simulate(r, FULL, precision=precision, threads=1) for r in (still, moving)]
        both = simulate([*still, *moving], FULL, precision=precision, threads=1)
        rates = in_turns([*parts, both], rounds)
        springs = [len(r) * r.body.n_springs for r in (still, moving)]
        apart = springs[0] / rates[0] + springs[1] / rates[1]
        together = sum(springs) / rates[2]
        rows.append(
            {
                "batch": "1,024 still cubes + 128 breathing lattices",
                "precision": precision,
                "time together / time apart": float(np.median(together / apart)),
            }
        )
    return rows


def size(rounds: int) -> list[dict]:
    """Time per spring against the number of robots."""
    counts = (256, 1024, 4096, 8192)
    rows = []
    for name, make in (("cubes", cubes), ("lattices", lattices)):
        sims = [simulate(make(count), FULL) for count in counts]
        # Springs that do not fit the caches are fetched once a launch, which takes many steps.
        rates = in_turns(sims, rounds, steps=1000)
        row = {"robots": name, "precision": "float32"}
        row |= {f"time at {n:,} / 256": ratio(rates, 0, i) for i, n in enumerate(counts) if i}
        rows.append(row)
    return rows


def strands(rounds: int) -> list[dict]:
    """Robots that share their topology with nobody, and trials of one of them as lanes."""
    rows, robots = [], unshared(128)
    wide = robots[0].variants(
        velocities=np.random.default_rng(1).normal(0.0, 0.01, (128, robots[0].n_masses, 3))
    )
    for precision in PRECISIONS:
        sims = [simulate(r, FULL, precision=precision, threads=1) for r in (robots, wide)]
        rates = in_turns(sims, rounds)
        rows.append(
            {
                "robots": "128 of as many topologies",
                "precision": precision,
                "G springs/s, one core": giga(rates[0]),
                "128 trials of one of them": giga(rates[1]),
            }
        )
    return rows


PARTS: dict[str, Callable[[int], list[dict]]] = {
    "speed": speed,
    "mixture": mixture,
    "size": size,
    "strands": strands,
    "health": health,
    "compiling": compiling,
    "generation": generation,
}


def main() -> None:
    """Measure, print tables, write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    args = parser.parse_args()
    ws.quiet()
    console, found = Console(), {}
    console.print(f"{platform.machine()}, {ws.Simulation(cubes(1)).threads} threads")
    for part in args.parts:
        rows = found[part] = PARTS[part](args.rounds)
        table = Table(*rows[0], title=PARTS[part].__doc__.splitlines()[0])
        for row in rows:
            table.add_row(*(v if isinstance(v, str) else f"{v:.3g}" for v in row.values()))
        console.print(table)
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")
        console.print(f"wrote {args.json}")


if __name__ == "__main__":
    main()
