"""Does anything break it? Maps of the stable steps, a soak in garbage, an hour of rest.

    python benchmarks/stability.py                                           # about a minute
    python benchmarks/stability.py --figure stability.png --resolution 48    # about 2 minutes
    python benchmarks/stability.py --soak 100000 --resolution 0 --rest 0     # about 3 minutes
    python benchmarks/stability.py --rest 3600 --resolution 0 --soak 0       # about 10 minutes
    python benchmarks/stability.py --limits --resolution 0 --soak 0 --rest 0 # about 3 minutes

The maps show for each integrator how far a bouncing cube is from a reference over dt and spring
stiffness, mass, ground stiffness, and where it is unstable, against ``ws.stable_dt``. The soak runs
absurd robots between healthy ones. The rest leaves robots alone. The limits say for every shape in
many worlds how far above ``ws.stable_dt`` a step becomes unstable. Exits with 1 if a promise is not
kept: an unstable step below the bound, a failure of the soak, a robot that does not stay where it
rests.
"""

import argparse
import itertools
import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import stability_hits
import stability_limits
import stability_maps
import stability_rest
import stability_soak
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from stability_figure import draw

import warp_springs as ws

#: A robot at rest may not move further than this [m], by precision; in float32 rounding warms it.
STAYS = {"float64": 1e-7, "float32": 1e-3}


