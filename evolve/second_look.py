"""The second look: what is left of a fitness when the same robot is simulated again, differently.

A search finds every flaw of its simulator and breeds for it. A champion is therefore believed only
where two figures keep enough of its fitness: the same trial at half the time step in float64,
which an exploit of the integrator does not survive, and the trial from slightly different starts,
which a lucky fall does not survive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.streams import Role, Streams

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.config import SecondLookConfig

__all__ = ["SecondLook", "perturbed", "quantile", "share"]


@dataclass(frozen=True)
class SecondLook:
    """What is left of the fitness of n robots."""

    dt: np.ndarray
    """Half the step that each robot took at first [s], shape (n,)."""
    halved: np.ndarray
    """Fitness at that step in float64, shape (n,); NaN = none."""
    halved_kept: np.ndarray
    """That fitness divided by the first one, shape (n,)."""
    perturbed: np.ndarray
    """Quantile of the fitness from perturbed starts, shape (n,); NaN = none."""
    perturbed_kept: np.ndarray
    """That fitness divided by the first one, shape (n,)."""
    survives: np.ndarray
    """Whether enough is left of both, shape (n,), bool."""


def perturbed(robot: ws.Robot, settings: SecondLookConfig, streams: Streams) -> Iterator[ws.Robot]:
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
    for trial in range(settings.trials):
        rng = streams(0, Role.SECOND_LOOK, trial)
        angle = rng.uniform(-settings.rotation, settings.rotation)
        rise = rng.uniform(0.0, settings.height * shortest)
        displacements = settings.position * shortest * rng.standard_normal((robot.n_masses, 3))
        pushes = settings.velocity * rng.standard_normal((robot.n_masses, 3))
        turned = robot.rotated((0.0, 0.0, 1.0), angle)
        positions = turned.positions + displacements
        positions[:, 2] += floor + rise - positions[:, 2].min()
        yield turned.replace(positions=positions, velocities=turned.velocities + pushes)


def quantile(fitness: np.ndarray, level: float) -> np.ndarray:
    """The fitness that a share of 1 - level of the trials reaches, shape (n, trials) -> (n,).

    A trial without fitness (NaN) is behind every other. Always the figure of one of the trials.
    """
    ranked = np.where(np.isnan(fitness), -np.inf, fitness)
    found = np.quantile(ranked, level, axis=1, method="lower")
    return np.where(np.isfinite(found), found, np.nan)


def share(again: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Which part of the first fitness is left, shape (n,); NaN without a positive first one."""
    return np.divide(again, first, out=np.full(len(again), np.nan), where=first > 0.0)
