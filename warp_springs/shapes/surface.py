"""Closed triangle surfaces: welding, orienting, which points lie inside, a sphere's."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from warp_springs.geometry import FloatArray

__all__ = [
    "closed_surface",
    "components",
    "distinct_edges",
    "inside",
    "sphere_surface",
    "vertex_normals",
    "without_folds",
]

IndexArray = NDArray[np.intp]


def closed_surface(positions: FloatArray, faces: IndexArray) -> tuple[FloatArray, IndexArray]:
    """A surface welded where its vertices coincide, without unused vertices, faces outward.

    Args:
        positions: Vertices [m], shape (V, 3).
        faces: Corners of the triangles, shape (T, 3), in a consistent winding.

    Raises:
        ValueError: The surface is empty or not closed: an edge is not shared by two triangles of
            opposite directions.
    """
    if len(faces) == 0:
        raise ValueError("surface: it has no triangles")
    positions = np.asarray(positions, np.float64)
    size = float(np.ptp(positions, axis=0).max()) or 1.0
    # Two cells of a grid may hold one vertex that lies between them; files repeat vertices to the
    # bit or with the few digits of their text, so that does not happen to them in practice.
    places = np.rint((positions - positions.min(axis=0)) / (1e-7 * size)).astype(np.int64)
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    faces = number.reshape(-1)[np.asarray(faces)]
    corners = np.sort(faces, axis=1)
    faces = faces[(corners[:, 1:] != corners[:, :-1]).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    positions, faces = positions[first[used]], faces.reshape(-1, 3)
    _check_closed(faces, len(positions))
    a, b, c = (positions - positions.mean(axis=0))[faces].transpose(1, 0, 2)
    if np.einsum("ij,ij->", a, np.cross(b, c)) < 0.0:
        faces = faces[:, ::-1]
    return positions, faces


def _check_closed(faces: IndexArray, n: int) -> None:
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    there, there_count = np.unique(tail * n + head, return_counts=True)
    back, back_count = np.unique(head * n + tail, return_counts=True)
    if np.array_equal(there, back) and np.array_equal(there_count, back_count):
        return
    loose = len(np.setdiff1d(there, back))
    raise ValueError(
        f"surface: it is not closed; {loose or 'some'} edges of its {len(faces)} triangles have no "
        "neighbour that runs the other way"
    )


def distinct_edges(faces: IndexArray) -> IndexArray:
    """Each edge of the triangles once, lower index first, in ascending order, shape (E, 2)."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.unique(np.sort(edges, axis=1), axis=0)


def vertex_normals(positions: FloatArray, faces: IndexArray) -> FloatArray:
    """The unit normal of each vertex, the mean of its triangles' by their areas, (V, 3)."""
    a, b, c = positions[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    total = np.zeros_like(positions)
    for corner in faces.T:
        np.add.at(total, corner, normal)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0.0, length, 1.0)


def components(n: int, pairs: IndexArray) -> int:
    """Number of connected parts of n points joined by pairs (K, 2)."""
    label = np.arange(n)
    while True:
        low = np.minimum(label[pairs[:, 0]], label[pairs[:, 1]])
        better = label.copy()
        np.minimum.at(better, label[pairs[:, 0]], low)
        np.minimum.at(better, label[pairs[:, 1]], low)
        better = better[better]
        if np.array_equal(better, label):
            return len(np.unique(label))
        label = better


def without_folds(faces: IndexArray) -> IndexArray:
    """Triangles (T, 3) without those that lie back to back, in pairs, and without repetitions."""
    start = faces.argmin(axis=1)[:, None] if len(faces) else np.zeros((0, 1), np.intp)
    cyclic = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
    even = cyclic[:, 1] < cyclic[:, 2]
    corners = np.where(even[:, None], cyclic, cyclic[:, [0, 2, 1]])
    _, group = np.unique(corners, axis=0, return_inverse=True)
    group = group.reshape(-1)
    turns = np.bincount(group, np.where(even, 1.0, -1.0))
    sign = np.where(even, 1.0, -1.0)
    rows = np.flatnonzero(turns[group] * sign > 0.0)
    _, first = np.unique(group[rows], return_index=True)
    return faces[rows[np.sort(first)]]


