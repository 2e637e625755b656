"""Obstacles as meshes, for every view that draws them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.surfaces import Box, HeightField, Plane, Sphere

__all__ = ["grid_mesh", "obstacle_mesh"]

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]

RINGS, SIDES = 24, 48
"""Faces of a ball from pole to pole and around."""
PLANE_REACH = 1.5
"""Half the side of a plane's square in diagonals of the box that it is drawn for."""


def obstacle_mesh(obstacle: Plane | Sphere | Box | HeightField, box: ArrayLike) -> Mesh:
    """Points (V, 3) in m and outward triangles (T, 3) of an obstacle.

    Args:
        obstacle: One of ``scene.obstacles``.
        box: Lowest and highest corner of where the robots are [m], shape (2, 3). Of a plane, which
            has no end, the square nearest to the middle of the box is drawn.
    """
    if isinstance(obstacle, Plane):
        return _plane(obstacle, np.asarray(box, np.float64))
    if isinstance(obstacle, Sphere):
        points, triangles = grid_mesh(RINGS + 1, SIDES + 1)
        polar, around = np.pi * points[:, 0] / RINGS, 2.0 * np.pi * points[:, 1] / SIDES
        unit = (np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar))
        return np.array(obstacle.center) + obstacle.radius * np.stack(unit, axis=1), triangles
    if isinstance(obstacle, Box):
        half = 0.5 * np.array(obstacle.size)
        return np.array(obstacle.center) + (_CORNERS * half) @ obstacle.rotation.T, _BOX
    points, triangles = grid_mesh(*obstacle.heights.shape)
    points[:, :2] *= obstacle.spacing
    points[:, 2] = obstacle.heights.ravel()
    return points + np.array(obstacle.origin), triangles


def _plane(plane: Plane, box: NDArray[np.float64]) -> Mesh:
    normal, middle = np.array(plane.normal), box.mean(axis=0)
    foot = middle - (normal @ middle - plane.offset) * normal
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u *= PLANE_REACH * np.linalg.norm(box[1] - box[0]) / np.linalg.norm(u)
    v = np.cross(normal, u)
    square = np.stack([foot - u - v, foot + u - v, foot + u + v, foot - u + v])
    return square, np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def grid_mesh(rows: int, columns: int) -> Mesh:
    """Points (i, j, 0) of a grid, and its triangles, whose normals are +z."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    points = np.stack([i, j, np.zeros_like(i)], axis=-1).reshape(-1, 3).astype(np.float64)
    first = (i * columns + j)[:-1, :-1].ravel()
    a, b, c, d = first, first + columns, first + columns + 1, first + 1
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_BOX = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip
