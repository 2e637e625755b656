"""What is recorded of robots in every frame, beside each other in one table."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np

__all__ = ["Reel"]


class Reel:
    """Values of some robots in every frame, taken from a flat buffer.

    Args:
        frames: How many frames there will be.
        robots: Whose they are, shape (n,).
        sizes: How many each has, shape (n,).
        places: Where they are in the buffer, one robot after the other.

    Attributes:
        values: What was taken, shape (F, len(places)), float64.
    """

    def __init__(
        self, frames: int, robots: Sequence[int], sizes: Sequence[int], places: np.ndarray
    ) -> None:
        self._robots, self._ends, self._places = robots, np.cumsum(sizes), places
        self.values = np.empty((frames, len(places)))

    @classmethod
    def of(cls, frames: int, places: Mapping[int, np.ndarray]) -> Reel:
        """A reel of robots whose values are at these places."""
        found = list(places.values())
        flat = np.concatenate(found) if found else np.zeros(0, np.int64)
        return cls(frames, list(places), [len(some) for some in found], flat)

    def __len__(self) -> int:
        """Values of all robots in a frame."""
        return len(self._places)

    def move(self, places: np.ndarray) -> None:
        """The values are at other places from now on."""
        self._places = places

    def take(self, frame: int, buffer: np.ndarray) -> None:
        """Keep what the buffer holds now."""
        if len(self):
            self.values[frame] = buffer[self._places]

    def cut_to(self, frames: int) -> Reel:
        """The first frames alone."""
        short = copy.copy(self)
        short.values = self.values[:frames]
        return short

    def by_robot(self) -> dict[int, np.ndarray]:
        """The values of each robot, shape (F, n)."""
        parts = np.split(self.values, self._ends[:-1], axis=1) if len(self._robots) else []
        return {
            int(robot): np.ascontiguousarray(part)
            for robot, part in zip(self._robots, parts, strict=True)
        }
