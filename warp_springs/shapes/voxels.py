"""Bodies of cubes: one, a block, or any mask of voxels grown together."""

from __future__ import annotations

import itertools
import math
import operator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.body.fields import require_positive
from warp_springs.robot import Robot

__all__ = ["cube", "lattice", "voxels"]

# The eight corners of a voxel in units of its edge, x-major, z fastest.
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
# Voxels of a lattice whose tables are worth keeping: larger ones cost memory and are built once.
_KEPT_VOXELS = 4096


def cube(edge: float = 0.1, mass: float = 0.8, stiffness: float = 1000.0) -> Robot:
    """A cube: 8 equal masses, 28 springs between all pairs, 12 triangles.

    Args:
        edge: Length of an edge [m].
        mass: Total mass [kg].
        stiffness: Stiffness of every spring [N/m].

    Returns:
        The cube with its lowest corner at the origin and its edges along the axes.

    Raises:
        ValueError: A parameter is not a positive, finite number.
    """
    return voxels(np.ones((1, 1, 1), bool), edge, require_positive("mass", mass) / 8.0, stiffness)


def lattice(
    nx: int,
    ny: int,
    nz: int,
    edge: float = 0.1,
    mass_per_vertex: float = 0.1,
    stiffness: float = 1000.0,
) -> Robot:
    """A block of nx x ny x nz voxels: `voxels` of a full mask.

    Args:
        nx: Voxels along x.
        ny: Voxels along y.
        nz: Voxels along z.
        edge: Length of a voxel's edge [m].
        mass_per_vertex: Mass of every vertex [kg].
        stiffness: Stiffness of every spring [N/m].

    Raises:
        ValueError: A count is below 1, or a parameter is not a positive, finite number.
        TypeError: A count is not a whole number.
    """
    shape = []
    for name, count in (("nx", nx), ("ny", ny), ("nz", nz)):
        try:
            shape.append(operator.index(count))
        except TypeError:
            raise TypeError(f"{name} = {count!r}: must be a whole number of voxels") from None
        if shape[-1] < 1:
            raise ValueError(f"{name} = {count}: a lattice has at least 1 voxel along each axis")
    return voxels(np.ones(shape, bool), edge, mass_per_vertex, stiffness)


def voxels(
    mask: ArrayLike,
    edge: float = 0.1,
    mass_per_vertex: float = 0.1,
    stiffness: float = 1000.0,
) -> Robot:
    """The cubes of a 3-D mask, grown together: each vertex and each spring exists once.

    A voxel has 28 springs (12 edges, 12 face diagonals, 4 space diagonals); neighbours share
    those between the vertices that they share. Vertices are ordered x-major with z fastest,
    springs by (lower, higher) index. Each exterior square is two triangles, outward.

    Args:
        mask: Which voxels exist, shape (nx, ny, nz), boolean or 0 and 1.
        edge: Length of a voxel's edge [m].
        mass_per_vertex: Mass of every vertex [kg], shared or not.
        stiffness: Stiffness of every spring [N/m], shared or not.

    Returns:
        The body with voxel (i, j, .) at x from i to i + 1 and y from j to j + 1 edges, and with
        its lowest layer on the ground.

    Raises:
        ValueError: The mask is not 3-D, empty, or holds something else than 0 and 1, or a
            parameter is not a positive, finite number.
    """
    edge = require_positive("edge", edge)
    mass = require_positive("mass_per_vertex", mass_per_vertex)
    stiffness = require_positive("stiffness", stiffness)
    solid = _checked_mask(mask)
    table = voxel_table(solid.shape)

    present = np.append(solid.reshape(-1), False)  # the last one stands for "outside"
    vertices = np.flatnonzero(_any_of(present, table.vertex_voxels))
    edges = np.flatnonzero(_any_of(present, table.edge_voxels))
    inside, outside = table.quad_voxels
    quads = np.flatnonzero(present.take(inside) & ~present.take(outside))

    number = np.empty(len(table.grid), np.int32)
    number[vertices] = np.arange(len(vertices), dtype=np.int32)
    grid = table.grid.take(vertices, axis=0)
    grid[:, 2] -= grid[:, 2].min()
    return Robot(
        masses=mass,
        positions=grid * edge,
        springs=number.take(table.edges.take(edges, axis=0)),
        stiffness=stiffness,
        faces=number.take(table.quads.take(quads, axis=0)).reshape(-1, 3),
    )


