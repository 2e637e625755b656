"""Bodies of voxels cut from one lattice."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from evolve.bodies.plan import connected_parts

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Lattice"]

AT_ONCE = 256
"""Bodies whose springs are worked out together."""


class Lattice:
    """All voxels that bodies may have, and the springs that each of them brings.

    Voxels are numbered x-major, z fastest.

    Args:
        cells: Voxels along x, y, z.
        edge: Length of a voxel's edge [m].
    """

    def __init__(self, cells: tuple[int, int, int], edge: float) -> None:
        self.cells, self.edge = cells, edge
        self.size = int(np.prod(cells))
        self.centres = (np.indices(cells).reshape(3, -1).T + 0.5) * edge
        """Middles of the voxels [m], shape (V, 3)."""
        self._sides = _sides(cells)

    def connected(self, masks: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        """The largest part of each mask whose voxels share sides, shape (n, V), bool.

        Args:
            masks: Which voxels exist, shape (n, V), bool.
            otherwise: The one voxel of a body without any, shape (n,).
        """
        n, size = masks.shape
        masks = masks.copy()
        empty = np.flatnonzero(~masks.any(axis=1))
        masks[empty, np.asarray(otherwise)[empty]] = True
        offsets = (np.arange(n) * size)[:, None]
        a, b = self._sides.T
        joined = masks[:, a] & masks[:, b]
        pairs = np.stack([(offsets + a)[joined], (offsets + b)[joined]], axis=1)
        label = connected_parts(n * size, pairs)
        count = np.bincount(label[masks.ravel()], minlength=n * size)
        largest = count.reshape(n, size).argmax(axis=1)[:, None] + offsets
        return masks & (label.reshape(n, size) == largest)

    def beside(self, masks: np.ndarray) -> np.ndarray:
        """Absent voxels that share a side with one that exists, shape (n, V), bool."""
        a, b = self._sides.T
        found = np.zeros(masks.shape, bool)
        for here, there in ((a, b), (b, a)):
            row, pair = np.nonzero(masks[:, here])
            found[row, there[pair]] = True
        return found & ~masks

    def robots(
        self,
        masks: np.ndarray,
        stiffness: np.ndarray,
        swing: np.ndarray,
        weight: Callable[[int], float],
        period: float,
    ) -> list[ws.Robot]:
        """A robot for each of n masks; a spring does what the voxels that share it do on average.

        Args:
            masks: Which voxels exist, each robot in one part, shape (n, V), bool.
            stiffness: Of the springs of a voxel [N/m], shape (n, V).
            swing: Amplitude in lengths of the spring and phase as b exp(ic), shape (n, V), complex.
            weight: Mass of a robot of so many points [kg].
            period: Length of an actuation cycle [s].
        """
        robots = []
        for first in range(0, len(masks), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            robots += self._cut(masks[some], stiffness[some], swing[some], weight, period)
        return robots

    def _cut(self, masks, stiffness, swing, weight, period) -> list[ws.Robot]:
        """As `robots`, of so few that their springs fit the cache."""
        import warp_springs as ws

        bodies = ws.shapes.Cut(masks.reshape(-1, *self.cells), self.edge)
        # What a spring's missing voxels add is nothing.
        nothing = ((0, 0), (0, 1))
        there = np.pad(masks, nothing)
        tables = [
            np.pad(np.where(masks, values, 0.0), nothing).ravel()
            for values in (np.log(stiffness), swing.real, swing.imag)
        ]
        places = bodies.body * there.shape[1] + bodies.sharing
        count = _sum(there.ravel().astype(np.float64), places)
        log = _sum(tables[0], places) / count
        mean = np.empty(len(log), np.complex128)
        mean.real, mean.imag = (
            _sum(table, places[:2]) + _sum(table, places[2:]) for table in tables[1:]
        )
        mean /= count
        amplitude = np.abs(mean)
        weights = [weight(points) / points for points in bodies.n_masses.tolist()]
        return bodies.robots(
            weights,
            np.exp(log),
            2.0 * np.pi / period,
            amplitude=bodies.lengths * amplitude,
            phase=np.where(amplitude > 0.0, np.angle(mean), 0.0),
        )


def _sum(table: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Sums of the values at some places, (4, S) -> (S,), in their order."""
    total = table[places[0]]
    for more in places[1:]:
        total += table[more]
    return total


def _sides(cells: tuple[int, int, int]) -> np.ndarray:
    """Pairs of voxels that share a side, shape (K, 2)."""
    number = np.arange(int(np.prod(cells))).reshape(cells)
    pairs = []
    for axis in range(3):
        along = np.moveaxis(number, axis, 0)
        pairs.append(np.stack([along[:-1].ravel(), along[1:].ravel()]))
    return np.concatenate(pairs, axis=1).T
