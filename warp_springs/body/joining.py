"""Joining two robots into one body, on request grown together where they touch."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warp_springs.body.elements import join_elements
from warp_springs.geometry import FloatArray, IntArray
from warp_springs.materials import Material
from warp_springs.robot import Robot

__all__ = ["join"]


def join(first: Robot, second: Robot, merge: bool, tolerance: float) -> Robot:
    """Both robots as one, the first one's masses and springs first: see `Robot.joined`.

    Raises:
        ValueError: The tolerance [m] is negative or not finite, or both robots are actuated
            with different omegas.
    """
    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise ValueError(f"tolerance = {tolerance!r}: must be finite and at least 0 m")
    omega = _common_omega(first, second)
    index = np.arange(first.n_masses, first.n_masses + second.n_masses)
    if merge:
        index = _merged_index(first.positions, second.positions, tolerance)
    return _concatenated(first, second, index, omega, unique=merge)


def _common_omega(first: Robot, second: Robot) -> float:
    if first.is_actuated and second.is_actuated and first.omega != second.omega:
        raise ValueError(
            f"omega: {first.omega} rad/s and {second.omega} rad/s given, but joined robots share "
            "one omega and both are actuated"
        )
    return second.omega if second.is_actuated else first.omega


def _merged_index(first: FloatArray, second: FloatArray, tolerance: float) -> NDArray[np.intp]:
    """Where each mass of the second body is found in the merged one, shape (M2,)."""
    match = _coincident(first, second, tolerance)
    fresh = match < 0
    return np.where(fresh, len(first) + np.cumsum(fresh) - 1, match)


def _coincident(first: FloatArray, second: FloatArray, tolerance: float) -> NDArray[np.intp]:
    """For each point of the second set the nearest of the first within a tolerance, or -1."""
    # Projected on a direction that no lattice plane is perpendicular to, only points that lie
    # close together have close images, so sorting finds all pairs without comparing all.
    direction = np.array([0.53768, 0.64121, 0.54739])
    size = max(np.abs(first).max(), np.abs(second).max())
    margin = 1.01 * tolerance + 1e-15 * 8 * size  # the projection's own rounding
    order = np.argsort(first @ direction, kind="stable")
    images, wanted = (first @ direction)[order], second @ direction
    start = np.searchsorted(images, wanted - margin, side="left")
    count = np.searchsorted(images, wanted + margin, side="right") - start
    point = np.repeat(np.arange(len(second)), count)
    ranks = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    candidate = order[np.repeat(start, count) + ranks]
    distance = np.sqrt(((second[point] - first[candidate]) ** 2).sum(axis=1))
    match = np.full(len(second), -1, np.intp)
    near = np.flatnonzero(distance <= tolerance)
    near = near[np.argsort(-distance[near], kind="stable")]  # the nearest is written last
    match[point[near]] = candidate[near]
    return match


def _concatenated(
    first: Robot, second: Robot, index: NDArray[np.intp], omega: float, unique: bool
) -> Robot:
    """Both robots as one, mass i of the second becoming mass index[i] of the whole."""
    fresh = index >= first.n_masses
    masses = np.concatenate([first.masses, second.masses[fresh]])
    np.maximum.at(masses, index, second.masses)
    springs = np.concatenate([first.springs, index[second.springs].astype(np.int32)])
    faces = [first.faces, index[second.faces].astype(np.int32)]
    keep: slice | NDArray[np.intp] = slice(None)
    if unique:
        keep = _first_of_each_pair(springs, len(masses))
        faces = _exterior(*faces)
    materials = tuple(dict.fromkeys((*first.materials, *second.materials)))
    per_spring = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])[keep]
        for name in ("stiffness", "rest_length", "amplitude", "phase")
    }
    labels = [_relabelled(robot, materials) for robot in (first, second)]
    return Robot(
        masses=masses,
        positions=np.concatenate([first.positions, second.positions[fresh]]),
        velocities=np.concatenate([first.velocities, second.velocities[fresh]]),
        springs=springs[keep],
        omega=omega,
        faces=np.concatenate(faces),
        material=np.concatenate(labels)[keep],
        materials=materials,
        elements=join_elements(
            first.elements,
            second.elements,
            (first.n_springs, second.n_springs),
            index,
            keep=keep,
            masses=first.n_masses,
            fresh=fresh,
        ),
        **per_spring,
    )


def _relabelled(robot: Robot, materials: tuple[Material, ...]) -> IntArray:
    """The labels of a robot's springs in another table that holds all its materials."""
    number = np.array([*(materials.index(m) for m in robot.materials), -1], np.int32)
    return number[robot.material]  # -1, none, is the last one


def _first_of_each_pair(springs: IntArray, n_masses: int) -> NDArray[np.intp]:
    """Rows of the first spring between each pair of different masses, in their order."""
    low, high = springs.min(axis=1).astype(np.int64), springs.max(axis=1).astype(np.int64)
    rows = np.unique(low * n_masses + high, return_index=True)[1]
    return np.sort(rows[low[rows] != high[rows]])


def _exterior(first: IntArray, second: IntArray) -> list[IntArray]:
    """The faces of two bodies without those that meet back to back, repeat or have collapsed."""
    corners = np.sort(second, axis=1)
    second = second[(corners[:, 1:] != corners[:, :-1]).all(axis=1)]
    every = np.concatenate([_cyclic(first), _cyclic(second), _cyclic(second[:, ::-1])])
    group = np.unique(every, axis=0, return_inverse=True)[1].reshape(-1)
    one, two, back = np.split(group, [len(first), len(first) + len(second)])
    return [first[~np.isin(one, back)], second[~np.isin(back, one) & ~np.isin(two, one)]]


def _cyclic(faces: IntArray) -> IntArray:
    """Each triangle written from its smallest corner on, its winding kept."""
    start = faces.argmin(axis=1)[:, None] if len(faces) else np.zeros((0, 1), np.intp)
    return np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
