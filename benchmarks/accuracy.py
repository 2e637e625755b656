"""Run time against error: work-precision curves of every integrator, precision and step.

    python benchmarks/accuracy.py                                     # about four minutes
    python benchmarks/accuracy.py --quick                             # about half a minute
    python benchmarks/accuracy.py --scenes lattice walker --json accuracy.json
    python benchmarks/accuracy.py --figure work_precision.png         # and ..._seconds.png

Every scene is judged by a closed form or by an independent solver (``accuracy_truth``), and no
speed is printed before its errors are in order. The tables say which step to take, what an accuracy
costs next to the program everybody writes first, and which of the project's claims hold. Needs
SciPy.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import time
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path

import accuracy_tables as tables
import numpy as np
import warp as wp
from accuracy_claims import SAVINGS, check
from accuracy_figure import draw
from accuracy_measure import QUICK_STEPS, STEPS, Row, sweep
from accuracy_peer import Comparison, compare
from accuracy_scenes import CASES, Case, Truth
from rich.console import Console
from rich.progress import track

import warp_springs as ws

#: Where the two kernels are compared with, and for which error [m].
COMPARED = {scene: target for scene, target, *_ in SAVINGS}
#: Scenes whose truth takes too long for a quick look.
SLOW = ("walker",)


def main() -> None:
    """Measure, print tables, write JSON and figures."""
    args = _arguments()
    ws.quiet()
    console, started = Console(), time.perf_counter()
    names = args.scenes or [name for name in CASES if not (args.quick and name in SLOW)]
    cases = {name: _quick(CASES[name]) if args.quick else CASES[name] for name in names}
    truths, rows, comparisons, compiling = {}, [], [], 0.0
    for name, case in track(cases.items(), "scenes", console=console, transient=True):
        truths[name] = case.truth()
        own, seconds = sweep(
            name,
            case,
            truths[name],
            steps=QUICK_STEPS if args.quick else STEPS,
            rounds=args.rounds or (1 if args.quick else 5),
        )
        validate(name, case, truths[name], own)
        rows, compiling = rows + own, compiling + seconds
        if name in COMPARED:
            comparisons += _comparisons(name, case, truths[name], own, args.quick)
    claims = list(check(rows, comparisons))

    machine = describe_machine()
    console.print(machine)
    console.print(f"compiling or loading kernels: {compiling:.0f} s, not part of any speed")
    for table in (
        *(tables.scene(name, case, truths[name], rows) for name, case in cases.items()),
        tables.recommendations(cases, rows),
        *([tables.peers(comparisons)] if comparisons else []),
        tables.verdicts(claims),
    ):
        console.print()
        console.print(table)
    if args.json:
        args.json.write_text(json.dumps(_json(cases, truths, rows, comparisons, claims), indent=1))
        console.print(f"wrote {args.json}")
    if args.figure:
        seconds_path = args.figure.with_stem(args.figure.stem + "_seconds")
        for path, cost in ((args.figure, "evaluations"), (seconds_path, "seconds")):
            draw(rows, cases, truths, path, cost, machine)
            console.print(f"wrote {path}")
    console.print(f"{time.perf_counter() - started:.0f} s")


def validate(name: str, case: Case, truth: Truth, rows: Iterable[Row]) -> None:
    """Stop if the truth is not good enough to judge by, or if nothing comes close to it.

    Raises:
        SystemExit: With the reason.
    """
    if not truth.uncertainty <= 0.1 * case.target:
        raise SystemExit(f"{name}: the truth is only known to {truth.uncertainty:.1e} m")
    best = min(row.error for row in rows if row.series.precision == "float64")
    if not best <= case.target:
        raise SystemExit(
            f"{name}: the best error is {best:.1e} m, expected {case.target:.1e} m or less"
        )


def describe_machine() -> str:
    """The machine and the versions, one line."""
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        f"{platform.machine()} CPU, {threads} threads, Warp {wp.config.version}, "
        f"NumPy {np.__version__}, Python {platform.python_version()}"
    )


# Parts of a run.


def _comparisons(
    name: str, case: Case, truth: Truth, rows: list[Row], quick: bool
) -> list[Comparison]:
    """With the scene's own robot, and with the median robot."""
    first = [replace(row, error=row.first_error) for row in rows]
    pairs = [(f"{name}, first robot", first, replace(truth, values=truth.values[:1]))]
    if case.judged > 1:
        pairs.append((f"{name}, median of {case.judged}", rows, truth))
    found = [
        compare(label, case, judge, own, COMPARED[name], rounds=1 if quick else 5)
        for label, own, judge in pairs
    ]
    return [comparison for comparison in found if comparison]


def _quick(case: Case) -> Case:
    return replace(case, judged=1)


def _json(cases, truths, rows, comparisons, claims) -> dict:
    return {
        "machine": describe_machine(),
        "device": "cpu",
        "scenes": {
            name: {
                "title": case.title,
                "features": case.features,
                "duration_s": case.duration,
                "target_m": case.target,
                "judged": case.judged,
                "truth": truths[name].source,
                "truth_uncertainty_m": truths[name].uncertainty,
            }
            for name, case in cases.items()
        },
        "rows": [_finite(asdict(row)) for row in rows],
        "comparisons": [asdict(comparison) for comparison in comparisons],
        "claims": [
            {
                "about": c.about,
                "how": c.how,
                "measured": c.measured,
                "unit": c.unit,
                "holds": c.holds,
            }
            for c in claims
        ],
    }


def _finite(row: dict) -> dict:
    """JSON knows no infinity."""
    return {
        key: None if isinstance(value, float) and math.isinf(value) else value
        for key, value in row.items()
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--scenes", nargs="+", choices=CASES, metavar="SCENE", help=", ".join(CASES)
    )
    parser.add_argument("--quick", action="store_true", help="fewer steps, robots and rounds")
    parser.add_argument("--rounds", type=int, help="how often everything is timed (median)")
    parser.add_argument("--json", type=Path, help="also write everything to this file")
    parser.add_argument("--figure", type=Path, help="also draw the curves into this file")
    return parser.parse_args()


if __name__ == "__main__":
    main()
