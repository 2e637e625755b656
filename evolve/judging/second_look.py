"""The second look: what is left of a fitness when the same robot is simulated again, differently.

A search finds every flaw of its simulator and breeds for it. A champion is therefore believed only
where two figures keep enough of its fitness: the same trial at half the time step in float64,
which an exploit of the integrator does not survive, and the trial from slightly different starts,
which a lucky fall does not survive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

__all__ = ["SecondLook", "quantile", "share"]


@dataclass(frozen=True)
class SecondLook:
    """What is left of the fitness of n robots."""

    dt: np.ndarray
    """Half the step that each robot took at first, or less where that was not stable [s], shape
    (n,)."""
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

    @staticmethod
    def joined(looks: Sequence[SecondLook]) -> SecondLook:
        """Several looks as one, in their order."""
        names = [field.name for field in fields(SecondLook)]
        return SecondLook(*(np.concatenate([getattr(look, n) for look in looks]) for n in names))


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
