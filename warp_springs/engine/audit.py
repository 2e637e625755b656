"""Robots that gain energy from nowhere are stopped while they run, as their ledger tells.

A mass that is too fast or a spring that is too long shows in one pose; energy from nowhere shows
only in the books. To them a state is good if what came in accounts for what is there, within
``Limits.gain``: so at every frame and every ``AUDIT_EVERY`` steps the books are looked through, and
what is seen of each robot is kept. Who is found out is stopped, and from then on seen as it was at
the look before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_springs.energy import Balance
from warp_springs.stability import Status

if TYPE_CHECKING:
    from warp_springs.batch import Batch
    from warp_springs.engine.crowd import Crowd
    from warp_springs.engine.slices import Slice

__all__ = ["AUDIT_EVERY", "Audit", "flow_places"]

#: Steps of the run between two looks at the books, counted from the start of the simulation.
AUDIT_EVERY = 256


@dataclass(frozen=True)
class Stand:
    """What is seen of some robots at one look.

    Attributes:
        robots: Their numbers, shape (n,).
        times: When [s], shape (n,).
        values: Name of a buffer -> what it held of them, robot by robot.
        sizes: Name of a buffer -> how many values each has there, shape (n,).
        energies: Energies and accounts [J], (n, ENERGIES).
    """

    robots: np.ndarray
    times: np.ndarray
    values: Mapping[str, np.ndarray]
    sizes: Mapping[str, np.ndarray]
    energies: np.ndarray

    def of(self, which: np.ndarray) -> Stand:
        """The part of some of them, ``which`` of shape (n,) bool."""
        return Stand(
            self.robots[which],
            self.times[which],
            {name: v[np.repeat(which, self.sizes[name])] for name, v in self.values.items()},
            {name: sizes[which] for name, sizes in self.sizes.items()},
            self.energies[which],
        )

    def and_of(self, more: Stand) -> Stand:
        """Both, one after the other."""

        def both(name: str) -> dict[str, np.ndarray]:
            mine, others = getattr(self, name), getattr(more, name)
            return {key: np.concatenate([mine[key], others[key]]) for key in mine}

        lists = (
            np.concatenate([getattr(self, name), getattr(more, name)])
            for name in ("robots", "times", "energies")
        )
        robots, times, energies = lists
        return Stand(robots, times, both("values"), both("sizes"), energies)


class Audit:
    """The books of the robots of one slice or crowd, and who was found out.

    Args:
        piece: The slice or crowd.
        batch: Whose robots they are.
        gain: The limit, see ``Limits.gain``.
    """

    def __init__(self, piece: Slice | Crowd, batch: Batch, gain: float) -> None:
        self._piece, self._batch, self._limit = piece, batch, gain
        self._balance: Balance | None = None
        self._good: Stand | None = None
        self._stopped: Stand | None = None

    def open(self) -> None:
        """Begin new books with the next look."""
        self._balance = self._good = None

    def look(self, members: np.ndarray, time: float, energies: np.ndarray) -> np.ndarray:
        """Look through the books of all members of the slice, right after they were observed.

        Args:
            members: The robots, shape (n,).
            time: When [s].
            energies: What they have now, (n, ENERGIES).

        Returns:
            The same, but of those that are stopped what they had.
        """
        if self._balance is None:
            self._balance = Balance(energies.T)
        with np.errstate(over="ignore", invalid="ignore"):
            gain, residual = self._balance.look(energies.T)
            found = (gain > self._limit) & (residual > self._batch.rounding[members])
        lanes = self._batch.slots.lane_indices(members, 1)[:, 0]
        found &= self._piece.buffers["seen_states"][lanes] == Status.OK
        if found.any():
            self._stop(self._good.of(found))
        self.show()
        shown = self._of_stopped(members, energies)
        self._good = self._stand(members, time, shown)
        return shown

    def show(self) -> None:
        """Put what is shown of those that are stopped into the place of what was observed."""
        if self._stopped is None:
            return
        stand, buffers = self._stopped, self._piece.buffers
        for name, (places, _) in self._places(stand.robots).items():
            buffers[name][places] = stand.values[name]
        lanes = self._batch.slots.lane_indices(stand.robots, 1)[:, 0]
        buffers["seen_states"][lanes] = Status.ENERGY
        buffers["seen_state_times"][lanes] = stand.times

    def _stop(self, stand: Stand) -> None:
        self._piece.stop(self._batch.slots, stand.robots, Status.ENERGY, stand.times)
        self._stopped = stand if self._stopped is None else self._stopped.and_of(stand)

    def _of_stopped(self, members: np.ndarray, energies: np.ndarray) -> np.ndarray:
        if self._stopped is None:
            return energies
        shown = energies.copy()
        shown[np.searchsorted(members, self._stopped.robots)] = self._stopped.energies
        return shown

    def _stand(self, members: np.ndarray, time: float, energies: np.ndarray) -> Stand:
        places, buffers = self._places(members), self._piece.buffers
        values = {name: buffers[name][where] for name, (where, _) in places.items()}
        sizes = {name: size for name, (_, size) in places.items()}
        return Stand(members, np.full(len(members), time), values, sizes, energies)

    def _places(self, robots: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Where the buffers hold what is seen of some robots, and how many values of each."""
        slots, wearing = self._batch.slots, self._batch.wearing
        state, three = slots.state_indices(robots), 3 * slots.masses[robots]
        found = dict.fromkeys(("seen_positions", "seen_velocities"), (state, three))
        centers = slots.lane_indices(robots, 3).ravel()
        found["seen_centers"] = centers, np.full(len(robots), 3)
        if wearing:
            nothing = np.zeros(0, np.int64), 0
            worn = [wearing.get(robot, nothing) for robot in robots.tolist()]
            sizes = np.array([len(place) for place, _ in worn])
            found["broken_at"] = np.concatenate([place for place, _ in worn]), sizes
            found["worn"] = np.concatenate([flow_places(*one) for one in worn]), sizes
        return found


def flow_places(place: np.ndarray, lane: int) -> np.ndarray:
    """Where it is kept how far springs have flowed, from `Batch.wearing`."""
    return 2 * (place - lane) + lane
