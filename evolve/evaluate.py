"""Evaluation: a whole generation in one simulation, and the second look at champions."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import RunConfig
from evolve.fitness import FITNESS, Trial
from evolve.scores import Scores

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Evaluator", "SecondLook"]


@dataclass(frozen=True)
class SecondLook:
    """What is left of fitness when the time step is halved, in float64."""

    dt: float
    """The halved step [s]."""
    fitness: np.ndarray
    """Shape (n,); NaN = none at this step."""
    kept: np.ndarray
    """This fitness divided by the first one, shape (n,)."""
    survives: np.ndarray
    """Whether enough of it is left, shape (n,), bool."""


class Evaluator:
    """Runs the trial of a configuration: robots settle, then they are measured.

    A robot's scores do not depend on which robots it is evaluated with, nor on the number of
    threads.
    """

    descriptors = ("displacement_x", "displacement_y", "height")
    """Measured beside the fitness: way of the centre of mass in x and y, its height at the end
    [m]; NaN for a robot that was stopped."""

    def __init__(self, config: RunConfig) -> None:
        self.task = config.task
        self.simulation = config.simulation
        self.scene = config.scene.build()
        self.settle = config.task.settle * config.encoding.period
        """Settling time [s]."""
        self.measure = config.task.measure * config.encoding.period
        """Time of the measurement [s]."""

    def __call__(self, robots: Sequence[ws.Robot]) -> Scores:
        """Simulate the robots, all at once, and score them."""
        started = time.perf_counter()
        settings = self.simulation
        trial = self._trial(robots, settings.dt, settings.precision)
        status = np.asarray(trial.measured.status, dtype=np.int64)
        way, height = trial.displacement, trial.measured.center_of_mass[:, 2]
        descriptors = zip(self.descriptors, (way[:, 0], way[:, 1], height), strict=True)
        return Scores(
            fitness=FITNESS[self.task.fitness](trial),
            status=status,
            descriptors={k: np.where(status == 0, v, np.nan) for k, v in descriptors},
            spring_evaluations=_costs(trial),
            wall_time=time.perf_counter() - started,
        )

    def prepare(self, robots: Sequence[ws.Robot]) -> None:
        """Load the kernels for such robots: a new machine compiles them first."""
        self._simulate(robots, self.simulation.dt, self.simulation.precision)

    def second_look(self, robots: Sequence[ws.Robot], fitness: np.ndarray) -> SecondLook:
        """Repeat the trial at half the time step in float64.

        Args:
            robots: n robots.
            fitness: Their fitness at the first look, shape (n,).
        """
        dt = 0.5 * self.simulation.dt
        trial = self._trial(robots, dt, "float64")
        stopped = np.asarray(trial.measured.status) != 0
        again = np.where(stopped, np.nan, FITNESS[self.task.fitness](trial))
        kept = np.divide(again, fitness, out=np.full(len(again), np.nan), where=fitness > 0.0)
        return SecondLook(dt, again, kept, survives=kept >= self.task.second_look)

    def film(self, robots: Sequence[ws.Robot], fps: float = 30.0) -> ws.Result:
        """Simulate a whole trial and record every frame of every robot."""
        settings = self.simulation
        simulation = self._simulate(robots, settings.dt, settings.precision)
        return simulation.run(self.settle + self.measure, fps=fps)

    def _trial(self, robots: Sequence[ws.Robot], dt: float, precision: str) -> Trial:
        simulation = self._simulate(robots, dt, precision)
        settled = simulation.run(self.settle)
        return Trial(robots, settled, simulation.run(self.measure))

    def _simulate(self, robots: Sequence[ws.Robot], dt: float, precision: str) -> ws.Simulation:
        import warp_springs as ws

        settings = self.simulation
        return ws.Simulation(
            robots,
            self.scene,
            dt=dt,
            precision=precision,
            integrator=settings.integrator,
            device=settings.device,
            threads=settings.threads,
        )


def _costs(trial: Trial) -> np.ndarray:
    """Spring evaluations of every robot, shape (N,): the total, shared out by springs x time."""
    import warp_springs as ws

    robots, end = trial.robots, trial.measured.end_time
    fixed = isinstance(robots, ws.Variants)
    springs = robots.body.n_springs if fixed else [robot.n_springs for robot in robots]
    share = np.asarray(springs) * np.where(
        np.asarray(trial.measured.status) == 0, end, trial.measured.status_time
    )
    total = trial.settled.spring_evaluations + trial.measured.spring_evaluations
    return np.rint(total * (share / max(share.sum(), 1e-300))).astype(np.int64)
