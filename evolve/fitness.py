"""Fitness functions: what a robot is selected for, read off the results of its trial.

A fitness is a function of a `Trial` that returns one number for each robot, higher is better, and
one line in `FITNESS`; its name there is its name in a run's configuration. A fitness need not
look at the status: whoever was stopped gets no fitness whatever the function says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["FITNESS", "Fitness", "Trial", "body_diameters", "distance", "omegas", "speed"]


@dataclass(frozen=True)
class Trial:
    """What was seen of N robots: they settle first, then they are measured."""

    robots: Sequence[ws.Robot]
    settled: ws.Result
    """At the end of the settling time, where the measurement starts."""
    measured: ws.Result
    """At the end of the measurement."""

    @property
    def displacement(self) -> np.ndarray:
        """Way of the centre of mass during the measurement [m], shape (N, 3)."""
        return self.measured.center_of_mass - self.settled.center_of_mass

    @property
    def duration(self) -> float:
        """Length of the measurement [s]."""
        return self.measured.end_time - self.settled.end_time


Fitness = Callable[[Trial], np.ndarray]


def distance(trial: Trial) -> np.ndarray:
    """Net distance of the centre of mass over the ground, straight from start to end [m]."""
    return np.hypot(trial.displacement[:, 0], trial.displacement[:, 1])


def speed(trial: Trial) -> np.ndarray:
    """Speed over the ground in body diameters per actuation cycle.

    The net horizontal distance of the centre of mass, divided by the largest distance between two
    masses of the body at rest and by the number of cycles 2 pi / omega that it took. A robot that
    does not cycle (omega = 0) has speed 0.
    """
    cycles = np.abs(omegas(trial.robots)) * trial.duration / (2.0 * np.pi)
    lengths = distance(trial) / body_diameters(trial.robots)
    return np.divide(lengths, cycles, out=np.zeros_like(lengths), where=cycles > 0.0)


def omegas(robots: Sequence[ws.Robot]) -> np.ndarray:
    """Angular frequency of every robot's actuation [rad/s], shape (N,)."""
    import warp_springs as ws

    if isinstance(robots, ws.Variants):
        return robots.array("omega")
    return np.array([robot.omega for robot in robots])


def body_diameters(robots: Sequence[ws.Robot]) -> np.ndarray:
    """Largest distance between two masses of every robot as it was built [m], shape (N,)."""
    import warp_springs as ws

    if isinstance(robots, ws.Variants) and "positions" not in robots.stacked:
        return np.full(len(robots), robots.body.diameter)
    return np.array([robot.diameter for robot in robots])


FITNESS: dict[str, Fitness] = {"speed": speed, "distance": distance}
"""Name in the configuration -> function."""

UNITS: dict[str, str] = {"speed": "body diameters per cycle", "distance": "m"}
"""What the figures of each fitness are measured in, for plots and reports."""
