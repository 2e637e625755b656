"""Meshes and poses that an animation is made of, as NumPy arrays: no USD type in here."""

from __future__ import annotations

from functools import cache
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


class Detail(NamedTuple):
    """How finely round things are meshed.

    Attributes:
        sides: Faces around a bar. An odd number: the outline is then almost equally wide from
            every side.
        cuts: Cuts of each edge of the cube that is blown up to a ball.
    """

    sides: int
    cuts: int


COARSE, FINE = Detail(5, 2), Detail(9, 4)
_ARROW_SIDES = 16
_AXIS_STEPS = 12
"""Directions of bars are told apart in so many steps across a face of the unit cube."""


class Part(NamedTuple):
    """A mesh, of which every vertex may follow one mass.

    Attributes:
        points: Vertices [m], shape (V, 3).
        faces: Corners, counter-clockwise seen from outside, shape (faces, corners).
        masses: The mass that each vertex follows, shape (V,); ``None`` for scenery.
        normals: Outward unit normals, shape (N, 3), or ``None`` for flat faces.
        corner_normals: Which of them each corner has, shape (faces, corners), or ``None``.
    """

    points: FloatArray
    faces: IntArray
    masses: IntArray | None = None
    normals: FloatArray | None = None
    corner_normals: IntArray | None = None


def tubes(positions: FloatArray, springs: IntArray, radius: float, sides: int) -> Part:
    """Every spring as an open tube of so many faces; each end follows its mass.

    The first faces of all tubes come first, then the second ones: a value for each spring that is
    repeated for its faces is then the same sequence over and over, which packs well. Normals come
    from one table for all bodies, so that a file holds it once: a tube's ends are cut across the
    nearest direction of that table, at most 7 degrees from its own. A spring without length points
    up, so that its faces stay finite.
    """
    n, count = sides, len(springs)
    table = ring_normals(sides)
    along = positions[springs[:, 1]] - positions[springs[:, 0]]
    axis = nearest_axes(along)
    ring = table.reshape(-1, n, 3)[axis]
    ends = positions[springs][:, :, None] + radius * ring[:, None]
    side, spring = np.arange(n)[:, None], np.arange(count)
    ahead = (side + 1) % n
    # Counter-clockwise seen from outside also where the table's direction is the opposite one.
    turned = np.einsum("si,si->s", axes()[axis], along) < 0.0
    first, second = np.where(turned, ahead, side), np.where(turned, side, ahead)
    corners = np.stack([first, second, second + n, first + n], axis=-1)
    return Part(
        ends.reshape(-1, 3),
        (corners + 2 * n * spring[:, None]).reshape(-1, 4).astype(np.int32),
        np.repeat(springs.ravel(), n).astype(np.int32),
        table,
        (corners % n + n * axis[:, None]).reshape(-1, 4).astype(np.int32),
    )


def nearest_axes(vectors: FloatArray) -> IntArray:
    """Rows of the table of directions, shape (S,), nearest to vectors (S, 3) or their opposites."""
    vectors = np.where((vectors == 0.0).all(axis=1, keepdims=True), (0.0, 0.0, 1.0), vectors)
    face = np.abs(vectors).argmax(axis=1)
    rows = np.arange(len(vectors))
    across = np.stack([vectors[rows, (face + k) % 3] for k in (1, 2)]) / vectors[rows, face]
    u, v = np.rint((across + 1.0) * (_AXIS_STEPS / 2)).astype(np.int32)
    return (face * (_AXIS_STEPS + 1) + u) * (_AXIS_STEPS + 1) + v