def _checked_mask(mask: ArrayLike) -> NDArray[np.bool_]:
    array = np.asarray(mask)
    if array.ndim != 3:
        raise ValueError(f"mask: shape {array.shape} given, (nx, ny, nz) expected")
    if array.dtype != np.bool_:
        good = (array == 0) | (array == 1)
        if not np.all(good):
            at = tuple(int(i) for i in np.argwhere(~good)[0])
            raise ValueError(f"mask{list(at)} = {array[at]!r}: must be a boolean, or 0 or 1")
        array = array == 1
    if not array.any():
        raise ValueError(f"mask: no voxel is set in the mask of shape {array.shape}")
    return array


def _any_of(present: NDArray[np.bool_], voxels_of: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether any of the voxels in each column is present, (K, E) -> (E,)."""
    return np.logical_or.reduce(present.take(voxels_of), axis=0)


@dataclass(frozen=True)
class _Template:
    """Everything that a body of voxels in a bounding lattice of one shape may contain.

    Voxels are numbered x-major; number n_voxels is the outside, which is never present.
    """

    grid: NDArray[np.float64]
    """Lattice coordinates of the vertices, shape (V, 3)."""
    vertex_voxels: NDArray[np.intp]
    """The voxels around each vertex, shape (8, V)."""
    edges: NDArray[np.int32]
    """The vertices that a spring may join, lower first, in ascending order, shape (E, 2)."""
    edge_voxels: NDArray[np.intp]
    """The voxels that contain both ends of each spring, in ascending order, shape (4, E)."""
    quads: NDArray[np.int32]
    """The two triangles of each side of each voxel, outward, shape (Q, 6)."""
    quad_voxels: NDArray[np.intp]
    """The voxel on the inner and on the outer side of each square, shape (2, Q)."""


def voxel_table(shape: tuple[int, int, int]) -> _Template:
    """The table of a bounding lattice; those of moderate size are kept."""
    build = _template if math.prod(shape) <= _KEPT_VOXELS else _template.__wrapped__
    return build(shape)


@lru_cache(maxsize=64)
def _template(shape: tuple[int, int, int]) -> _Template:
    points = np.array(shape) + 1
    strides = np.array([points[1] * points[2], points[2], 1])
    cells = np.indices(shape).reshape(3, -1).T
    corners = cells @ strides + (_CORNERS @ strides)[:, None]  # vertex numbers, (8, voxels)
    n_vertices, n_voxels = int(points.prod()), len(cells)

    low, high = np.triu_indices(8, 1)  # a later corner has the higher vertex number
    codes, edge_voxels = _incidence(corners[low] * n_vertices + corners[high], width=4)
    _, vertex_voxels = _incidence(corners, width=8)

    quads, inside, outside = [], np.tile(np.arange(n_voxels), 6), []
    numbers = np.full(np.array(shape) + 2, n_voxels)
    numbers[1:-1, 1:-1, 1:-1] = np.arange(n_voxels).reshape(shape)
    for axis, side in itertools.product(range(3), (0, 1)):
        quads.append(corners[_side_triangles(axis, side)].T)
        beyond = cells + 1
        beyond[:, axis] += 2 * side - 1
        outside.append(numbers[tuple(beyond.T)])
    return _Template(
        grid=np.indices(points).reshape(3, -1).T.astype(np.float64),
        vertex_voxels=vertex_voxels,
        edges=np.stack(np.divmod(codes, n_vertices), axis=1).astype(np.int32),
        edge_voxels=np.sort(edge_voxels, axis=0),
        quads=np.concatenate(quads).astype(np.int32),
        quad_voxels=np.stack([inside, np.concatenate(outside)]),
    )


def _incidence(codes: NDArray[np.intp], width: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The distinct codes of a (parts, voxels) table in order, and the voxels that have each.

    The second array has shape (width, distinct), filled up with the number of voxels.
    """
    n_voxels = codes.shape[1]
    flat = codes.reshape(-1)
    order = np.argsort(flat, kind="stable")
    distinct, start, count = np.unique(flat[order], return_index=True, return_counts=True)
    owners = np.full((width, len(distinct)), n_voxels)
    rank = np.arange(len(flat)) - np.repeat(start, count)
    owners[rank, np.repeat(np.arange(len(distinct)), count)] = order % n_voxels
    return distinct, owners


def _side_triangles(axis: int, side: int) -> NDArray[np.intp]:
    """Corners (0 to 7) of the two outward triangles of one side of a voxel, shape (6,).

    The sides at both ends of an axis are cut along the same diagonal, so that the triangles of
    two voxels that touch coincide and can be recognised as interior.
    """
    weight = np.array([4, 2, 1])  # of x, y, z in the number of a corner
    u, v = weight[(axis + 1) % 3], weight[(axis + 2) % 3]
    square = side * weight[axis] + np.array([0, u, u + v, 0, u + v, v])
    return square if side == 1 else square[::-1]
