"""Geometry of points: lengths of springs, rotations, the largest distance between two."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FloatArray",
    "IntArray",
    "cross_matrix",
    "largest_distance",
    "rotation_matrix",
    "spring_lengths",
]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


def spring_lengths(positions: FloatArray, springs: IntArray) -> FloatArray:
    """Distance between the ends of each spring, (..., M, 3) and (S, 2) -> (..., S)."""
    d = positions.take(springs[:, 1], axis=-2) - positions.take(springs[:, 0], axis=-2)
    d *= d
    return np.sqrt(d[..., 0] + d[..., 1] + d[..., 2])


def cross_matrix(v: FloatArray) -> FloatArray:
    """The matrix K with K r = v x r, shape (3, 3)."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(axis: FloatArray, angle: float) -> FloatArray:
    """The rotation about an axis (3,) by an angle [rad], shape (3, 3).

    Rodrigues' formula: 1 + sin(angle) K + (1 - cos(angle)) K^2, K of the unit axis.

    Raises:
        ValueError: The axis is zero or the angle is not finite.
    """
    length = math.hypot(*axis)
    if length == 0.0:
        raise ValueError("axis = (0, 0, 0): an axis of rotation needs a direction")
    if not math.isfinite(angle):
        raise ValueError(f"angle = {angle!r}: must be finite (rad)")
    k = cross_matrix(axis / length)
    # 1 - cos written as 2 sin^2 of the half angle keeps its digits at small angles.
    return np.eye(3) + math.sin(angle) * k + 2.0 * math.sin(angle / 2.0) ** 2 * (k @ k)


def largest_distance(positions: FloatArray) -> float:
    """The distance between the two points furthest apart, (M, 3) -> one number."""
    centred = positions - positions.mean(axis=0)
    radius = np.sqrt(np.einsum("ij,ij->i", centred, centred))
    start = centred[np.argmax(radius)]
    least = np.sqrt(((centred - start) ** 2).sum(axis=1).max())
    # Two points are no further apart than the sum of their distances from the centre, so only
    # points this far out can beat the distance already found.
    outer = centred[radius + radius.max() >= least * (1.0 - 1e-12)]
    rows = max(1, 2**20 // len(outer))
    chunks = (outer[i : i + rows, None] - outer for i in range(0, len(outer), rows))
    return float(np.sqrt(max(np.einsum("abi,abi->ab", d, d).max() for d in chunks)))
