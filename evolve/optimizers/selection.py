"""Selection: which of the survivors, sorted from best to worst, become parents."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from evolve.optimizers.base import Individuals, OptimizerSettings

__all__ = ["SelectionSettings", "order", "select"]


class SelectionSettings(OptimizerSettings):
    """How strongly the fit are preferred as parents."""

    selection: Literal["tournament", "rank", "truncation"] = "tournament"
    """By a tournament; by rank (Baker 1985: the chance falls linearly from the best to the worst);
    or by chance among the best (truncation)."""
    tournament: int = Field(4, ge=1)
    """How many individuals compete to become a parent; 1 = no preference. For "tournament"."""
    pressure: float = Field(1.8, ge=1.0, le=2.0)
    """Children that the best can expect, in units of the average. For "rank"."""
    truncation: float = Field(0.25, gt=0.0, le=1.0)
    """Share of the survivors that may become parents. For "truncation"."""


def select(
    settings: SelectionSettings, survivors: int, shape: tuple[int, ...], rng: np.random.Generator
) -> np.ndarray:
    """Ranks of parents drawn from `survivors` sorted individuals, in the shape asked for."""
    if settings.selection == "tournament":
        # Survivors are sorted, the best first: the smallest index wins.
        return rng.integers(survivors, size=(*shape, settings.tournament)).min(axis=-1)
    if settings.selection == "truncation":
        return rng.integers(max(1, round(settings.truncation * survivors)), size=shape)
    ranks = np.arange(survivors)
    slope = 2.0 * (settings.pressure - 1.0) / max(survivors - 1, 1)
    chances = np.cumsum(settings.pressure - slope * ranks)
    drawn = np.searchsorted(chances, rng.random(shape) * chances[-1], side="right")
    return np.minimum(drawn, survivors - 1)


def order(individuals: Individuals) -> np.ndarray:
    """Indices that sort individuals, the best first; of equals, the older first.

    Equal to the last bit means a copy: whoever repeats the fitness of an older one comes after
    everybody else, so that one genome never fills the elite.
    """
    worth = individuals.scores.worth
    best_first = np.lexsort((individuals.ids, -worth))
    repeats = np.append(False, worth[best_first][1:] == worth[best_first][:-1])
    return np.concatenate([best_first[~repeats], best_first[repeats]])
