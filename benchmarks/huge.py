"""One huge body: the flat layout by bodies, precisions and threads, beside the lanes.

    python benchmarks/huge.py                 # about two minutes
    python benchmarks/huge.py --json huge.json

The bodies are the course's worm, a random lattice of exactly 270,033 springs, and a regular lattice
of 24 x 24 x 24 voxels; all their springs breathe, over a ground with friction, damped. Before a
speed is printed each simulation is stepped beside the independent reference in NumPy; then the
layouts take turns in one process, and rates and ratios are medians over the rounds. With --sizes,
single lattices of growing size in turns in both layouts: where the one overtakes the other.
"""

import argparse
import json
import platform
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import warp_springs as ws
from warp_springs.reference import Trial

DT = 1e-5
SCENE = ws.Scene(damping=0.1)
CHECKED = 20  # steps beside the reference
#: Largest difference from the reference after them [m].
ALLOWED = {"float64": 1e-12, "mixed": 1e-6, "float32": 1e-5}
#: Springs evaluated in one timed run.
WORK = 6e7


def worm() -> ws.Robot:
    """The course's worm: 270,033 springs in 0.1875 x 0.0375 x 0.1875 m."""
    return ws.shapes.random_lattice(
        (0.1875, 0.0375, 0.1875), 0.004, n_springs=270_033, mass=1.0, stiffness=100.0
    )


BODIES = {
    "worm": worm,
    "lattice 24^3": lambda: ws.shapes.lattice(24, 24, 24, stiffness=3000.0),
}


def breathing(body: ws.Robot) -> ws.Robot:
    """The body, all of it in motion, its lowest masses in the ground."""
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, body.n_springs)
    body = body.replace(amplitude=0.05 * body.rest_length, phase=phase, omega=2.0 * np.pi)
    return body.moved((0.0, 0.0, -1e-6 - body.bounds[0, 2]))


def checked(body: ws.Robot, truth: np.ndarray, **options) -> ws.Simulation:
    """A simulation that agrees with the reference so far."""
    sim = ws.Simulation(body, SCENE, DT, integrator="leapfrog", contact_substeps=1, **options)
    result = sim.run(CHECKED * DT)
    error = np.abs(result.positions(0) - truth).max()
    if result.status[0] or not error < ALLOWED[sim.precision]:
        raise SystemExit(f"{options}: {error:.1e} m off the reference, status {result.status[0]}")
    return sim


def reference(body: ws.Robot) -> np.ndarray:
    """Where the masses are after ``CHECKED`` steps, by plain NumPy in float64."""
    trial = Trial(body, SCENE, DT, "leapfrog", 1)
    for _ in range(CHECKED):
        trial.step()
    return trial.positions


def rates(sims: list[ws.Simulation], springs: int, rounds: int) -> np.ndarray:
    """Springs per second of each simulation in each round, in turns, (n, rounds)."""
    found = np.zeros((len(sims), rounds))
    for turn in range(rounds):
        for row, sim in zip(found, sims, strict=True):
            result = sim.run(max(1, round(WORK / springs)) * DT)
            row[turn] = result.spring_evaluations / result.wall_time
    return found


def measure(name: str, precision: str, threads: int, rounds: int) -> dict:
    """One body in one precision: flat with one and with all threads, and the lanes."""
    body = breathing(BODIES[name]())
    truth = reference(body)
    kinds = [
        {"layout": "flat", "threads": 1},
        {"layout": "flat", "threads": threads},
        {"layout": "lanes", "threads": threads},
    ]
    sims = [checked(body, truth, precision=precision, **kind) for kind in kinds]
    one, all_of_them, lanes = rates(sims, body.n_springs, rounds)
    return {
        "body": name,
        "masses": body.n_masses,
        "springs": body.n_springs,
        "precision": precision,
        "threads": threads,
        "flat_one_thread": float(np.median(one)),
        "flat": float(np.median(all_of_them)),
        "lanes": float(np.median(lanes)),
        "ratio_threads": float(np.median(all_of_them / one)),
        "ratio_lanes": float(np.median(all_of_them / lanes)),
    }


def sweep(precision: str, rounds: int) -> list[dict]:
    """Single lattices of growing size, one thread, in both layouts."""
    rows = []
    for edge in (2, 4, 6, 8, 10, 12, 16):
        body = breathing(ws.shapes.lattice(edge, edge, edge, stiffness=3000.0))
        truth = reference(body)
        sims = [
            checked(body, truth, precision=precision, layout=layout, threads=1)
            for layout in ("flat", "lanes")
        ]
        flat, lanes = rates(sims, body.n_springs, rounds)
        rows.append(
            {
                "masses": body.n_masses,
                "precision": precision,
                "flat": float(np.median(flat)),
                "lanes": float(np.median(lanes)),
                "ratio": float(np.median(flat / lanes)),
            }
        )
    return rows


def show(console: Console, rows: list[dict]) -> None:
    """The rows as a table."""
    table = Table("body", "springs", "precision", "1 thread", "all", "ratio", "lanes", "flat/lanes")
    for row in rows:
        table.add_row(
            row["body"],
            f"{row['springs']:,}",
            row["precision"],
            f"{row['flat_one_thread'] / 1e9:.2f} G",
            f"{row['flat'] / 1e9:.2f} G",
            f"{row['ratio_threads']:.2f} x",
            f"{row['lanes'] / 1e9:.2f} G",
            f"{row['ratio_lanes']:.1f} x",
        )
    console.print(table)


def show_sweep(console: Console, rows: list[dict]) -> None:
    """The sweep as a table."""
    table = Table("masses", "precision", "flat", "lanes", "flat / lanes")
    for row in rows:
        table.add_row(
            f"{row['masses']:,}",
            row["precision"],
            f"{row['flat'] / 1e9:.2f} G",
            f"{row['lanes'] / 1e9:.2f} G",
            f"{row['ratio']:.2f} x",
        )
    console.print(table)


def main() -> None:
    """Check, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", nargs="+", choices=BODIES, default=list(BODIES))
    parser.add_argument("--precision", nargs="+", choices=ALLOWED, default=list(ALLOWED))
    parser.add_argument("--threads", type=int, default=0, help="all of this machine's by default")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--sizes", action="store_true", help="single lattices of growing size")
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    args = parser.parse_args()
    ws.quiet()
    console = Console()
    threads = args.threads or ws.Simulation(ws.shapes.cube()).threads
    console.print(f"springs per second, each counted once; {threads} threads, {platform.machine()}")
    if args.sizes:
        rows = [row for precision in args.precision for row in sweep(precision, args.rounds)]
        show_sweep(console, rows)
    else:
        rows = [
            measure(name, precision, threads, args.rounds)
            for name in args.bodies
            for precision in args.precision
        ]
        show(console, rows)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=2) + "\n")
        console.print(f"wrote {args.json}")


if __name__ == "__main__":
    main()
