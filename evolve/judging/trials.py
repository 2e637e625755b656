"""Trials: how robots are simulated for their scores, once or from several perturbed starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from evolve.streams import Role, Streams

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.config import PerturbationConfig

__all__ = ["AGGREGATES", "aggregate", "perturbed", "scattered"]

AGGREGATES: dict[str, Callable[..., np.ndarray]] = {
    "mean": np.mean,
    "median": np.median,
    "worst": np.min,
}
"""How the fitness of several trials becomes one."""


def aggregate(fitness: np.ndarray, how: str) -> np.ndarray:
    """One fitness from those of several trials, (trials, n) -> (n,); NaN where any trial has none.

    A robot that breaks in one trial of many has not mastered its task.
    """
    return AGGREGATES[how](fitness, axis=0)


def perturbed(
    robot: ws.Robot, settings: PerturbationConfig, streams: Streams, role: Role, trials: int
) -> Iterator[ws.Robot]:
    """Yield the robot at the start of each of its perturbed trials.

    It is turned about the vertical through its centre of mass; every mass is displaced and
    pushed; then it is lifted so far that its lowest mass is no deeper than before, or somewhat
    higher, for a mass that starts within the ground would be shot out of it. Rest lengths stay.
    Trial t draws from a stream of its own, the same for every robot: the outcome depends neither
    on which robots are looked at nor on how many.
    """
    lengths = robot.lengths
    shortest = lengths[lengths > 0.0].min(initial=robot.diameter)
    floor = robot.bounds[0, 2]
    for trial in range(trials):
        rng = streams(0, role, trial)
        angle = rng.uniform(-settings.rotation, settings.rotation)
        rise = rng.uniform(0.0, settings.height * shortest)
        displacements = settings.position * shortest * rng.standard_normal((robot.n_masses, 3))
        pushes = settings.velocity * rng.standard_normal((robot.n_masses, 3))
        turned = robot.rotated((0.0, 0.0, 1.0), angle)
        positions = turned.positions + displacements
        positions[:, 2] += floor + rise - positions[:, 2].min()
        yield turned.replace(positions=positions, velocities=turned.velocities + pushes)


def scattered(
    robots: Sequence[ws.Robot], settings: PerturbationConfig, streams: Streams, trials: int
) -> list[Sequence[ws.Robot]]:
    """The robots at the start of each of their trials: a population for every trial.

    Variants of one body that all start alike stay variants, so that a whole population costs no
    more than one robot.
    """
    import warp_springs as ws

    fixed = isinstance(robots, ws.Variants) and not {"positions", "velocities"} & set(
        robots.stacked
    )
    if not fixed:
        starts = [list(perturbed(r, settings, streams, Role.TRIAL, trials)) for r in robots]
        return [list(column) for column in zip(*starts, strict=True)]
    return [
        start.variants(**robots.stacked)
        for start in perturbed(robots.body, settings, streams, Role.TRIAL, trials)
    ]
