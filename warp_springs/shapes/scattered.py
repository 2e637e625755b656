"""Random lattices: masses scattered evenly in a volume, springs between neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.fields import require_positive, require_whole
from warp_springs.geometry import FloatArray, IntArray, spring_lengths
from warp_springs.robot import Robot
from warp_springs.shapes.points import pairs_within, scattered_points
from warp_springs.shapes.surface import without_folds
from warp_springs.shapes.voxels import lattice

__all__ = ["random_lattice"]

_MOST_CELLS = 2**21
"""Cells of the grid whose surface becomes the skin; a larger lattice has none."""


def random_lattice(
    bounds: ArrayLike,
    spacing: float,
    seed: int = 0,
    *,
    reach: float = 2.3,
    n_springs: int | None = None,
    mass: float = 1.0,
    stiffness: float = 1000.0,
) -> Robot:
    """A box filled with random masses, each joined to its neighbours.

    The masses are a maximal Poisson-disc sample: no two are closer than the spacing, and no
    further mass would fit. A spring joins all masses no further apart than ``reach`` spacings, or
    the ``n_springs`` closest pairs. The same arguments give the same lattice, bit for bit.

    The default reach is the one that gives the course's worm, a box of 0.1875 x 0.0375 x 0.1875 m
    with a spacing of 0.004 m, its 270,033 bars within half a percent, whatever the seed; with
    ``n_springs=270_033`` it has exactly as many.

    Args:
        bounds: Size of the box [m], shape (3,), its lowest corner then at the origin; or its
            lowest and highest corner, shape (2, 3).
        spacing: Least distance [m] of two masses.
        seed: From which the places follow, a whole number of 0 or more.
        reach: Longest spring in spacings, at least 1.
        n_springs: Exactly how many springs, instead of all within reach.
        mass: Of the whole body [kg], the same for each of its masses.
        stiffness: Of every spring [N/m].

    Returns:
        The lattice, masses ordered by place, springs by (lower, higher) index. Its faces are those
        of the box, their corners moved to the nearest mass; none where the box is too thin.

    Raises:
        ValueError: A parameter is out of range, or there are fewer pairs than springs asked for.
    """
    low, high = _box(bounds)
    spacing = require_positive("spacing", spacing)
    if not (np.isfinite(reach) and reach >= 1.0):
        raise ValueError(f"reach = {reach!r}: must be a number of spacings, at least 1")
    points = scattered_points(
        low, high, spacing, np.random.default_rng(require_whole("seed", seed, 0))
    )
    if n_springs is None:
        springs = pairs_within(points, reach * spacing)
    else:
        springs = _closest_pairs(points, require_whole("n_springs", n_springs, 1), reach * spacing)
    return Robot(
        masses=require_positive("mass", mass) / len(points),
        positions=points,
        springs=springs,
        stiffness=require_positive("stiffness", stiffness),
        faces=_skin(points, low, high, spacing),
    )


def _skin(points: FloatArray, low: FloatArray, high: FloatArray, spacing: float) -> IntArray:
    """Triangles over the outermost masses: the surface of a grid moved onto them, still closed."""
    cells = np.maximum(np.rint((high - low) / spacing).astype(int), 1)
    if cells.max() < 2 or cells.prod() > _MOST_CELLS:
        return np.zeros((0, 3), np.int32)
    grid = lattice(*cells, edge=1.0)
    corners, faces = np.unique(grid.faces, return_inverse=True)
    places = low + grid.positions[corners] * ((high - low) / cells)
    outer = np.flatnonzero((np.minimum(points - low, high - points) < spacing).any(axis=1))
    nearest = outer[_nearest(places, points[outer])]
    faces = nearest[faces.reshape(-1, 3)]
    proper = np.sort(faces, axis=1)
    faces = faces[(proper[:, 1:] != proper[:, :-1]).all(axis=1)]
    return without_folds(faces).astype(np.int32)


def _nearest(places: FloatArray, points: FloatArray) -> np.ndarray:
    """The nearest point of each place, (P, 3) and (Q, 3) -> (P,)."""
    rows = max(1, 2**22 // len(points))
    squares = (points**2).sum(axis=1)
    parts = [
        np.argmin(squares - 2.0 * places[i : i + rows] @ points.T, axis=1)
        for i in range(0, len(places), rows)
    ]
    return np.concatenate(parts)


def _closest_pairs(points: FloatArray, count: int, reach: float) -> np.ndarray:
    """The so many closest pairs of points; looks as far as it must from a first guess on."""
    possible = len(points) * (len(points) - 1) // 2
    if count > possible:
        raise ValueError(
            f"n_springs = {count}: {len(points)} masses have only {possible} pairs; "
            "choose a smaller spacing"
        )
    while len(pairs := pairs_within(points, reach)) < count:
        reach *= 1.25
    longest = np.argsort(spring_lengths(points, pairs), kind="stable")[:count]
    return pairs[np.sort(longest)]


def _box(bounds: ArrayLike) -> FloatArray:
    """The lowest and the highest corner of a box given by its size or by its corners, (2, 3)."""
    box = np.asarray(bounds, np.float64)
    if box.shape == (3,):
        box = np.stack([np.zeros(3), box])
    if box.shape != (2, 3) or not np.isfinite(box).all() or not (box[0] < box[1]).all():
        raise ValueError(
            f"bounds = {bounds!r}: must be the size of a box (x, y, z) or its lowest and highest "
            "corner, finite and larger than zero along each axis"
        )
    return box
