"""Collisions: what does a step with them cost, and do piles come to rest as they should?

Without arguments: two balls crash, and a pile of cubes lies, with and without collisions, on all
threads. Pairs are those that are near enough to be looked at in every kick, at the end of the run;
their rate is that of the time which collisions add. Before a time is printed the balls must have
bounced off each other with their momentum and energy, and the cubes must lie on each other.
``--rest 3600 --cubes 3`` leaves a pile alone for an hour: nothing may drift, creep, or warm up.
``--broad`` compares the search for pairs that are near with Warp's BVH and hash grid.
``--piles 10`` drops ten cubes from ten seeds, in every layout and with every integrator.
"""

import argparse
import itertools
import time
from collections.abc import Iterable
from dataclasses import replace

import collisions_broad
import numpy as np

import warp_springs as ws

EDGE = 0.1
CRASH = 0.016  # s, in which balls meet
WALLS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))


def dropped(seed: int, count: int = 10) -> list[ws.Robot]:
    """Cubes over each other, at random orientations."""
    rng = np.random.default_rng(seed)
    cubes = []
    for i in range(count):
        cube = ws.shapes.cube(edge=EDGE, mass=0.8, stiffness=1e4)
        turned = cube.moved(-cube.center_of_mass).rotated(rng.normal(size=3), rng.uniform(0, 6))
        cubes.append(turned.moved((*rng.normal(0, 0.02, 2), 0.15 + 0.2 * i)))
    return cubes


def box(damping: float = 0.5, collisions: ws.Collisions | None = None) -> ws.Scene:
    """Four walls around a ground."""
    walls = tuple(ws.Plane(n, -0.16, static_friction=0.3, kinetic_friction=0.3) for n in WALLS)
    return ws.Scene(damping=damping, obstacles=walls, collisions=collisions or ws.Collisions())


def deepest(world: ws.Robot, members, frames: np.ndarray) -> float:
    """How deep any mass of a cube was inside another in any frame [m]: they are convex."""
    worst = 0.0
    for (_, own), (j, _) in itertools.product(members, enumerate(members)):
        if own == members[j][1]:
            continue
        corners = frames[:, world.faces[12 * j : 12 * j + 12]]
        normal = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        arm = frames[:, own][:, :, None] - corners[:, None, :, 0]
        above = np.einsum("ftk,fptk->fpt", normal, arm).max(axis=2)
        worst = max(worst, -float(above.min()))
    return worst


def pile(seed: int, layout: str, integrator: str, precision: str = "float64") -> dict:
    """Drop ten cubes and see how they end."""
    started = time.perf_counter()
    simulation = ws.Simulation(
        dropped(seed),
        box(),
        world="together",
        layout=layout,
        integrator=integrator,
        precision=precision,
    )
    result = simulation.run(5.0, fps=50, energy=True)
    energy, frames = result.energy, result.frames(0)
    start = energy.total[0, 0]
    return {
        "seed": seed,
        "layout": layout,
        "integrator": integrator,
        "status": ws.Status(result.status[0]).name,
        "dt [ms]": 1e3 * float(simulation.robot_dt[0]),
        "depth / edge": deepest(result.robots[0], simulation.members[0], frames) / EDGE,
        "gain": float(np.diff(energy.total[0]).max() / start),
        "residual": float(np.abs(energy.residual[0]).max() / start),
        "left": float(energy.kinetic[0, -1] / start),
        "top [m]": float(frames[-1, :, 2].max()),
        "s": time.perf_counter() - started,
    }


def balls(subdivisions: int) -> list[ws.Robot]:
    """Two balls on their way into each other."""
    ball = ws.shapes.sphere(0.1, subdivisions, mass=2.0, stiffness=2e3)
    ball = ball.moved(-ball.center_of_mass)
    return [ball, ball.moved((0.02, 0.01, 0.2)).moving((0, 0, -1.0))]


def touching(subdivisions: int) -> list[ws.Robot]:
    """The same, where they have met."""
    one, two = balls(subdivisions)
    return [one, two.moved((0, 0, -0.008))]


def crash(subdivisions: int, precision: str = "float64") -> dict:
    """Time two balls that crash, with and without collisions."""
    robots, seconds = balls(subdivisions), {}
    smooth = {"static_friction": 0.0, "kinetic_friction": 0.0, "damping": 0.0}
    for collisions in (ws.Collisions(stiffness=1e4, **smooth), None):
        scene = ws.Scene(gravity=(0, 0, 0), ground=None, collisions=collisions)
        step = 0.5 * ws.stable_dt(robots[0], ws.Scene(ground=None, collisions=ws.Collisions()))
        simulation = ws.Simulation(
            robots, scene, step, world="together", layout="flat", precision=precision
        )
        result = simulation.run(10 * step)  # compiles
        result = simulation.run(max(300 * step, CRASH), energy=True)
        if collisions is not None:
            _validate(result, simulation.members[0][0][1], robots[0].mass)
            (crowd,) = simulation._slices
            pairs = int(crowd._given["state"].partner_counts.numpy().sum()) // 2
        seconds[collisions is not None] = result.wall_time / result.steps
    return row("two balls", result.robots[0], seconds, pairs)