def inside(points: FloatArray, positions: FloatArray, faces: IndexArray) -> NDArray[np.bool_]:
    """Whether each point lies inside a closed surface whose faces turn outward.

    Counts the triangles above each point, those that look up less those that look down: the
    winding number. No ray slips between two triangles, because the two share the arithmetic of
    their common edge.

    Args:
        points: Points [m], shape (P, 3).
        positions: Vertices [m], shape (V, 3).
        faces: Corners of the triangles, shape (T, 3).

    Returns:
        Shape (P,). For points on the surface either answer is right.
    """
    triangle, point = _columns(points, positions, faces)
    x, y = points[point, :2].T
    corners = faces[triangle]
    crossed = np.zeros(len(point), bool)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        # From the lower to the higher vertex, so that both triangles compute the same.
        low = positions[np.minimum(corners[:, i], corners[:, j])]
        high = positions[np.maximum(corners[:, i], corners[:, j])]
        spans = (low[:, 1] > y) != (high[:, 1] > y)
        rise = np.where(spans, high[:, 1] - low[:, 1], 1.0)
        crossing = low[:, 0] + (y - low[:, 1]) * (high[:, 0] - low[:, 0]) / rise
        crossed ^= spans & (x < crossing)
    a, b, c = positions[corners[crossed]].transpose(1, 0, 2)
    point = point[crossed]
    normal = np.cross(b - a, c - a)
    # A triangle that is crossed from above is not upright, so the plane can be solved for z.
    flat = normal[:, 2] == 0.0
    slope = np.where(flat, 1.0, normal[:, 2])
    offset = points[point] - a
    height = -(normal[:, 0] * offset[:, 0] + normal[:, 1] * offset[:, 1]) / slope
    above = ~flat & (height > offset[:, 2])
    winding = np.bincount(point[above], np.sign(normal[above, 2]), minlength=len(points))
    return winding > 0.5


def _columns(
    points: FloatArray, positions: FloatArray, faces: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """All pairs of a triangle and a point that may lie below or above it."""
    low, high = positions[faces].min(axis=1)[:, :2], positions[faces].max(axis=1)[:, :2]
    origin = low.min(axis=0)
    size = np.maximum((high - low).mean(axis=0), np.ptp(positions[:, :2], axis=0) / 512) + 1e-300
    count = ((high.max(axis=0) - origin) / size).astype(np.intp) + 1
    cell = np.floor((points[:, :2] - origin) / size).astype(np.intp)
    near = np.flatnonzero(((cell >= 0) & (cell < count)).all(axis=1))
    number = cell[near] @ np.array([count[1], 1])
    order = np.argsort(number, kind="stable")
    near, number = near[order], number[order]

    first = ((low - origin) / size).astype(np.intp)
    last = ((high - origin) / size).astype(np.intp)
    triangle, column = _ranges(first[:, 0], last[:, 0] + 1)
    start = np.searchsorted(number, column * count[1] + first[triangle, 1], side="left")
    end = np.searchsorted(number, column * count[1] + last[triangle, 1], side="right")
    row, at = _ranges(start, end)
    return triangle[row], near[at]


def _ranges(start: IndexArray, end: IndexArray) -> tuple[IndexArray, IndexArray]:
    """The integers from start[i] to before end[i] for each i, with the i they belong to."""
    count = end - start
    owner = np.repeat(np.arange(len(start)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count - start, count)


def sphere_surface(radius: float, subdivisions: int) -> tuple[FloatArray, IndexArray]:
    """An icosahedron whose triangles are quartered so many times, its vertices on a sphere."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    signs = itertools.product((-1.0, 1.0), (-golden, golden))
    points = np.array([np.roll((0.0, a, b), k) for a, b in signs for k in range(3)])
    # Faces join vertices that are an edge (2) apart.
    d = np.linalg.norm(points[:, None] - points, axis=2)
    faces = np.array(
        [
            f
            for f in itertools.combinations(range(12), 3)
            if all(abs(d[i, j] - 2.0) < 0.1 for i, j in itertools.combinations(f, 2))
        ]
    )
    a, b, c = points[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0.0
    faces[inward] = faces[inward, ::-1]
    for _ in range(subdivisions):
        points, faces = _quartered(points, faces)
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True), faces


def _quartered(points: FloatArray, faces: IndexArray) -> tuple[FloatArray, IndexArray]:
    """Each triangle as four, new vertices in the middle of its edges and on the unit sphere."""
    points = points / np.linalg.norm(points, axis=1, keepdims=True)
    edges = distinct_edges(faces)
    codes = edges @ np.array([len(points), 1])
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    middle = len(points) + np.searchsorted(codes, ends @ np.array([len(points), 1]))
    a, b, c = faces.T
    ab, bc, ca = middle.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.concatenate([points, points[edges].mean(axis=1)]), faces
