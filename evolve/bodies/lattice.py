"""Bodies of voxels cut from one lattice."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from evolve.bodies.plan import connected_parts

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Lattice"]


class Lattice:
    """All voxels that bodies may have, and the springs that each of them brings.

    Voxels are numbered x-major, z fastest.

    Args:
        cells: Voxels along x, y, z.
        edge: Length of a voxel's edge [m].
    """

    def __init__(self, cells: tuple[int, int, int], edge: float) -> None:
        import warp_springs as ws

        self.cells, self.edge = cells, edge
        self.size = int(np.prod(cells))
        full = ws.shapes.lattice(*cells, edge=edge)
        self.centres = (np.indices(cells).reshape(3, -1).T + 0.5) * edge
        """Middles of the voxels [m], shape (V, 3)."""
        grid = np.rint(full.positions / edge).astype(np.int64)
        self._owners = _owners(grid[full.springs], cells)
        self._sides = _sides(cells)
        self._bodies = lru_cache(maxsize=4096)(self._body)

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
        omega = 2.0 * np.pi / period
        nothing = np.zeros((len(masks), 1))  # what a spring's missing voxels add
        log = np.concatenate([np.log(stiffness), nothing], axis=1)
        swing = np.concatenate([swing, nothing], axis=1)
        robots = []
        for row, mask in enumerate(masks):
            body, owners = self._bodies(mask.tobytes())
            count = (owners < self.size).sum(axis=0)
            mean = swing[row][owners].sum(axis=0) / count
            amplitude = np.abs(mean)
            robots.append(
                body.replace(
                    masses=np.full(body.n_masses, weight(body.n_masses) / body.n_masses),
                    stiffness=np.exp(log[row][owners].sum(axis=0) / count),
                    amplitude=body.rest_length * amplitude,
                    phase=np.where(amplitude > 0.0, np.angle(mean), 0.0),
                    omega=omega,
                )
            )
        return robots

    def _body(self, mask: bytes) -> tuple[ws.Robot, np.ndarray]:
        """The body of a mask, and the voxels of each of its springs, (4, S), filled up with V."""
        import warp_springs as ws

        present = np.frombuffer(mask, bool)
        body = ws.shapes.voxels(present.reshape(self.cells), self.edge)
        # Springs keep the order of the full lattice, so those of the body are found by a mask.
        shared = np.append(present, False)[self._owners]
        mine = np.where(shared, self._owners, self.size)[:, shared.any(axis=0)]
        return body, mine


def _owners(ends: np.ndarray, cells: tuple[int, int, int]) -> np.ndarray:
    """The voxels that contain both ends of springs, (S, 2, 3) in edges: (4, S), filled with V."""
    low, high = ends.max(axis=1) - 1, ends.min(axis=1)
    found = np.full((4, len(ends)), int(np.prod(cells)))
    filled = np.zeros(len(ends), np.int64)
    for step in np.ndindex(2, 2, 2):
        cell = low + step
        inside = ((cell >= 0) & (cell < cells) & (cell <= high)).all(axis=1)
        rows = np.flatnonzero(inside)
        found[filled[rows], rows] = np.ravel_multi_index(cell[rows].T, cells)
        filled[rows] += 1
    return found


def _sides(cells: tuple[int, int, int]) -> np.ndarray:
    """Pairs of voxels that share a side, shape (K, 2)."""
    number = np.arange(int(np.prod(cells))).reshape(cells)
    pairs = []
    for axis in range(3):
        along = np.moveaxis(number, axis, 0)
        pairs.append(np.stack([along[:-1].ravel(), along[1:].ravel()]))
    return np.concatenate(pairs, axis=1).T
