"""What a run hands back: plain NumPy arrays, axis 0 the robot."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.tensions import controlled
from warp_springs.energy import Energy
from warp_springs.scene import Scene

if TYPE_CHECKING:
    from warp_springs.batch import Slots
    from warp_springs.robot import Robot

__all__ = ["Result"]

_ALL = slice(None)


@dataclass(frozen=True)
class Result:
    """The end of a run of N robots, and the frames that were recorded on the way.

    Attributes:
        robots: The N robots as they were given to the simulation.
        scene: Their world.
        dt: Step of the run [s]; with ``dt="auto"`` a robot may take shorter ones.
        precision: ``"float64"``, ``"float32"`` or ``"mixed"``.
        integrator: ``"chin4"``, ``"leapfrog"`` or ``"euler"``.
        device: Where the run took place.
        start_time: Time at the start of this run [s].
        end_time: Time at its end [s].
        steps: Steps of this run.
        status: Why each robot was stopped (0: it was not), values of ``Status``, shape (N,).
        status_time: When [s], NaN for the healthy, shape (N,). Health is looked at every
            64 steps; a stopped robot stays where it was found healthy for the last time. For
            ``Status.ENERGY`` it is the time of that pose itself.
        center_of_mass: Centre of mass at the end [m], shape (N, 3).
        times: Times of the F recorded frames [s], shape (F,); empty if none were.
        recorded: Indices of the recorded robots.
        energy: Energies of all robots at the recorded times, or ``None``.
        spring_evaluations: Spring forces computed for robots that were not stopped.
        wall_time: Seconds that the run took.
    """

    robots: Sequence[Robot]
    scene: Scene
    dt: float
    precision: str
    integrator: str
    device: str
    start_time: float
    end_time: float
    steps: int
    status: np.ndarray
    status_time: np.ndarray
    center_of_mass: np.ndarray
    times: np.ndarray
    recorded: tuple[int, ...]
    energy: Energy | None
    spring_evaluations: int
    wall_time: float
    _slots: Slots = field(repr=False)
    _positions: np.ndarray = field(repr=False)
    _velocities: np.ndarray = field(repr=False)
    _frames: Mapping[int, np.ndarray] = field(repr=False)
    _worn: Mapping[int, np.ndarray] = field(default_factory=dict, repr=False)
    _signals: Mapping[int, np.ndarray] = field(default_factory=dict, repr=False)
    _flowed: Mapping[int, np.ndarray] = field(default_factory=dict, repr=False)
    _heard: Mapping[int, np.ndarray] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """Number of robots N."""
        return len(self.robots)

    def positions(self, robot: int) -> np.ndarray:
        """Positions of a robot's masses at the end [m], shape (M, 3), float64."""
        return self._slots.unpack(self._positions, self._index(robot))

    def velocities(self, robot: int) -> np.ndarray:
        """Velocities of a robot's masses at the end [m/s], shape (M, 3), float64."""
        return self._slots.unpack(self._velocities, self._index(robot))

    def frames(self, robot: int) -> np.ndarray:
        """Recorded positions of a robot [m], shape (F, M, 3), float64.

        Raises:
            ValueError: The robot was not recorded in this run.
        """
        robot = self._index(robot)
        if robot not in self._frames:
            known = f"recorded: {list(self.recorded[:8])}" if self.recorded else "none was"
            raise ValueError(f"frames: robot {robot} was not recorded in this run ({known})")
        return self._frames[robot]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything into one ``.npz`` file and return its path.

        Robots, scene, frames, the states at the end, energies, statuses, all to the last bit. The
        layout is documented and versioned in ``warp_springs.io.results``. The file appears whole
        or not at all.

        Raises:
            ValueError: The name does not end in ``.npz``.
            TypeError: The scene or a robot holds what no file can keep, a function for example.
            OSError: The file cannot be written.
        """
        from warp_springs.io.results import save_result

        return save_result(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Read a file that `save` wrote; frames stay on the disk until they are asked for.

        Raises:
            ValueError: It is no such file, it is damaged, or a newer version wrote it.
            OSError: It cannot be read.
        """
        from warp_springs.io.results import load_result

        return load_result(path)

    def broken(self, robot: int) -> np.ndarray:
        """When each spring of a robot broke [s], shape (S,); NaN for those that hold."""
        return self._wear(robot)[0]

    def yielded(self, robot: int) -> np.ndarray:
        """How much longer each spring's rest length became by yielding [m], shape (S,)."""
        return self._wear(robot)[1]

    def signals(self, robot: int) -> np.ndarray:
        """What muscles do of the outputs of a robot's controllers at the end, shape (outputs,).

        The outputs themselves, or behind them by the controller's ``response``. Those of all its
        controllers, one after the other; from -1 to 1, or the growth so far; empty without any.
        """
        return self._signals.get(self._index(robot), np.zeros(0))

    def signal_frames(self, robot: int) -> np.ndarray:
        """The same in every frame of a recorded robot, shape (F, outputs)."""
        return self._heard.get(self._index(robot), np.zeros((len(self.frames(robot)), 0)))

    def clock(self, robot: int) -> np.ndarray:
        """Time that each frame of a robot shows [s], (F,): it stands still once it is stopped."""
        return np.fmin(self.times, self.status_time[self._index(robot)])

    def end_clock(self, robot: int) -> float:
        """The same at the end of the run [s]."""
        return float(np.fmin(self.end_time, self.status_time[self._index(robot)]))

    def rest_lengths(self, robot: int) -> np.ndarray:
        """Rest lengths of a robot's springs at the end [m], shape (S,).

        As `Robot.rest_length_at`, with what its controllers ask for and how far springs yielded.
        """
        index, time = self._index(robot), self.end_clock(robot)
        return _sum(self.robots[index].rest_length_at(time), self._end_change(index))

    def rest_length_frames(self, robot: int, frames: ArrayLike | slice = _ALL) -> np.ndarray:
        """The same in frames of a recorded robot, shape (F, S); arguments as `tension_frames`."""
        told = self.robots[self._index(robot)].rest_length_at(self.clock(robot)[frames])
        return _sum(told, self.rest_length_change(robot, frames))

    def tension(self, robot: int) -> np.ndarray:
        """Force in each spring of a robot at the end [N], positive where stretched, shape (S,).

        As `Robot.tension`, with its `rest_lengths`; zero in springs that are broken.
        """
        index, time = self._index(robot), self.end_clock(robot)
        force = self.robots[index].tension(self.positions(index), time, self._end_change(index))
        return np.where(self.broken(index) <= time, 0.0, force)

    def tension_frames(self, robot: int, frames: ArrayLike | slice = _ALL) -> np.ndarray:
        """The same in frames of a recorded robot, shape (F, S).

        Args:
            robot: Its index.
            frames: Indices of the frames, shape (F,), or a slice; all by default.
        """
        index, time = self._index(robot), self.clock(robot)[frames]
        positions = np.asarray(self.frames(index)[frames], np.float64)
        change = self.rest_length_change(index, frames)
        force = self.robots[index].tension(positions, time, change)
        broken = self.broken(index)
        return np.where(broken <= time[:, None], 0.0, force) if np.isfinite(broken).any() else force

    def rest_length_change(
        self, robot: int, frames: ArrayLike | slice = _ALL, *, yielded: bool = True
    ) -> np.ndarray | None:
        """By how much rest lengths differ from what `Robot.rest_length_at` says [m], (F, S).

        What controllers ask for in frames of a recorded robot and, unless it is not wanted, how far
        springs yielded; ``None`` where there is neither.
        """
        index = self._index(robot)
        heard = self.signal_frames(index)[frames]
        flowed = self._flowed.get(index) if yielded else None
        return self._change(index, heard, None if flowed is None else flowed[frames])

    def _end_change(self, robot: int) -> np.ndarray | None:
        flowed = self.yielded(robot) if robot in self._worn else None
        return self._change(robot, self.signals(robot), flowed)

    def _change(
        self, robot: int, signals: np.ndarray, flowed: np.ndarray | None
    ) -> np.ndarray | None:
        if not signals.shape[-1]:
            return flowed
        return _sum(controlled(self.robots[robot], signals), flowed)

    def _wear(self, robot: int) -> np.ndarray:
        robot = self._index(robot)
        if robot in self._worn:
            return self._worn[robot]
        springs = self.robots[robot].n_springs
        return np.stack([np.full(springs, np.nan), np.zeros(springs)])

    def _index(self, robot: int) -> int:
        count = len(self.robots)
        if not -count <= robot < count:
            raise IndexError(f"robot: got {robot}, expected an index below {count}")
        return int(robot) % count


def _sum(values: np.ndarray, more: np.ndarray | None) -> np.ndarray:
    return values if more is None else values + more
