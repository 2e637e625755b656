"""warp_springs beside every alternative: the same robots, checked, then timed in turns.

    python benchmarks/peers/run.py [--quick] [--part table sweep] [--library numba taichi]

NumPy, Numba, JAX, Taichi, Newton, the Warp program everybody writes first, and C++, each as its
users ordinarily write it; Numba, Taichi and JAX also as an expert would; and C++ tuned by hand to
the limit of the processor. The first run makes an environment for each library in
benchmarks/peers/.cache (a few minutes, about 2 GB); a library that cannot be installed is reported
and the others go on.

All step the same population (1,024 cubes of 28 springs, 1,024 lattices of 296), read from the same
file: symplectic Euler, ground with the classroom's friction, damping, every spring breathing. A
program's centers of mass must agree with NumPy's in float64 before it is timed. Then all run in
turns, so that they share whatever else the machine does; ratios are medians over the rounds.
The sweep does so for populations of 1 to 8,192 and draws benchmarks/figures/peers.png.
"""

import argparse
import sys
from pathlib import Path

from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1]))

from peers import report
from peers.figure import draw
from peers.fleet import LIBRARIES, Fleet, cores
from peers.measure import CHECKED_STEPS, FEATURES, Truth, compare
from peers.populations import BODIES, population
from warp_springs.bench.machine import processor

FIGURES = Path(__file__).parents[1] / "figures"
SIZES = (1, 16, 128, 1024, 8192)
QUICK_SIZES = (1, 64)


def main() -> None:
    """Set up, compare, and write tables, JSON and plot."""
    args = arguments()
    console = Console()
    fleet = Fleet()
    with console.status("starting") as status:
        try:
            fleet.start(args.library, args.threads, status.update)
            say_who(console, fleet)
            if "table" in args.part:
                lines = table(console, fleet, args, status.update)
                known = report.write(args.json, fleet, table=lines)
                report.say_targets(console, known["table"])
            if "sweep" in args.part:
                lines = sweep(console, fleet, args, status.update)
                known = report.write(args.json, fleet, sweep=lines)
                draw(known["sweep"], title(), args.figure)
                console.print(f"wrote {args.figure}")
        finally:
            fleet.stop()
    console.print(f"wrote {args.json}")


def title() -> str:
    """What stands above the plot."""
    return (
        f"Cubes of 28 springs, float32; {processor()}, the better of 1 and {len(cores())} cores\n"
        f"{FEATURES}\n"
        "dotted: as its users ordinarily write it; solid: by an expert"
    )


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="small populations, few rounds")
    parser.add_argument("--part", nargs="+", choices=("table", "sweep"), default=["table", "sweep"])
    parser.add_argument("--library", nargs="+", choices=LIBRARIES, default=LIBRARIES)
    parser.add_argument("--body", nargs="+", choices=BODIES, default=BODIES)
    parser.add_argument("--precision", nargs="+", default=("float32", "float64"))
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, len(cores())}))
    parser.add_argument("--robots", type=int, default=1024, help="population of the table")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=0.2, help="of each program in each round")
    parser.add_argument("--json", type=Path, default=Path("out/peers.json"))
    parser.add_argument("--figure", type=Path, default=FIGURES / "peers.png")
    args = parser.parse_args()
    if args.quick:
        args.robots, args.rounds, args.seconds = min(args.robots, 64), 2, 0.02
    args.sizes = QUICK_SIZES if args.quick else SIZES
    return args


def say_who(console: Console, fleet: Fleet) -> None:
    """Name the machine, the versions, and who is missing."""
    versions = ", ".join(f"{name} {version}" for name, version in fleet.versions.items())
    console.print(f"{processor()}, {len(cores())} cores; {versions}")
    console.print(FEATURES)
    for library, reason in fleet.failed.items():
        console.print(f"{library} does not take part: {reason}")


def table(console: Console, fleet: Fleet, args, say) -> list[dict]:
    """Compare on each body in each precision."""
    lines = []
    for body in args.body:
        problem = population(body, args.robots)
        truth = Truth(problem, CHECKED_STEPS)
        for precision in args.precision:
            rows = compare(fleet, truth, precision, args.rounds, args.seconds, say)
            title = f"{args.robots:,} {body}s of {problem.n_springs} springs, {precision}"
            report.tables(console, title, rows)
            lines += report.as_json(rows, body, problem.n_robots, problem.n_springs)
    return lines


def sweep(console: Console, fleet: Fleet, args, say) -> list[dict]:
    """Compare cubes in float32 for populations of all sizes."""
    lines = []
    for robots in args.sizes:
        problem = population("cube", robots)
        rounds, seconds = min(args.rounds, 3), args.seconds / 2
        rows = compare(fleet, Truth(problem, CHECKED_STEPS), "float32", rounds, seconds, say)
        report.tables(console, f"{robots:,} cubes of 28 springs, float32", rows)
        lines += report.as_json(rows, "cube", robots, problem.n_springs)
    return lines


if __name__ == "__main__":
    main()
