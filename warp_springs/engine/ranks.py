"""Robots that go on close their ranks: lanes of those that were stopped are filled from elsewhere.

A bundle whose robots are all stopped costs nothing. So where the robots that go on fit fewer
bundles of their topology, they move there, between two launches; the stopped take the places they
leave. A robot's bits do not depend on its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from warp_springs.engine.curve import ranges
from warp_springs.engine.slots import Slots
from warp_springs.kernels.buffers import ACCOUNTS, BUNDLE, ENERGIES
from warp_springs.kernels.features import Features
from warp_springs.kernels.traits import PLAIN

__all__ = ["Ranks"]

#: Values of each lane, and how many.
OF_LANES = {
    **dict.fromkeys(("omegas", "reaches2", "quanta", "states", "state_times"), 1),
    **dict.fromkeys(("seen_states", "seen_state_times"), 1),
    **{"oscillators": 4, "origins": 3, "seen_centers": 3},
    **{"seen_energies": ENERGIES, "ledgers": 2 * len(ACCOUNTS)},
}
#: Values of each mass and lane: three of each mass where a bundle's state is.
OF_STATES = [
    f"{prefix}{name}"
    for prefix in ("", "good_", "low_", "good_low_")
    for name in ("positions", "velocities")
] + ["seen_positions", "seen_velocities"]
#: Columns of the table of bundles in which those that may exchange robots are alike.
ALIKE = ("row", "partner", "pair", "masses", "springs", "substeps", "level")


class Ranks:
    """The bundles of one slice, and who is where.

    Args:
        features: Of the kernel that steps them.
        bundles: Their rows of the table of bundles.
        first: The number of the first.
        buffers: All buffers of the kernels, by name.
    """

    def __init__(
        self,
        features: Features,
        bundles: np.ndarray,
        first: int,
        buffers: Mapping[str, np.ndarray],
    ) -> None:
        self._table = dict(zip(BUNDLE, bundles.T, strict=True))
        self._first, self._buffers, self._width = first, buffers, features.width
        self._columns = features.traits.columns(features.actuated)
        self._movable = features.width > 1 and features.traits == PLAIN and len(bundles) > 1
        self._seen_stopped = 0

    def close(self, slots: Slots) -> bool:
        """Move robots where that saves bundles, and note their places; whether any moved."""
        if not self._movable:
            return False
        lanes = self._table["lane"][:, None] + np.arange(self._width)
        stopped = self._buffers["states"][lanes] != 0
        count = int(stopped.sum())
        if count == self._seen_stopped:
            return False
        self._seen_stopped = count
        owner = self._owners(slots)
        moves = list(self._moves(~stopped & (owner >= 0)))
        if not moves:
            return False
        here, there = np.concatenate(moves, axis=2)
        self._exchange(here, there)
        for (bundle, lane), robots in ((there, owner[tuple(here)]), (here, owner[tuple(there)])):
            somebody = robots >= 0
            robots, bundle, lane = robots[somebody], bundle[somebody], lane[somebody]
            slots.bundle[robots], slots.lane[robots] = self._first + bundle, lane
            slots.state[robots] = self._table["state"][bundle]
            slots.first_lane[robots] = self._table["lane"][bundle]
        return True

    def _owners(self, slots: Slots) -> np.ndarray:
        """The robot in each lane of each bundle, -1 for nobody."""
        owner = np.full((len(self._table["lane"]), self._width), -1)
        bundle = slots.bundle - self._first
        robots = np.flatnonzero((bundle >= 0) & (bundle < len(owner)))
        owner[bundle[robots], slots.lane[robots]] = robots
        return owner

    def _moves(self, alive: np.ndarray) -> Iterator[np.ndarray]:
        """From where to where robots move: bundles and lanes of both, shape (2, 2, n)."""
        counts = alive.sum(axis=1)
        key = np.stack([self._table[name] for name in ALIKE], axis=1)
        _, family = np.unique(key, axis=0, return_inverse=True)
        for index in range(family.max() + 1):
            bundles = np.flatnonzero(family.ravel() == index)
            needed = -(-int(counts[bundles].sum()) // self._width)
            if needed >= np.count_nonzero(counts[bundles]):
                continue
            fullest = bundles[np.argsort(-counts[bundles], kind="stable")]
            stay, leave = fullest[:needed], fullest[needed:]
            source, lane = np.nonzero(alive[leave])
            hole, free = np.nonzero(~alive[stay])
            n = len(source)
            yield np.array([[leave[source], lane], [stay[hole[:n]], free[:n]]])

    def _exchange(self, here: np.ndarray, there: np.ndarray) -> None:
        """Exchange all that two lanes of two bundles hold, pair by pair."""
        table = self._table
        one, masses, springs = 0 * table["lane"] + 1, table["masses"], table["springs"]
        blocks = [(name, table["lane"] * n, n * one) for name, n in OF_LANES.items()]
        blocks += [(name, table["state"], 3 * masses) for name in OF_STATES]
        blocks.append(("inverse_masses", table["mass"], masses))
        blocks.append(("coefficients", table["spring"], self._columns * springs))
        for name, start, size in blocks:
            values = self._buffers[name]
            if not values.size:
                continue
            rows = ranges(0 * here[0], size[here[0]])  # of one pair after the other
            a, b = (
                np.repeat(start[bundle] + lane, size[bundle]) + rows * self._width
                for bundle, lane in (here, there)
            )
            values[a], values[b] = values[b], values[a]
