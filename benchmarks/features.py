"""What each element of the physics costs a step, and that a scene without any pays nothing.

    python benchmarks/features.py [--layout lanes] [--base REV] [--bodies] [--json FILE]

The robots are lattices that breathe on the ground. For each element the same robots are stepped
with it and without, in turns in one process on one thread; the ratio is the median over the turns.
Before a speed is printed the element is validated: it must change the motion, and another layout
must find the same motion to rounding.

``--bodies`` builds, saves, loads, writes and reads the course's worm, and simulates every
demonstration; what comes back must be what was written.

``--base REV`` steps scenes without elements in two processes in turns: one has this tree, the other
a git worktree of that revision, from before there were elements. (``benchmarks/collisions.py`` has
the cost of piles and crashes.)
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import warp_springs as ws
from warp_springs import demos
from warp_springs.bench.machine import machine

ROOT = Path(__file__).resolve().parents[1]
DT, STEPS, TURNS = 5e-4, 200, 7
#: Largest difference of two layouts [m], and smallest change that an element must make [m].
ROUNDING, CHANGE = 1e-10, 1e-9
SCENE = ws.Scene(ground=ws.Ground(static_friction=0.6, kinetic_friction=0.4), damping=0.5)
BODY = ws.shapes.lattice(3, 2, 2, stiffness=2000.0)
BODY = BODY.breathing(0.1, omega=15.0).rotated((1, 2, 3), 0.2)
BODY = BODY.moved((0.0, 0.0, 0.001 - BODY.bounds[0, 2]))
STILL = BODY.replace(amplitude=np.zeros(BODY.n_springs))


@dataclass(frozen=True)
class Element:
    """One element of issue and guide.

    Attributes:
        name: What it is.
        body: Gives it to the robot.
        scene: Gives it to the scene.
        without: The scene to compare with.
        robot: The robot to compare with.
        crowded: Whether with it four robots at a time stand side by side in one world.
        compared: Whether so do the robots without it.
    """

    name: str
    body: Callable[[ws.Robot], ws.Robot] = lambda robot: robot
    scene: Callable[[ws.Scene], ws.Scene] = lambda scene: scene
    without: ws.Scene = SCENE
    robot: ws.Robot = BODY
    crowded: bool = False
    compared: bool = False


def on_scene(name: str, **changes) -> Element:
    """An element of the scene."""
    return Element(name, scene=lambda scene: replace(scene, **changes))


def hills() -> ws.HeightField:
    """Gentle hills, a fraction of a millimetre above the ground."""
    x = np.linspace(0.0, 6.0, 24)
    return ws.HeightField(0.001 * np.add.outer(np.sin(x), np.cos(x)), 0.1, origin=(-1, -1, 0))


def elements() -> list[Element]:
    """Every element, in the order of the guide."""
    s = BODY.n_springs
    times, low = [0.0, 0.05, 0.1], BODY.bounds[0, 2]
    return [
        Element("bone, tissue and two muscles", made),
        Element("friction and stiffness of single masses", lambda r: r.shod(kinetic_friction=0.1)),
        Element("hardening springs", lambda r: r.with_hardening(1e5)),
        Element("stiffness by a table of stretch", lambda r: r.with_curve([0.001], [1.0, 2.0])),
        Element("stiffness in time", lambda r: r.with_stiffness_in_time(times, [1.0, 1.5, 1.0])),
        Element("cables", lambda r: r.with_cables()),
        Element("winches", lambda r: r.with_cables().with_winch(times, [0.0, -0.01, 0.0])),
        Element("dashpots", lambda r: r.with_dashpots(0.05)),
        Element("breaking springs", lambda r: r.with_limits(breaks=np.linspace(5.0, 500.0, s))),
        Element("yielding springs", lambda r: r.with_limits(yields=5e4, area=1e-4)),
        Element("two more harmonics", lambda r: r.with_harmonics([0.002, 0.001], [0.5, 1.0])),
        Element("a square wave in five harmonics", lambda r: r.with_waveform(square(), 15.0)),
        Element("an omega for each spring", lambda r: r.with_omegas(np.linspace(10.0, 20.0, s))),
        Element("breathing springs", lambda r: r.breathing(0.1, omega=15.0), robot=STILL),
        on_scene("tilted gravity", gravity=(1.0, 0.5, -9.7)),
        Element("push on some masses", lambda r: r.pushed([0, 1, 2], (2, 1, 0), duration=0.05)),
        Element("wind", without=replace(SCENE, drag=0.01), scene=_with(wind=(2.0, 1.0, 0.0))),
        on_scene("drag", drag=0.01),
        on_scene(
            "water: buoyancy and drag", water=ws.Water(level=low + 0.1, density=0.5, drag=0.1)
        ),
        Element("damping", without=replace(SCENE, damping=0.0), scene=_with(damping=0.5)),
        Element("fixed masses", lambda r: r.fixed([0, 1])),
        Element("masses held to a plane", lambda r: r.held_to(ws.Plane((1, 0, 0)), [0, 1, 2])),
        Element("masses held to a sphere", lambda r: r.held_to(ws.Sphere((0, 0, 1), 1.0), [0, 1])),
        Element("tethers", lambda r: r.tethered([0, 1], 100.0, point=(0, 0, 0.3))),
        Element("ground", without=replace(SCENE, ground=None), scene=_with(ground=SCENE.ground)),
        on_scene("obstacle: a ramp", obstacles=ws.Plane((0.2, 0.0, 1.0), 0.001)),
        on_scene("obstacle: a ball", obstacles=ws.Sphere((0.1, 0.1, -0.2), 0.21)),
        on_scene("obstacle: a box", obstacles=ws.Box((0.1, 0.1, -0.05), (0.2, 0.2, 0.104))),
        on_scene("obstacle: a height field", obstacles=hills()),
        Element("four robots in one world", crowded=True),
        Element(
            "collisions, four robots that touch",
            scene=_with(collisions=ws.Collisions()),
            crowded=True,
            compared=True,
        ),
        Element("a controller, 50 readings a second", lambda r: r.controlled(brain())),
    ]


def made(robot: ws.Robot) -> ws.Robot:
    """Of the four classic materials."""
    for k, name in enumerate(("BONE", "TISSUE", "MUSCLE", "MUSCLE2")):
        robot = robot.made_of(getattr(ws.materials, name), where=np.arange(k, BODY.n_springs, 4))
    return robot


def square() -> ws.Waveform:
    """Smaller than the breathing of the body."""
    return ws.Waveform.fit(lambda x: 0.05 * np.sign(np.sin(x)), harmonics=5)


def brain() -> ws.Controller:
    """Four contacts and a clock drive all springs in eight groups."""
    sensed = [ws.sensors.contact(range(4)), ws.sensors.clock(0.3)]
    muscles = np.arange(BODY.n_springs)
    made = ws.Controller(sensed, muscles, outputs=muscles % 8, rate=50.0)
    return made.replace(weights=np.random.default_rng(1).normal(size=made.n_weights))


def _with(**changes) -> Callable[[ws.Scene], ws.Scene]:
    return lambda scene: replace(scene, **changes)


def simulation(
    body: ws.Robot, scene: ws.Scene, count: int, layout: str, crowded: bool = False
) -> ws.Simulation:
    """So many of a robot, on one thread."""
    options = {"dt": DT, "layout": layout, "threads": 1}
    if not crowded:
        return ws.Simulation([body] * count, scene, **options)
    pitch = 0.21  # slightly turned, 0.2 m wide: they touch as they breathe
    robots = [body.moved((0.0, pitch * (i % 4), 0.0)) for i in range(count)]
    return ws.Simulation(robots, scene, world=[i // 4 for i in range(count)], **options)


def validate(element: Element, layout: str) -> dict[str, float]:
    """How far the element moves a mass, and how far two layouts are apart [m].

    Raises:
        SystemExit: It does nothing, or the layouts disagree.
    """
    body, scene = element.body(element.robot), element.scene(element.without)
    crowded = element.crowded
    other = "lanes" if layout != "lanes" else "flat"
    count = 4 if crowded else 1
    here, there, plain = (
        simulation(b, s, count, where, together).run(STEPS * DT)
        for b, s, where, together in (
            (body, scene, layout, crowded),
            (body, scene, other, crowded),
            (element.robot, element.without, layout, element.compared),
        )
    )
    same = min(len(here.positions(0)), len(plain.positions(0)))
    found = {
        "changes": float(np.abs(here.positions(0)[:same] - plain.positions(0)[:same]).max()),
        "layouts_apart": float(np.abs(here.positions(0) - there.positions(0)).max()),
    }
    well = (here.status == ws.Status.OK).all() and (there.status == ws.Status.OK).all()
    # A world of several changes who is stepped with whom, but no motion.
    works = found["changes"] > CHANGE or (crowded and not element.compared)
    if not (well and works and found["layouts_apart"] < ROUNDING):
        sys.exit(f"{element.name}: not valid: {found}, {here.status}, {there.status}")
    return found


def measure(element: Element, layout: str, count: int) -> dict:
    """One row: cost of a step without and with the element, in turns."""
    sides = (
        (element.robot, element.without, element.compared),
        (element.body(element.robot), element.scene(element.without), element.crowded),
    )
    runs = [simulation(body, scene, count, layout, crowded) for body, scene, crowded in sides]
    for run in runs:
        run.run(DT)
    walls = [[run.run(STEPS * DT).wall_time for run in runs] for _ in range(TURNS)]
    springs = STEPS * count * BODY.n_springs
    without, with_it = (
        statistics.median(side) / springs * 1e9 for side in zip(*walls, strict=True)
    )
    return {
        "element": element.name,
        "without_ns": without,
        "with_ns": with_it,
        "ratio": statistics.median(b / a for a, b in walls),
    }


def handle_bodies() -> list[dict]:
    """Seconds to make the worm, to take it through files, and to simulate the demonstrations."""
    rows = []

    def timed(what: str, work: Callable):
        started = time.perf_counter()
        found = work()
        rows.append({"element": what, "seconds": time.perf_counter() - started})
        return found

    config = demos.load("worm").robot.body
    worm = timed("the course's worm: a lattice of 270,033 bars", config.build)
    with tempfile.TemporaryDirectory() as folder:
        saved, mesh = Path(folder) / "worm.npz", Path(folder) / "worm.vtu"
        timed("Robot.save", lambda: worm.save(saved))
        same = timed("Robot.load", lambda: ws.Robot.load(saved)) == worm
        timed("write_mesh, .vtu", lambda: ws.write_mesh(worm, mesh))
        read = timed("read_mesh, .vtu", lambda: ws.read_mesh(mesh))
    if not (same and read.n_springs == worm.n_springs == 270_033):
        sys.exit("a worm did not survive a file")
    for name in demos.NAMES:
        result = timed(f"demonstration: {name}", demos.load(name).run)
        if result.status.any():
            sys.exit(f"{name}: {result.status}")
    return rows


# What both revisions can run, as the text of a program: a line in, seconds out.
WORKER = """
import sys
import numpy as np
import warp_springs as ws
body = ws.shapes.lattice(4, 2, 2, stiffness=2000.0).moved((0.0, 0.0, 0.0005))
moving = body.replace(amplitude=0.1 * body.rest_length, omega=6.0,
                      phase=np.linspace(0, 6, body.n_springs))
