"""Points in space: evenly random ones in a box, and all pairs that lie close together."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from warp_springs.geometry import FloatArray

__all__ = ["pairs_within", "scattered_points"]

IndexArray = NDArray[np.intp]

_TRIES = 4
"""Points tried in every gap before the gaps are looked at more finely."""
_DEEPEST = 24
"""Halvings of a gap, after which it is narrower than 1e-7 of the spacing."""
_CHUNK = 2**15
"""Points whose neighbours are looked at together: bounds the memory, fits the cache."""


def scattered_points(
    low: FloatArray, high: FloatArray, spacing: float, rng: np.random.Generator
) -> FloatArray:
    """Random points in a box, none closer than `spacing`, so many that no other one fits.

    Darts are thrown at cells so small that each holds one point at most. Where cells remain that
    no point covers, they are halved and darts are thrown at what is left of them.

    Args:
        low: Lowest corner [m], shape (3,).
        high: Highest corner [m], shape (3,).
        spacing: Least distance [m] of two points.
        rng: Where the randomness comes from.

    Returns:
        The points [m], shape (P, 3), ordered by place (x-major cells of about the spacing).
    """
    board = _Board(low, high, spacing)
    corners, size = board.all_cells(), board.cell
    for _ in range(_DEEPEST):
        for _ in range(_TRIES):
            if len(corners) == 0:
                return board.ordered_points()
            # Rounding must not put a dart above the box.
            darts = np.minimum(corners + size * rng.random(corners.shape), high)
            board.add(darts, rng.random(len(darts)))
            corners = corners[board.is_free(corners + 0.5 * size)]
        size *= 0.5
        halves = np.array(list(itertools.product((0.0, size), repeat=3)))
        corners = (corners[:, None] + halves).reshape(-1, 3)
        corners = corners[(corners < high).all(axis=1)]
        corners = corners[~board.is_covered(corners + 0.5 * size, math.sqrt(0.75) * size)]
    return board.ordered_points()


class _Board:
    """A grid over a box whose cells hold at most one point each, with a rim of empty cells."""

    def __init__(self, low: FloatArray, high: FloatArray, spacing: float) -> None:
        self.low, self.high, self.spacing = low, high, spacing
        self.cell = spacing / math.sqrt(3.0)  # its diagonal is the spacing
        self.shape = np.ceil((high - low) / self.cell).astype(np.intp) + 5  # rims of 2, and 1
        self.strides = np.array([self.shape[1] * self.shape[2], self.shape[2], 1])
        self.points = np.full((int(self.shape.prod()), 3), np.inf)
        # Nearest cells first: they settle most questions. The corners of the cube of 5 x 5 x 5
        # cells are no closer than the spacing.
        reach = sorted(itertools.product(range(-2, 3), repeat=3), key=np.linalg.norm)
        self.around = np.array(reach[:-8]) @ self.strides

    def all_cells(self) -> FloatArray:
        """The lowest corner of every cell within the box, (C, 3)."""
        return self.low + self.cell * np.indices(self.shape - 5).reshape(3, -1).T

    def number(self, places: FloatArray) -> IndexArray:
        """The cell that each place lies in."""
        return ((places - self.low) / self.cell).astype(np.intp) @ self.strides + (
            2 * self.strides.sum()
        )

    def is_free(self, places: FloatArray) -> NDArray[np.bool_]:
        """Whether the cell of each place holds no point."""
        return self.points[self.number(places), 0] == np.inf

    def is_covered(self, places: FloatArray, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether a point lies so near that no ball of radius `margin` sticks out of its reach."""
        limit = (self.spacing - margin) ** 2
        covered = np.zeros(len(places), bool)
        for i in range(0, len(places), _CHUNK):
            part = slice(i, i + _CHUNK)
            place, cell = places[part], self.number(places[part])
            waiting = np.arange(len(place))
            for offset in self.around:
                d = self.points.take(cell[waiting] + offset, axis=0)
                d -= place[waiting]
                near = np.einsum("ij,ij->i", d, d) < limit
                covered[i + waiting[near]] = True
                waiting = waiting[~near]
        return covered

    def add(self, darts: FloatArray, order: FloatArray) -> None:
        """Keep the darts that are far from all points, and of those that crowd the first."""
        good = np.flatnonzero(~self.is_covered(darts))
        good = good[np.argsort(order[good])]
        cell, first = np.unique(self.number(darts[good]), return_index=True)
        darts, order = darts[good[first]], order[good[first]]
        rank = np.full(len(self.points), np.inf)
        rank[cell] = order
        self.points[cell] = darts
        beaten = np.zeros(len(cell), bool)
        for offset in self.around:
            d = self.points[cell + offset] - darts
            near = np.einsum("ij,ij->i", d, d) < self.spacing**2
            beaten |= near & (rank[cell + offset] < order)
        self.points[cell[beaten]] = np.inf

    def ordered_points(self) -> FloatArray:
        """Every point, cell by cell."""
        return self.points[self.points[:, 0] < np.inf]


def pairs_within(points: FloatArray, reach: float) -> IndexArray:
    """All pairs of points no further apart than `reach` [m], (P, 3) -> (K, 2).

    The lower index comes first; pairs are in ascending order.
    """
    cells = np.floor((points - points.min(axis=0)) / reach).astype(np.int64)
    # Empty layers keep the columns of the grid apart.
    shape = cells.max(axis=0) + 3
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    number = cells @ strides
    order = np.argsort(number, kind="stable")
    points, number = points[order], number[order]
    found = []
    # Each pair once: a column of three cells at a time, of half the columns around.
    for dx, dy in ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1)):
        middle = number + dx * strides[0] + dy * strides[1]
        start = np.searchsorted(number, middle - 1, side="left")
        if dx == dy == 0:
            start = np.arange(1, len(points) + 1)
        count = np.maximum(np.searchsorted(number, middle + 1, side="right") - start, 0)
        first = np.repeat(np.arange(len(points)), count)
        rank = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
        second = np.repeat(start, count) + rank
        d = points[first] - points[second]
        near = np.einsum("ij,ij->i", d, d) <= reach * reach
        found.append(np.stack([first[near], second[near]], axis=1))
    pairs = np.sort(order[np.concatenate(found)], axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
