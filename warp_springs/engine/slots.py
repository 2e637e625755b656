"""Where the robots of a batch are in its flat buffers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warp_springs.engine.curve import ranges

__all__ = ["Slots"]


@dataclass(frozen=True)
class Slots:
    """Where each of N robots lives in the flat buffers; arrays of shape (N,), but `rows`.

    Attributes:
        bundle: Its bundle.
        lane: Its lane in the bundle.
        width: Lanes of the bundle.
        state: Where the bundle starts in a buffer of positions.
        first_lane: Where the bundle starts in a buffer with one value a lane.
        masses: Number of masses M.
        springs: Number of springs S.
        first: Where its masses begin in `rows`.
        rows: Place of each mass of each robot among those of its bundle, end to end.
    """

    bundle: np.ndarray
    lane: np.ndarray
    width: np.ndarray
    state: np.ndarray
    first_lane: np.ndarray
    masses: np.ndarray
    springs: np.ndarray
    first: np.ndarray
    rows: np.ndarray

    def copy(self) -> Slots:
        """A copy that stays as it is when robots move."""
        moving = {name: getattr(self, name).copy() for name in ("bundle", "lane", "state")}
        return replace(self, **moving, first_lane=self.first_lane.copy())

    def unpack(self, buffer: np.ndarray, robot: int) -> np.ndarray:
        """Block (M, 3) of one robot in a buffer of positions or velocities, float64."""
        return buffer[self.state_indices(np.array([robot]))].reshape(-1, 3).astype(np.float64)

    def state_indices(self, robots: np.ndarray) -> np.ndarray:
        """Where the positions of some robots are in their buffer, robot by robot, flat."""
        masses = self.masses[robots]
        row = self.rows[ranges(self.first[robots], masses)]
        start = np.repeat(self.state[robots] + self.lane[robots], masses)
        width = np.repeat(self.width[robots], masses)
        components = 3 * row[:, None] + np.arange(3)
        return (start[:, None] + components * width[:, None]).ravel()

    def lane_indices(self, robots: np.ndarray | slice, columns: int) -> np.ndarray:
        """Where values of some robots are, (n, columns), in a buffer with so many a lane."""
        start = columns * self.first_lane[robots] + self.lane[robots]
        return start[:, None] + np.arange(columns) * self.width[robots][:, None]
