"""Worlds: robots apart, on a grid for a joint picture, or really together, colliding."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from warp_springs.robot import Robot

__all__ = ["Member", "gathered", "on_a_grid"]

#: A robot of a world: its index among those given, and its masses among the world's.
Member = tuple[int, slice]
#: Distance of neighbours on a grid, in diameters of the largest robot.
GRID = 1.5


def on_a_grid(robots: Sequence[Robot]) -> list[Robot]:
    """Robots side by side in x and y, centre of mass above the points of a square grid."""
    side = int(np.ceil(np.sqrt(len(robots))))
    spacing = GRID * max(robot.diameter for robot in robots) or GRID
    placed = []
    for index, robot in enumerate(robots):
        x, y, _ = robot.center_of_mass
        row, column = divmod(index, side)
        placed.append(robot.moved((column * spacing - x, row * spacing - y, 0.0)))
    return placed


def gathered(
    robots: Sequence[Robot], world: Sequence[int]
) -> tuple[list[Robot], list[list[Member]]]:
    """Each world's robots as one, in the order of the worlds' first robots, and who is where.

    Raises:
        ValueError: There is not one world for each robot.
    """
    if len(world) != len(robots):
        raise ValueError(f"world: {len(world)} worlds given for {len(robots)} robots")
    members: dict[int, list[int]] = {}
    for index, number in enumerate(world):
        members.setdefault(int(number), []).append(index)
    bodies, places = [], []
    for indices in members.values():
        chosen = [robots[i] for i in indices]
        if len({robot.omega for robot in chosen if robot.is_actuated}) > 1:
            chosen = [_own_omega(robot) for robot in chosen]
        bodies.append(reduce(Robot.joined, chosen))
        ends = np.cumsum([robot.n_masses for robot in chosen]).tolist()
        starts = [0, *ends[:-1]]
        slices = [slice(a, b) for a, b in zip(starts, ends, strict=True)]
        places.append(list(zip(indices, slices, strict=True)))
    return bodies, places


def _own_omega(robot: Robot) -> Robot:
    """The robot with its omega kept by each of its springs, so that it joins any other."""
    omegas = robot.elements.omegas
    known = np.full(robot.n_springs, np.nan) if omegas is None else omegas
    return robot.with_omegas(np.where(np.isnan(known), robot.omega, known)).replace(omega=0.0)
