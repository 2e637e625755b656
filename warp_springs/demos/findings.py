"""What the demonstrations show, in figures: counted and measured on the run itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_springs.config import SceneFile
    from warp_springs.result import Result

__all__ = [
    "bounces",
    "findings",
    "heights",
    "peak_deceleration",
    "period",
    "predicted_period",
    "slack",
]

Row = tuple[str, str]

GRAVITY = 9.81
FLIGHT = 0.1
"""Seconds in the air that make a bounce, not a tumble from corner to corner."""
FINE_FPS = 2000.0
"""Frames a second that resolve a blow."""


def findings(config: SceneFile, result: Result) -> list[Row]:
    """What there is to say about a demonstration, a row each."""
    measured = {
        "bouncing-cube": _bouncing,
        "tetrahedron": _bouncing,
        "breathing-cube": _breathing,
        "worm": _breathing,
        "soft-legs": _legs,
        "ten-cubes": _pile,
        "cable-pendulum": _pendulum,
    }
    return measured[config.name](config, result) if config.name in measured else []


def bounces(result: Result, robot: int = 0) -> int:
    """How often a robot left the ground, after it had touched it, for `FLIGHT` at least."""
    touching = (result.frames(robot)[:, :, 2] <= 0.0).any(axis=1)
    contacts = np.flatnonzero(touching)
    if len(contacts) == 0:
        return 0
    flights = np.diff(result.times[contacts], append=result.times[-1])
    return int((flights >= FLIGHT).sum())


def peak_deceleration(config: SceneFile, robot: int) -> float:
    """Largest upward acceleration [m/s^2] of the upper quarter of a robot, simulated finely."""
    fine = config.make_simulation().run(1.0, fps=FINE_FPS, record=[robot])
    start = fine.robots[robot].positions[:, 2]
    top = start > start.max() - 0.25 * np.ptp(start) - 1e-9
    height = fine.frames(robot)[:, top, 2].mean(axis=1)
    return float(np.diff(height, 2).max() * FINE_FPS**2)


def _bouncing(config: SceneFile, result: Result) -> list[Row]:
    return [("bounces", str(bounces(result)))]


def _breathing(config: SceneFile, result: Result) -> list[Row]:
    robot = result.robots[0]
    cycles = (result.end_time - result.start_time) * abs(robot.omega) / (2.0 * math.pi)
    way = result.center_of_mass[0] - robot.center_of_mass
    size = robot.diameter
    return [
        ("cycles", f"{cycles:.2f}"),
        ("way over the ground", f"{1000.0 * math.hypot(*way[:2]):.1f} mm"),
        ("speed", f"{math.hypot(*way[:2]) / size / cycles:.3g} body diameters a cycle"),
    ]


def _legs(config: SceneFile, result: Result) -> list[Row]:
    return [
        (
            f"{name.rpartition(' ')[0]} from {robot.bounds[0, 2]:.1f} m: largest deceleration",
            f"{peak_deceleration(config, i) / GRAVITY:.0f} g",
        )
        for (i, name), robot in zip(config.names.items(), result.robots, strict=True)
    ]


def heights(config: SceneFile, result: Result) -> np.ndarray:
    """How high the centre of each robot of one world is at the end [m], shape (N,)."""
    robots = config.build_robots()
    parts = np.split(result.positions(0)[:, 2], np.cumsum([r.n_masses for r in robots])[:-1])
    return np.array([z @ r.masses / r.mass for z, r in zip(parts, robots, strict=True)])


def _pile(config: SceneFile, result: Result) -> list[Row]:
    rows = []
    if result.energy is not None:
        left = result.energy.kinetic[0, -1]
        rows.append(("kinetic energy left", f"{1000.0 * left:.2g} mJ"))
    if len(result) == 1:  # in a world together
        told = ", ".join(f"{100.0 * height:.1f}" for height in np.sort(heights(config, result)))
        rows.append(("heights of their centres", f"{told} cm"))
    return rows


def period(result: Result, robot: int = 0) -> float:
    """Mean time between two passages of the heaviest mass below its hook, the same way [s]."""
    body = result.robots[robot]
    side = result.frames(robot)[:, np.argmax(body.masses), 0] - body.elements.bonds.points[0, 0]
    before = np.flatnonzero((side[:-1] > 0.0) & (side[1:] <= 0.0))
    share = side[before] / (side[before] - side[before + 1])
    passages = result.times[before] + share * np.diff(result.times)[before]
    return float(np.diff(passages).mean()) if len(passages) > 1 else math.nan


def predicted_period(result: Result, robot: int = 0) -> float:
    """Of a compound pendulum that hangs straight, at a small angle [s].

    2 pi sqrt(I / (g sum of m r)) (1 + a^2 / 16) with the moment of inertia I about the hook, for a
    swing of the angle a; r are the distances from the hook as the bob stretches the cable.
    """
    body = result.robots[robot]
    arms, bob = body.positions - body.elements.bonds.points[0], int(np.argmax(body.masses))
    swing = math.atan2(abs(arms[bob, 0]), -arms[bob, 2])
    g = -result.scene.gravity[2]
    stretch = body.masses[bob] * g * float((1.0 / body.stiffness).sum())
    r = np.linalg.norm(arms, axis=1) * (1.0 + stretch / float(body.rest_length.sum()))
    length = float(body.masses @ r**2 / (body.masses @ r))
    return 2.0 * math.pi * math.sqrt(length / g) * (1.0 + swing**2 / 16.0)


def slack(result: Result, robot: int) -> float:
    """Largest share of a cable's links that hung slack at one time."""
    body, frames = result.robots[robot], result.frames(robot)
    lengths = np.linalg.norm(np.diff(frames[:, body.springs], axis=2)[:, :, 0], axis=2)
    return float((lengths < body.rest_length).mean(axis=1).max())


def _pendulum(config: SceneFile, result: Result) -> list[Row]:
    names = list(config.names.values())
    return [
        (f"{names[0]}: period", f"{period(result):.4f} s"),
        (f"{names[0]}: predicted", f"{predicted_period(result):.4f} s"),
        (f"{names[1]}: links slack at most", f"{100.0 * slack(result, 1):.0f} %"),
    ]
