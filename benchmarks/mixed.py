"""Mixed precision: what it costs beside float32, and what it errs by, a kilometre from the origin.

    python benchmarks/mixed.py [--distance 1000] [--duration 10] [--rounds 7] [--json FILE]

Inchworms walk in every precision with the same steps; the truth is float64 with far finer steps.
The cost is that of 1,024 of them, in turns in one process, as a ratio to float32. No cost is
printed where mixed precision errs by more than three times what float64 does.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from accuracy_scenes import CASES
from rich.console import Console
from rich.table import Table

import warp_springs as ws

PRECISIONS = ("float64", "float32", "mixed")
STEPS = (1e-3, 5e-4, 2.5e-4, 1e-4)
FINE = 1.25e-5
SCENE = CASES["walker"].scene


def walkers(count: int, distance: float) -> ws.Variants:
    """Inchworms so far from the origin, each with its own phases."""
    body = CASES["walker"].robot.moved((distance, 0.0, 0.0))
    wobble = np.random.default_rng(1).normal(0.0, 0.05, (count, body.n_springs))
    return body.variants(phase=body.phase + wobble)


def places(robots: ws.Variants, dt: float, precision: str, duration: float) -> np.ndarray:
    """Where the masses are at the end [m], shape (N, M, 3)."""
    result = ws.Simulation(robots, SCENE, dt, precision=precision).run(duration)
    return np.array([result.positions(i) for i in range(len(robots))])


def errors(distance: float, duration: float, judged: int) -> list[dict]:
    """Median over some walkers of the rms error [m] of each precision and step."""
    robots = walkers(judged, distance)
    truth = places(robots, FINE, "float64", duration)
    rows = []
    for dt in STEPS:
        row = {"dt": dt}
        for precision in PRECISIONS:
            gap = places(robots, dt, precision, duration) - truth
            row[precision] = float(np.median(np.sqrt((gap**2).sum(axis=2).mean(axis=1))))
        rows.append(row)
    return rows


def costs(dt: float, rounds: int, count: int = 1024) -> dict[str, float]:
    """Seconds of a tenth of a second of many walkers over those of float32: median of the rounds.

    Near the origin, where float32 too has its feet on the ground.
    """
    robots = walkers(count, 0.0)
    sims = {p: ws.Simulation(robots, SCENE, dt, precision=p) for p in PRECISIONS}
    for sim in sims.values():
        sim.run(0.1)
    seconds = {p: [] for p in PRECISIONS}
    for _ in range(rounds):
        for precision, sim in sims.items():
            seconds[precision].append(sim.run(0.1).wall_time)
    ratios = {p: np.divide(s, seconds["float32"]) for p, s in seconds.items()}
    return {p: float(np.median(ratio)) for p, ratio in ratios.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--distance", type=float, default=1000.0, help="from the origin, m")
    parser.add_argument("--duration", type=float, default=10.0, help="of the walk, s")
    parser.add_argument("--judged", type=int, default=16, help="walkers whose errors are taken")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    args = parser.parse_args()
    ws.quiet()
    console = Console()
    rows = errors(args.distance, args.duration, args.judged)
    table = Table("step", *PRECISIONS, "mixed / float64")
    for row in rows:
        ratio = row["mixed"] / row["float64"]
        table.add_row(
            f"{row['dt'] * 1e3:g} ms", *(f"{row[p]:.1e} m" for p in PRECISIONS), f"{ratio:.2f}"
        )
    console.print(
        f"error after a walk of {args.duration:g} s, {args.distance:g} m from the origin, chin4, "
        f"against float64 at {FINE:g} s: median of {args.judged} walkers"
    )
    console.print(table)
    worst = max(row["mixed"] / row["float64"] for row in rows)
    if worst > 3.0:
        raise SystemExit(f"mixed precision errs by {worst:.1f} times what float64 does, allowed 3")
    cost = costs(5e-4, args.rounds)
    console.print("cost beside float32: " + ", ".join(f"{p} {c:.2f}" for p, c in cost.items()))
    if args.json:
        args.json.write_text(json.dumps({"errors": rows, "cost": cost}, indent=1) + "\n")
        console.print(f"wrote {args.json}")


if __name__ == "__main__":
    main()