def lying() -> dict:
    """Time a pile of ten cubes that lies, with and without collisions."""
    seconds, simulations = {}, {}
    for collisions in (True, False):
        scene = box() if collisions else replace(box(), collisions=None)
        simulations[collisions] = ws.Simulation(dropped(1), scene, world="together")
        simulations[collisions].run(4.0)
    for collisions, simulation in simulations.items():
        walls = [simulation.run(0.2) for _ in range(3)]
        steps = 0.2 / simulation.robot_dt[0]
        seconds[collisions] = min(result.wall_time / steps for result in walls)
        if collisions and not walls[-1].positions(0)[:, 2].max() > 2 * EDGE:
            raise SystemExit("the cubes do not lie on each other")
    pairs = int(simulations[True]._buffers["pair_lists"][0])
    return row("ten cubes", walls[-1].robots[0], seconds, pairs)


def row(what: str, world: ws.Robot, seconds: dict[bool, float], pairs: int) -> dict:
    """What there is to say of a world, stepped in so many seconds with and without collisions."""
    features = world.n_masses + len(world.faces) + len(world.faces) * 3 // 2
    extra = seconds[True] - seconds[False]
    return {
        "": what,
        "faces": len(world.faces),
        "springs": world.n_springs,
        "features": features,
        "pairs": pairs,
        "without [µs/step]": 1e6 * seconds[False],
        "with [µs/step]": 1e6 * seconds[True],
        "ratio": seconds[True] / seconds[False],
        "extra [ns/feature/kick]": 1e9 * extra / features / 3,
        "M pairs/s": 1e-6 * 3 * pairs / extra,
    }


def _validate(result: ws.Result, first: slice, mass: float) -> None:
    world, v = result.robots[0], result.velocities(0)
    momentum = world.masses @ v
    if np.abs(momentum - (0, 0, -mass)).max() > 1e-6:
        raise SystemExit(f"the momentum is {momentum}, not that of the start")
    if not v[first, 2].mean() < -0.01:
        raise SystemExit("the balls did not meet")
    if np.abs(result.energy.residual).max() > 1e-2 * result.energy.total[0, 0]:
        raise SystemExit("energy was made or lost")


def resting(seconds: float, count: int, seed: int = 1) -> dict:
    """Lay a pile down with damping, end the damping, and wait."""
    still = ws.Simulation(dropped(seed, count), box(damping=5.0), world="together")
    start = still.run(20.0)
    members = [place for _, place in still.members[0]]
    at = start.positions(0)
    cubes = [
        cube.replace(positions=at[place], velocities=None)
        for cube, place in zip(dropped(seed, count), members, strict=True)
    ]
    simulation = ws.Simulation(cubes, box(damping=0.0), world="together", threads=1)
    result = simulation.run(seconds, fps=200 / seconds, energy=True)
    frames, kinetic = result.frames(0), result.energy.kinetic[0]
    lift = 9.81 * 0.8 * EDGE
    return {
        "cubes": count,
        "seconds": seconds,
        "status": ws.Status(result.status[0]).name,
        "drift of the last tenth [m]": float(
            np.abs(frames[-20:].mean(0) - frames[1:21].mean(0)).max()
        ),
        "wobble [m]": float(np.abs(frames - frames[0]).max()),
        "early [lift of an edge]": float(kinetic[1:21].max() / lift),
        "late": float(kinetic[-20:].max() / lift),
        "depth / edge": deepest(result.robots[0], simulation.members[0], frames) / EDGE,
        "s": result.wall_time,
    }


def table(rows: Iterable[dict]) -> None:
    """Print rows as Markdown, as they come."""
    for number, row in enumerate(rows):
        if number == 0:
            print("| " + " | ".join(row) + " |\n|" + "---|" * len(row))
        cells = [_figure(v) if isinstance(v, float) else str(v) for v in row.values()]
        print("| " + " | ".join(cells) + " |", flush=True)


def _figure(value: float) -> str:
    return f"{value:,.0f}" if 100.0 <= abs(value) < 1e6 else f"{value:.2g}"


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--piles", type=int, default=0, help="seeds of ten cubes each")
    parser.add_argument("--layouts", nargs="+", default=["lanes", "flat"])
    parser.add_argument("--integrators", nargs="+", default=["chin4", "leapfrog", "euler"])
    parser.add_argument("--rest", type=float, help="seconds that a pile is left alone")
    parser.add_argument("--cubes", type=int, default=10, help="in the pile that is left alone")
    parser.add_argument("--broad", action="store_true", help="the broad phase alone")
    parser.add_argument("--balls", type=int, nargs="+", default=[2, 3, 4], help="subdivisions")
    given = parser.parse_args()
    ws.quiet()
    if given.rest:
        table([resting(given.rest, given.cubes)])
        return
    if given.broad:
        table(collisions_broad.compare(touching(subdivisions)) for subdivisions in given.balls)
        return
    if not given.piles:
        table(itertools.chain(map(crash, given.balls), (lying() for _ in range(1))))
        return
    cases = itertools.product(range(given.piles), given.layouts, given.integrators)
    table(pile(*case) for case in cases)


if __name__ == "__main__":
    main()
