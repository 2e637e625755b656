"""Meshes and poses that an animation is made of, as NumPy arrays: no USD type in here."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

TUBE_SIDES = 6


class Part(NamedTuple):
    """A mesh of which every vertex follows one mass.

    Attributes:
        points: Vertices [m], shape (V, 3).
        normals: Outward unit normals for smooth shading, shape (V, 3), or ``None`` for flat faces.
        faces: Corners, counter-clockwise seen from outside, shape (faces, corners).
        masses: The mass that each vertex follows, shape (V,).
    """

    points: FloatArray
    normals: FloatArray | None
    faces: IntArray
    masses: IntArray


def tubes(positions: FloatArray, springs: IntArray, radius: float) -> Part:
    """Every spring as an open tube of `TUBE_SIDES` faces; each end follows its mass.

    A spring without length points up, so that its faces stay finite.
    """
    n = TUBE_SIDES
    axis = positions[springs[:, 1]] - positions[springs[:, 0]]
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.divide(axis, length, out=np.tile((0.0, 0.0, 1.0), (len(axis), 1)), where=length > 0)
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axis, u)
    angle = np.arange(n)[:, None] * (2.0 * np.pi / n)
    ring = np.cos(angle) * u[:, None] + np.sin(angle) * v[:, None]
    ends = positions[springs][:, :, None] + radius * ring[:, None]
    side = np.arange(n)
    ahead = (side + 1) % n
    face = np.stack([side, ahead, ahead + n, side + n], axis=1)
    return Part(
        ends.reshape(-1, 3),
        np.repeat(ring[:, None], 2, axis=1).reshape(-1, 3),
        _repeated(face, len(springs), 2 * n),
        np.repeat(springs.ravel(), n).astype(np.int32),
    )


def balls(positions: FloatArray, radius: float) -> Part:
    """A ball of 80 faces at every mass."""
    corners, faces = _unit_ball()
    points = positions[:, None] + radius * corners
    m, n = len(positions), len(corners)
    return Part(
        points.reshape(-1, 3),
        np.tile(corners, (m, 1)),
        _repeated(faces, m, n),
        np.repeat(np.arange(m, dtype=np.int32), n),
    )


def skin(positions: FloatArray, faces: IntArray) -> Part:
    """The exterior triangles, no vertex shared, so that every viewer shades them flat."""
    corners = faces.ravel()
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Part(positions[corners], None, triangles, corners)


def checker(half_tiles: int, tile: float) -> tuple[FloatArray, IntArray, NDArray[np.bool_]]:
    """A square floor at z = 0 around the origin: points, quads facing up, which tiles are dark."""
    n = 2 * half_tiles
    line = (np.arange(n + 1) - half_tiles) * tile
    x, y = np.meshgrid(line, line, indexing="ij")
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corner = i * (n + 1) + j
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return points, quads.astype(np.int32), (i + j) % 2 == 1


def rigid_fit(rest: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centres (F, 3) and rotations (F, 3, 3) that carry a body's rest shape nearest to its frames.

    Kabsch 1976 (doi:10.1107/S0567739476001873), all frames at once. ``rest`` has shape (M, 3) and
    zero mean, ``frames`` (F, M, 3). A body that leaves the rotation open (a point, a line) takes
    the smallest one.
    """
    centres = frames.mean(axis=1)
    covariance = np.einsum("fmi,mj->fij", frames - centres[:, None], rest)
    spread = np.linalg.norm(covariance, axis=(1, 2))
    # A trace of the identity decides what the body leaves open, and is below its own noise.
    covariance += np.where(spread > 0.0, 1e-9 * spread, 1.0)[:, None, None] * np.eye(3)
    left, _, right = np.linalg.svd(covariance)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return centres, left @ right


def quaternions(rotations: FloatArray, before: FloatArray | None = None) -> FloatArray:
    """Unit quaternions (x, y, z, w), shape (F, 4), of rotations (F, 3, 3).

    Each has the sign nearer to the one before it, and the first to ``before`` (4,), so that a
    viewer that interpolates turns the short way. Shepperd 1978 (doi:10.2514/3.55767b).
    """
    r = rotations
    diagonal = np.diagonal(r, axis1=1, axis2=2)
    trace = diagonal.sum(axis=1)
    # Row k of the symmetric matrix 4 q q^T for q = (x, y, z, w); the largest diagonal is safest.
    outer = np.empty((len(r), 4, 4))
    outer[:, :3, :3] = r + r.transpose(0, 2, 1)
    for axis in range(3):
        outer[:, axis, axis] = 1.0 + 2.0 * diagonal[:, axis] - trace
        j, k = (axis + 1) % 3, (axis + 2) % 3
        outer[:, axis, 3] = outer[:, 3, axis] = r[:, k, j] - r[:, j, k]
    outer[:, 3, 3] = 1.0 + trace
    best = np.diagonal(outer, axis1=1, axis2=2).argmax(axis=1)
    q = outer[np.arange(len(r)), best]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    earlier = np.concatenate([q[:1] if before is None else before[None], q[:-1]])
    turns = np.where(np.einsum("fi,fi->f", q, earlier) < 0.0, -1.0, 1.0)
    return q * np.cumprod(turns)[:, None]


@cache
def _unit_ball() -> tuple[FloatArray, IntArray]:
    """An icosahedron with every face cut in four: 42 corners on the unit sphere, 80 faces."""
    golden = (1.0 + 5.0**0.5) / 2.0
    base = np.array([(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([np.roll(base, shift, axis=1) for shift in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = [(a, b) for a, b in combinations(range(12), 2) if abs(apart[a, b] - 2.0) < 1e-9]
    middle = {pair: 12 + index for index, pair in enumerate(near)}
    corners = np.concatenate([corners, [corners[a] + corners[b] for a, b in near]])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    faces = []
    for a, b, c in combinations(range(12), 3):
        if {(a, b), (b, c), (a, c)} <= middle.keys():
            ab, bc, ac = middle[a, b], middle[b, c], middle[a, c]
            faces += [(a, ab, ac), (ab, b, bc), (ac, bc, c), (ab, bc, ac)]
    faces = np.array(faces, dtype=np.int32)
    p, q, r = corners[faces].transpose(1, 0, 2)
    inward = np.einsum("ti,ti->t", np.cross(q - p, r - p), p + q + r) < 0.0
    faces[inward] = faces[inward, ::-1]
    return corners, faces


def _repeated(faces: IntArray, copies: int, stride: int) -> IntArray:
    """The same faces for each of several copies of a shape with ``stride`` vertices."""
    steps = stride * np.arange(copies, dtype=np.int32)
    return (faces[None] + steps[:, None, None]).reshape(-1, faces.shape[1]).astype(np.int32)
