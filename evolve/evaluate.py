"""Evaluation: a whole generation in one simulation, and the second look at champions."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import RunConfig
from evolve.fitness import FITNESS, Trial
from evolve.scores import Scores
from evolve.second_look import SecondLook, perturbed, quantile, share
from evolve.streams import Streams

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Evaluator"]


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
        self.streams = Streams(config.seed)
        self.settle = config.task.settle * config.encoding.period
        """Settling time [s]."""
        self.measure = config.task.measure * config.encoding.period
        """Time of the measurement [s]."""

    def __call__(self, robots: Sequence[ws.Robot]) -> Scores:
        """Simulate the robots, all at once, and score them."""
        started = time.perf_counter()
        simulation = self._simulate(robots)
        trial = self._trial(simulation)
        status = np.asarray(trial.measured.status, dtype=np.int64)
        way, height = trial.displacement, trial.measured.center_of_mass[:, 2]
        descriptors = zip(self.descriptors, (way[:, 0], way[:, 1], height), strict=True)
        return Scores(
            fitness=FITNESS[self.task.fitness](trial),
            status=status,
            descriptors={k: np.where(status == 0, v, np.nan) for k, v in descriptors},
            spring_evaluations=_costs(trial, simulation.robot_dt),
            wall_time=time.perf_counter() - started,
        )

    def prepare(self, robots: Sequence[ws.Robot]) -> None:
        """Load the kernels for such robots: a new machine compiles them first."""
        self._simulate(robots)

    def second_look(self, robots: Sequence[ws.Robot], fitness: np.ndarray) -> SecondLook:
        """Repeat the trial at half the time step in float64, and from perturbed starts.

        Each robot takes half its own step; robots of the same step run in one simulation. The
        perturbed trials of all robots run in another, as the first trial ran but for the starts.

        Args:
            robots: n robots.
            fitness: Their fitness at the first look, shape (n,).
        """
        settings = self.task.second_look
        dt = 0.5 * self._simulate(robots).robot_dt
        halved = np.full(len(robots), np.nan)
        for step in np.unique(dt):
            alike = np.flatnonzero(dt == step)
            again = self._simulate([robots[i] for i in alike], float(step), "float64")
            halved[alike] = self._fitness(self._trial(again))
        starts = [s for robot in robots for s in perturbed(robot, settings, self.streams)]
        # The fitness measures a robot as it was built, not as it was bent for the start.
        built = [robot for robot in robots for _ in range(settings.trials)]
        trials = self._fitness(self._trial(self._simulate(starts), built))
        usual = quantile(trials.reshape(len(robots), settings.trials), settings.quantile)
        kept = share(halved, fitness), share(usual, fitness)
        survives = (kept[0] >= settings.threshold) & (kept[1] >= settings.threshold)
        return SecondLook(dt, halved, kept[0], usual, kept[1], survives)

    def film(self, robots: Sequence[ws.Robot], fps: float = 30.0) -> ws.Result:
        """Simulate a whole trial and record every frame of every robot."""
        return self._simulate(robots).run(self.settle + self.measure, fps=fps)

    def _fitness(self, trial: Trial) -> np.ndarray:
        """Fitness of every robot, shape (N,); NaN for those who were stopped."""
        stopped = np.asarray(trial.measured.status) != 0
        return np.where(stopped, np.nan, FITNESS[self.task.fitness](trial))

    def _trial(self, simulation: ws.Simulation, robots: Sequence[ws.Robot] | None = None) -> Trial:
        """Run a trial; `robots` is whom to measure if not who was simulated."""
        settled = simulation.run(self.settle)
        measured = simulation.run(self.measure)
        return Trial(simulation.robots if robots is None else robots, settled, measured)

    def _simulate(
        self,
        robots: Sequence[ws.Robot],
        dt: float | None = None,
        precision: str | None = None,
    ) -> ws.Simulation:
        """Pack robots, with the step and the precision of the configuration unless told."""
        import warp_springs as ws

        settings = self.simulation
        return ws.Simulation(
            robots,
            self.scene,
            dt=settings.dt if dt is None else dt,
            precision=settings.precision if precision is None else precision,
            integrator=settings.integrator,
            device=settings.device,
            threads=settings.threads,
        )


def _costs(trial: Trial, dt: np.ndarray) -> np.ndarray:
    """Spring evaluations of every robot, shape (N,): the total, shared out by springs x steps."""
    import warp_springs as ws

    robots, end = trial.robots, trial.measured.end_time
    fixed = isinstance(robots, ws.Variants)
    springs = robots.body.n_springs if fixed else [robot.n_springs for robot in robots]
    times = np.where(np.asarray(trial.measured.status) == 0, end, trial.measured.status_time)
    weights = np.asarray(springs) * times / dt
    total = trial.settled.spring_evaluations + trial.measured.spring_evaluations
    return np.rint(total * (weights / max(weights.sum(), 1e-300))).astype(np.int64)