@cache
def axes() -> FloatArray:
    """The table of directions: unit vectors (A, 3) through a grid on three faces of a cube."""
    line = np.linspace(-1.0, 1.0, _AXIS_STEPS + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
    first = np.stack([np.ones_like(u), u, v], axis=1)
    found = np.concatenate([np.roll(first, face, axis=1) for face in range(3)])
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@cache
def ring_normals(sides: int) -> FloatArray:
    """Around each direction of the table, so many unit vectors across it, (A * sides, 3)."""
    along = axes()
    u = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(along, u)
    angle = np.arange(sides)[:, None] * (2.0 * np.pi / sides)
    return (np.cos(angle) * u[:, None] + np.sin(angle) * v[:, None]).reshape(-1, 3)


def balls(positions: FloatArray, radius: float, cuts: int) -> Part:
    """A ball at every mass: a cube with each face cut in ``cuts`` squared, blown up."""
    corners, faces = _unit_ball(cuts)
    points = positions[:, None] + radius * corners
    m, n = len(positions), len(corners)
    return Part(
        points.reshape(-1, 3),
        _repeated(faces, m, n),
        np.repeat(np.arange(m, dtype=np.int32), n),
        corners,
        np.tile(faces, (m, 1)),
    )


def skin(positions: FloatArray, faces: IntArray) -> Part:
    """The exterior triangles, no vertex shared, so that every viewer shades them flat."""
    corners = faces.ravel()
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Part(positions[corners], triangles, corners)


def arrow(vector: FloatArray, radius: float) -> Part:
    """An arrow from the origin to the tip of a vector (3,), its shaft of a radius [m]."""
    length = float(np.linalg.norm(vector))
    radius = min(radius, 0.06 * length)
    neck = max(length - 7.0 * radius, 0.5 * length)
    # Rings: how far along, how wide; each pair of neighbours is a band of faces.
    rings = [(0.0, 0.0), (0.0, radius), (neck, radius), (neck, 2.5 * radius), (length, 0.0)]
    along = vector / length
    u = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    u /= np.linalg.norm(u)
    angle = np.arange(_ARROW_SIDES)[:, None] * (2.0 * np.pi / _ARROW_SIDES)
    around = np.cos(angle) * u + np.sin(angle) * np.cross(along, u)
    points = [far * along + wide * around for far, wide in rings]
    normals = []
    for (far, wide), (far2, wide2) in pairwise(rings):
        normal = (far2 - far) * around - (wide2 - wide) * along
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    n, band = _ARROW_SIDES, np.arange(len(rings) - 1)[:, None]
    side = np.arange(n)
    here, ahead = n * band + side, n * band + (side + 1) % n
    return Part(
        np.concatenate(points),
        np.stack([here, ahead, ahead + n, here + n], axis=-1).reshape(-1, 4).astype(np.int32),
        None,
        np.concatenate(normals),
        np.stack([here, ahead, ahead, here], axis=-1).reshape(-1, 4).astype(np.int32),
    )


def checker(half_tiles: int, tile: float) -> tuple[Part, NDArray[np.bool_]]:
    """A square floor of quads at z = 0 around the origin, and which of its tiles are dark."""
    n = 2 * half_tiles
    line = (np.arange(n + 1) - half_tiles) * tile
    x, y = np.meshgrid(line, line, indexing="ij")
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corner = i * (n + 1) + j
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return Part(points, quads.astype(np.int32)), (i + j) % 2 == 1


@cache
def _unit_ball(cuts: int) -> tuple[FloatArray, IntArray]:
    """A cube with every face cut in ``cuts`` squared, an even number, and blown up.

    Each square is cut along the diagonal that points to the middle of its face: 26 corners and 48
    triangles for 2 cuts, 98 and 192 for 4.
    """
    half = cuts // 2
    steps = range(-half, half + 1)
    corners = [c for c in product(steps, steps, steps) if max(map(abs, c)) == half]
    number = {corner: index for index, corner in enumerate(corners)}
    faces = []
    for axis, side, a, b in product(range(3), (-half, half), steps[:-1], steps[:-1]):
        square = [(a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)][:: 1 if side > 0 else -1]
        turn = min(range(4), key=lambda k: square[k][0] ** 2 + square[k][1] ** 2)
        p, q, r, s = (
            number[tuple(np.roll((side, u, v), axis).tolist())]
            for u, v in square[turn:] + square[:turn]
        )
        faces += [(p, q, r), (p, r, s)]
    # Angles instead of distances across a face: the squares come out about equally large.
    points = np.tan(np.array(corners) * (0.25 * np.pi / half))
    return points / np.linalg.norm(points, axis=1, keepdims=True), np.array(faces, np.int32)


def _repeated(faces: IntArray, copies: int, stride: int) -> IntArray:
    """The same faces for each of several copies of a shape with ``stride`` vertices."""
    steps = stride * np.arange(copies, dtype=np.int32)
    return (faces[None] + steps[:, None, None]).reshape(-1, faces.shape[1]).astype(np.int32)