def main() -> int:
    """Measure, print tables, write files."""
    args = _arguments()
    ws.quiet()
    console, report, broken = Console(), {}, []
    if args.resolution:
        maps = _maps(console, args, broken)
        report["maps"] = [found.summary() for found in maps]
    if args.soak:
        report["soak"] = _soak(console, args, broken)
    if args.rest:
        report["rest"] = _rest(console, args, broken)
    if args.limits is not None:
        report["limits"] = _limits(console, args, broken)
    if args.json:
        args.json.write_text(json.dumps(report) + "\n")
        console.print(f"wrote {args.json}")
    for line in broken[:20]:
        console.print(f"[red]broken:[/red] {line}", soft_wrap=True)
    if len(broken) > 20:
        console.print(f"[red]... and {len(broken) - 20} more[/red]")
    return 1 if broken else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog=__doc__.split("\n", 2)[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--resolution", type=int, default=32, help="cells a side of a map; 0: none")
    parser.add_argument("--figure", type=Path, help="draw the maps into this file")
    parser.add_argument("--soak", type=int, default=2000, metavar="N", help="garbage robots")
    parser.add_argument("--seed", type=int, default=0, help="of the garbage")
    parser.add_argument(
        "--rest", type=float, default=60.0, metavar="SECONDS", help="simulated seconds of rest"
    )
    worlds = list(stability_limits.WORLDS)
    parser.add_argument(
        "--limits",
        nargs="*",
        choices=worlds,
        metavar="WORLD",
        help=f"measured limits over the bound; all but the last, or of {', '.join(worlds)}",
    )
    parser.add_argument("--json", type=Path, help="also write everything to this file")
    args = parser.parse_args()
    if args.figure and not args.resolution:
        parser.error("--figure draws the maps: give a --resolution")
    return args


def _maps(console: Console, args: argparse.Namespace, broken: list[str]):
    with _bar(console, "maps") as progress:
        maps = stability_maps.measure(args.resolution, args.resolution, progress)
    table = Table("dt over", "integrator", "accurate", "inaccurate", "unstable", "below bound")
    for found in maps:
        size = found.error.size
        table.add_row(
            found.axis.name,
            found.integrator,
            f"{found.accurate.sum() / size:.0%}",
            f"{(~found.accurate & ~found.unstable).sum() / size:.0%}",
            f"{found.unstable.sum() / size:.0%}",
            str(found.violations),
        )
        if found.violations:
            broken.append(
                f"{found.integrator}, {found.axis.name}: {found.violations} cells are unstable "
                "below ws.stable_dt"
            )
    console.print(
        f"{args.resolution} x {args.resolution} cells each; accurate: within "
        f"{stability_maps.ACCURATE * 1e3:g} mm; unstable: stopped, or {stability_maps.STABLE:g} "
        "times the energy"
    )
    console.print(table)
    if args.figure:
        draw(maps, args.figure)
        console.print(f"wrote {args.figure}")
    return maps


def _soak(console: Console, args: argparse.Namespace, broken: list[str]) -> dict:
    with _bar(console, "soak") as progress:
        found = stability_soak.soak(args.soak, args.seed, progress)
    modes = list(found.statuses)
    table = Table("status", *(f"{precision}\ndt {dt}" for precision, dt in modes))
    for status in ws.Status:
        counts = [found.statuses[mode][status.name] for mode in modes]
        if any(counts):
            table.add_row(status.name, *map(str, counts))
    console.print(
        f"{found.garbage} garbage robots, {found.refused} of them refused by their constructor; "
        f"{found.runs} simulated, {found.neighbours} healthy neighbours compared with themselves "
        f"alone; {len(found.failures)} failures, {sum(found.warnings.values())} warnings; "
        f"{found.seconds:.0f} s"
    )
    console.print(table)
    broken += found.failures
    broken += [f"warning, {count} times: {key}" for key, count in found.warnings.items()]
    return found.summary()


def _rest(console: Console, args: argparse.Namespace, broken: list[str]) -> list[dict]:
    table = Table("integrator", "precision", "ground", "drift", "wobble", "first", "last", "time")
    rows = []
    with _bar(console, "rest") as progress:
        for done, case in enumerate(stability_rest.CASES, 1):
            rows.append(stability_rest.measure(*case, args.rest))
            progress(done / len(stability_rest.CASES))
    for row in rows:
        table.add_row(
            row.integrator,
            row.precision,
            row.ground,
            f"{row.drift:.1e}",
            f"{row.wobble:.1e}",
            f"{row.early:.0e}",
            f"{row.late:.0e}",
            f"{row.wall_time:.1f} s",
        )
        where = f"at rest, {row.integrator}, {row.precision}, {row.ground}"
        if row.stopped:
            broken.append(f"{where}: {row.stopped} robots were stopped")
        if not row.wobble < STAYS[row.precision]:
            broken.append(f"{where}: moved by {row.wobble:.1e} m")
    console.print(
        f"{args.rest:g} s at rest, dt = {stability_rest.DT:g} s, worst of 8 robots. Drift, in "
        "m: mean pose of the last tenth less the first; wobble, in m: largest way from the start; "
        "kinetic energy over m g x 0.1 m in the first and in the last tenth"
    )
    console.print(table)
    return [asdict(row) for row in rows]


def _limits(console: Console, args: argparse.Namespace, broken: list[str]) -> dict:
    """Measured limits over the bound: world -> shape -> integrator -> ratio."""
    worlds, shapes = args.limits or list(stability_limits.WORLDS)[:-1], stability_limits.SHAPES
    integrators = stability_limits.INTEGRATORS
    table, report = Table("world", "shape", *integrators), {}
    with _bar(console, "limits") as progress:
        for done, (world, shape) in enumerate(itertools.product(worlds, shapes), 1):
            found = {i: stability_limits.measure(shape, world, i) for i in integrators}
            report.setdefault(world, {})[shape] = {
                i: ratio if math.isfinite(ratio) else None for i, ratio in found.items()
            }
            table.add_row(world, shape, *(f"{ratio:.2f}" for ratio in found.values()))
            broken += [
                f"{shape}, {world}, {integrator}: unstable at {ratio:.2f} times ws.stable_dt"
                for integrator, ratio in found.items()
                if ratio < 1.0
            ]
            progress(done / len(worlds) / len(shapes))
    hits = {i: stability_hits.limit(i) for i in integrators}
    table.add_row("hits", stability_hits.NAME, *(f"{ratio:.2f}" for ratio in hits.values()))
    finite = {i: ratio if math.isfinite(ratio) else None for i, ratio in hits.items()}
    report["hits"] = {stability_hits.NAME: finite}
    broken += [f"hits, {i}: unstable below ws.stable_dt" for i in hits if hits[i] < 1.0]
    console.print("smallest unstable step over ws.stable_dt; inf: none up to 2.9 times the bound")
    console.print(table)
    return report


@contextmanager
def _bar(console: Console, name: str) -> Iterator[Callable[[float], None]]:
    """A progress bar that is told the fraction done, and leaves nothing behind."""
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(name, total=1.0)
        yield lambda done: progress.update(task, completed=done)


if __name__ == "__main__":
    sys.exit(main())
