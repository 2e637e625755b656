"""How far above ``ws.stable_dt`` a step really becomes unstable: every shape in every world.

The limit is measured by varying the masses, not the step: one Simulation then holds a whole scan,
and what counts is the ratio of the step to the bound. Robots come to rest, each with its own step,
and are then run twice, once with a push of a nanometre a second on every mass. A step is unstable
where the difference of the two runs grows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from unittest import mock

import numpy as np

import warp_springs as ws
import warp_springs.engine.method

__all__ = ["INTEGRATORS", "SHAPES", "WORLDS", "measure"]

INTEGRATORS = ("chin4", "leapfrog", "euler")
DT = 1e-3
RATIOS = np.geomspace(0.96, 2.9, 40)
PUSH, GROWN = 1e-9, 1e-6  # m/s, and what it becomes where the step is unstable
#: Damping while a robot lies down [1/s], and for how long [s]: it first topples, then stops.
LAYING = ((3.0, 4.0), (20.0, 1.5))
WATCH = 1.2  # s
#: Keeps the kernels the same where nothing is damped [1/s].
HARDLY = 1e-9


def _shapes() -> dict[str, ws.Robot]:
    """One of every shape that is shipped."""
    shapes, hollow = ws.shapes, np.ones((3, 3, 2), bool)
    hollow[1, 1], hollow[0, 0, 1] = False, False
    ball = shapes.sphere(0.1, subdivisions=1)
    return {
        "cube": shapes.cube(),
        "tetrahedron": shapes.tetrahedron(),
        "octahedron": shapes.octahedron(),
        "lattice": shapes.lattice(3, 2, 2),
        "voxels": shapes.voxels(hollow),
        "beam": shapes.beam(length=0.5, cells=(5, 1, 1)),
        "chain": shapes.chain(links=5),
        "snake": shapes.snake(segments=4),
        "sphere": ball,
        "filled": shapes.filled(ball, spacing=0.05),
        "random lattice": shapes.random_lattice((0.25, 0.15, 0.1), spacing=0.04, seed=1),
    }


SHAPES = _shapes()


@dataclass(frozen=True)
class World:
    """A scene, and what is put into it.

    Attributes:
        scene: The scene.
        bodies: The robots that meet in it, from a shape.
    """

    scene: ws.Scene
    bodies: Callable[[ws.Robot], list[ws.Robot]] = lambda body: [body]


def _hard(body: ws.Robot) -> list[ws.Robot]:
    return [body.with_hardening(body.stiffness / body.rest_length**2)]


def _in_corner(body: ws.Robot) -> list[ws.Robot]:
    return [body.moved(-body.bounds[0])]


def _stacked(body: ws.Robot) -> list[ws.Robot]:
    """One on the other, a little askew."""
    low, high = body.bounds
    return [body, body.moved((0.003, 0.002, high[2] - low[2] + 0.003))]


WORLDS = {
    "free": World(ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)),
    "ground": World(ws.Scene()),
    "ice": World(ws.Scene(ground=ws.Ground(static_friction=0.0, kinetic_friction=0.0))),
    "soft ground": World(ws.Scene(ground=ws.Ground(stiffness=1e3))),
    "drag": World(ws.Scene(drag=0.01)),
    "corner": World(
        ws.Scene(
            gravity=(-4.0, -4.0, -8.0),
            obstacles=(ws.Plane(normal=(1, 0, 0)), ws.Plane(normal=(0, 1, 0))),
        ),
        _in_corner,
    ),
    "dashpots": World(
        ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None),
        lambda body: [body.with_dashpots(0.3)],
    ),
    "hardening": World(ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None), _hard),
    "collisions": World(ws.Scene(collisions=ws.Collisions()), _stacked),
}


def measure(shape: str, world: str, integrator: str) -> float:
    """The smallest unstable step over ``ws.stable_dt``; inf: none up to 2.9.

    Robots that would be refused are stepped all the same.
    """
    place = WORLDS[world]
    bodies = place.bodies(_lying(SHAPES[shape], place.scene))
    bound = min(ws.stable_dt(body, place.scene, integrator) for body in bodies)
    factors = (DT / RATIOS / bound) ** 2
    robots = [body.replace(masses=f * body.masses) for f in factors for body in bodies]
    stable = np.array([ws.stable_dt(robot, place.scene, integrator) for robot in robots])
    if not np.allclose(stable.reshape(len(RATIOS), -1).min(axis=1) * RATIOS, DT, rtol=1e-6):
        raise SystemExit(f"{shape}, {world}: the bound does not go with the root of the mass")
    with mock.patch.object(warp_springs.engine.method, "certainly_unstable", _never):
        found = _unstable(robots, len(bodies), place.scene, integrator)
    return float(RATIOS[np.argmax(found)]) if found.any() else np.inf


def _never(strip, dt, integrator) -> np.ndarray:
    return np.zeros(len(strip.ids), bool)


def _lying(body: ws.Robot, scene: ws.Scene) -> ws.Robot:
    """A body as it comes to lie on one of its sides; what balances on a corner would topple."""
    if scene.ground is None:
        return body
    turned = body.rotated((3, 1, 2), 0.2)
    turned = turned.moved((0.0, 0.0, -turned.bounds[0, 2]))
    laid = ws.Simulation(turned, ws.Scene(damping=3.0)).run(6.0)
    return body.replace(positions=laid.positions(0))


def _unstable(robots, together: int, scene: ws.Scene, integrator: str) -> np.ndarray:
    """In which worlds of so many robots tiny motion grows, shape (worlds,)."""
    worlds = np.repeat(np.arange(len(robots) // together), together)

    def run(some, damping: float, duration: float) -> ws.Result:
        options = {"world": worlds} if together > 1 else {}
        place = replace(scene, damping=damping)
        return ws.Simulation(some, place, DT, integrator=integrator, **options).run(duration)

    if scene.ground is not None:
        for damping, duration in LAYING:
            robots = list(_at(robots, run(robots, damping, duration), together))
    rng = np.random.default_rng(0)
    pushes = [PUSH * rng.normal(size=robot.positions.shape) for robot in robots[:together]]
    pushed = [r.replace(velocities=pushes[i % together]) for i, r in enumerate(robots)]
    first, second = (run(some, HARDLY, WATCH) for some in (robots, pushed))
    apart = [
        np.abs(first.velocities(i) - second.velocities(i)).max() for i in range(len(first.status))
    ]
    return (first.status != 0) | (second.status != 0) | ~(np.array(apart) < GROWN)


def _at(robots, result: ws.Result, together: int) -> Iterator[ws.Robot]:
    """Robots at rest where they are in a result."""
    for i, robot in enumerate(robots):
        world, place = divmod(i, together)
        masses = slice(place * robot.n_masses, (place + 1) * robot.n_masses)
        yield robot.replace(positions=result.positions(world)[masses], velocities=None)
