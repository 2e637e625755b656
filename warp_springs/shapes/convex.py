"""Convex bodies with a spring between each two of their masses."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from warp_springs.body.fields import require_positive
from warp_springs.robot import Robot

__all__ = ["octahedron", "tetrahedron"]


def tetrahedron(edge: float = 0.1, mass: float = 0.4, stiffness: float = 1000.0) -> Robot:
    """A regular tetrahedron: 4 equal masses, 6 springs, 4 triangles.

    Args:
        edge: Length of an edge [m].
        mass: Total mass [kg].
        stiffness: Stiffness of every spring [N/m].

    Returns:
        The tetrahedron standing on a face, its tip above the origin.

    Raises:
        ValueError: A parameter is not a positive, finite number.
    """
    edge = require_positive("edge", edge)
    tip = (0.0, 0.0, edge * math.sqrt(2.0 / 3.0))
    positions = np.vstack([_triangle(edge, height=0.0, turn=0.0), tip])
    faces = np.array(list(itertools.combinations(range(4), 3)))
    return _braced(positions, faces, mass, stiffness)


def octahedron(edge: float = 0.1, mass: float = 0.6, stiffness: float = 1000.0) -> Robot:
    """A regular octahedron: 6 equal masses, 12 edges and 3 diagonals as springs, 8 triangles.

    Args:
        edge: Length of an edge [m].
        mass: Total mass [kg].
        stiffness: Stiffness of every spring [N/m].

    Returns:
        The octahedron standing on a face, its centre above the origin.

    Raises:
        ValueError: A parameter is not a positive, finite number.
    """
    edge = require_positive("edge", edge)
    floor = _triangle(edge, height=0.0, turn=0.0)
    roof = _triangle(edge, height=edge * math.sqrt(2.0 / 3.0), turn=math.pi)
    # Masses i and i + 3 are opposite; a face takes one mass of each opposite pair.
    faces = np.array(list(itertools.product((0, 3), (1, 4), (2, 5))))
    return _braced(np.vstack([floor, roof]), faces, mass, stiffness)


def _triangle(edge: float, height: float, turn: float) -> NDArray[np.float64]:
    """The corners of a level regular triangle about the z axis, shape (3, 3)."""
    angle = turn + 2.0 * math.pi / 3.0 * np.arange(3)
    radius = edge / math.sqrt(3.0)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(3, height)], axis=1)


def _braced(
    positions: NDArray[np.float64], faces: NDArray[np.intp], mass: float, stiffness: float
) -> Robot:
    """A convex body of equal masses with a spring between each two; turns its faces outward."""
    a, b, c = positions[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    inward = np.einsum("ij,ij->i", normal, a - positions.mean(axis=0)) < 0.0
    return Robot(
        masses=require_positive("mass", mass) / len(positions),
        positions=positions,
        springs=np.stack(np.triu_indices(len(positions), 1), axis=1),
        stiffness=require_positive("stiffness", stiffness),
        faces=np.where(inward[:, None], faces[:, ::-1], faces),
    )