large = ws.shapes.lattice(10, 10, 10).moved((0.0, 0.0, 0.001))
walk = ws.Scene(ground=ws.Ground(static_friction=0.6, kinetic_friction=0.4), damping=0.5)
free = ws.Scene(ground=None)
cases = {
    "free flight, float64": ([body] * 512, free, "float64", 300),
    "walking, float64": ([moving] * 512, walk, "float64", 200),
    "walking, float32": ([moving] * 512, walk, "float32", 300),
    "one robot alone, float64": ([moving], walk, "float64", 12000),
    "a large body, flat, float64": ([large], walk, "float64", 500),
}
ready = {}
print(ws.__file__, flush=True)
for line in sys.stdin:
    robots, scene, precision, steps = cases[line.strip()]
    if line not in ready:
        ready[line] = ws.Simulation(robots, scene, dt=1e-4, precision=precision, threads=1)
        ready[line].run(0.0016)
    print(ready[line].run(steps * 1e-4).wall_time, flush=True)
"""
CASES = [line.split('"')[1] for line in WORKER.splitlines() if line.startswith('    "')]


class Side:
    """A process that steps the scenes of ``WORKER`` with the packages of one tree."""

    def __init__(self, tree: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
        )
        line = self._line()
        while not line.endswith("__init__.py"):  # what Warp has to say
            line = self._line()
        if not Path(line).is_relative_to(tree):
            sys.exit(f"--base: the process of {tree} found {line}")

    def _line(self) -> str:
        line = self._process.stdout.readline()
        if not line:
            sys.exit("--base: a process ended early; can that revision run the scenes?")
        return line.strip()

    def seconds(self, case: str) -> float:
        """Step one scene once."""
        self._process.stdin.write(case + "\n")
        self._process.stdin.flush()
        line = self._line()
        while not line.replace(".", "").replace("e-", "").isdigit():
            line = self._line()
        return float(line)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def compare(revision: str, turns: int) -> list[dict]:
    """Seconds of the scenes here and at the base, in turns; the ratio is that of the best."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "base"
        git = ("git", "-C", str(ROOT), "worktree")
        subprocess.run([*git, "add", "--detach", "-q", str(tree), revision], check=True)
        try:
            sides = [Side(tree), Side(ROOT)]
            rows = []
            for case in CASES:
                for side in sides:
                    side.seconds(case)
                pairs = [[side.seconds(case) for side in sides] for _ in range(turns)]
                before, now = (min(side) for side in zip(*pairs, strict=True))
                median = statistics.median(b / a for a, b in pairs)
                rows.append(
                    {"scene": case, "base_s": before, "now_s": now, "ratio": now / before}
                    | {"median_ratio": median}
                )
            for side in sides:
                side.close()
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)
    return rows


def table(title: str, rows: list[dict]) -> Table:
    """Rows as a table."""
    shown = Table(title=title)
    for name in rows[0]:
        shown.add_column(name.replace("_", " "), justify="left" if name == "element" else "right")
    for row in rows:
        shown.add_row(*(v if isinstance(v, str) else f"{v:.3g}" for v in row.values()))
    return shown


def main() -> None:
    """Validate, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--layout", choices=("lanes", "flat", "block"), default="lanes")
    parser.add_argument("--robots", type=int, help="128 in the lanes, else 4")
    parser.add_argument("--base", metavar="REV", help="compare scenes without elements with this")
    parser.add_argument("--turns", type=int, default=45, help="of a comparison with a revision")
    parser.add_argument("--bodies", action="store_true", help="bodies, files and demonstrations")
    parser.add_argument("--json", type=Path, help="write all figures to this file as well")
    options = parser.parse_args()
    ws.quiet()
    count = options.robots or (128 if options.layout == "lanes" else 4)
    console = Console()
    report = {"machine": machine("cpu"), "layout": options.layout, "robots": count}
    if options.base:
        report["base"] = {"revision": options.base, "rows": compare(options.base, options.turns)}
        console.print(table(f"without elements, against {options.base}", report["base"]["rows"]))
    elif options.bodies:
        report["bodies"] = handle_bodies()
        console.print(table("bodies, files and demonstrations", report["bodies"]))
    else:
        rows = []
        for element in elements():
            found = validate(element, options.layout)
            rows.append(measure(element, options.layout, count) | found)
        report["rows"] = rows
        console.print(table(f"ns a spring and step, layout {options.layout}, one thread", rows))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
        console.print(f"wrote {options.json}")


if __name__ == "__main__":
    main()
