"""Novelty search: who does what nobody did before has children, alone or along with the fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding
from evolve.judging.scores import Scores
from evolve.optimizers.base import Individuals, OptimizerSettings, Recall, described
from evolve.optimizers.variation import Breeder, BreedingSettings
from evolve.streams import Streams

__all__ = ["Novelty", "NoveltySettings", "loneliness"]

BLOCK = 256
"""Individuals whose distances to all others are held in memory together."""


class NoveltySettings(BreedingSettings):
    """What counts as new, and how much it counts."""

    type: Literal["novelty"] = "novelty"
    descriptors: tuple[str, ...] = Field(("displacement_x", "displacement_y"), min_length=1)
    """Descriptors in which individuals are compared: of the body (diameter, mass, springs,
    muscles, symmetry) or of what it does (footfall, displacement_x ...)."""
    neighbours: int = Field(15, ge=1)
    """How many of the nearest in population and archive the novelty is the mean distance to."""
    archived: float = Field(0.05, ge=0.0, le=1.0)
    """Share of every generation, the most novel of it, that the archive keeps for ever; at least
    one."""
    weight: float = Field(0.5, ge=0.0, le=1.0)
    """How much novelty counts against fitness: 1 is novelty alone, 0 fitness alone."""

    @property
    def measures(self) -> tuple[str, ...]:
        """What individuals are compared in."""
        return self.descriptors

    @property
    def niches(self) -> tuple[str, ...]:
        """The same."""
        return self.descriptors


class Novelty(Breeder):
    """Lehman and Stanley's search (2011): the novel survive, or the novel and fit.

    Novelty is the mean distance to the nearest neighbours among population and archive, in units
    of the standard deviation of each descriptor there. Those survive whose weighted sum of two
    ranks, by novelty and by fitness, is highest. Whoever was stopped is not novel.
    """

    Settings: ClassVar[type[OptimizerSettings]] = NoveltySettings

    settings: NoveltySettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        self.archive = np.zeros(0, np.int64)
        """Ids of the most novel of every generation so far."""
        self._known = np.zeros((0, len(settings.descriptors)))  # their descriptors

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._joined(self._survivors, individuals)
        novelty = self.novelty(pool)
        young = novelty[-len(individuals) :]
        healthy = int(np.isfinite(young).sum())
        count = min(max(1, round(self.settings.archived * len(individuals))), healthy)
        best = np.lexsort((individuals.ids, -young))[:count]
        self._remember(individuals.ids[best], individuals.scores.take(best))
        weight, worth = self.settings.weight, pool.scores.worth
        merit = weight * _rank(novelty) + (1.0 - weight) * _rank(worth)
        kept = np.lexsort((pool.ids, -merit, np.isneginf(worth)))[: len(individuals)]
        self._survivors = self._take(pool, kept)

    def novelty(self, individuals: Individuals) -> np.ndarray:
        """How novel each of n individuals is among each other and the archive, shape (n,).

        -inf for an individual without fitness or with a descriptor that is not finite.
        """
        names = self.settings.descriptors
        values, worth = described(individuals.scores, names), individuals.scores.worth
        good = np.isfinite(values).all(axis=1) & np.isfinite(worth)
        found = np.full(len(values), -np.inf)
        if good.any():
            # Survivors that are archived too are one point, not their own neighbours.
            others = self._known[~np.isin(self.archive, individuals.ids)]
            known = np.concatenate([values[good], others])
            found[good] = loneliness(known, int(good.sum()), self.settings.neighbours)
        return found

    def _remember(self, ids: np.ndarray, scores: Scores) -> None:
        """Put individuals into the archive."""
        values = described(scores, self.settings.descriptors)
        self.archive = np.concatenate([self.archive, ids])
        self._known = np.concatenate([self._known, values])

    def _state(self) -> dict[str, np.ndarray]:
        return {**super()._state(), "archive": self.archive}

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        super()._restore(state, recall)
        self.archive, self._known = self.archive[:0], self._known[:0]
        if len(ids := state["archive"]):
            self._remember(ids, recall(ids).scores)


def loneliness(points: np.ndarray, count: int, neighbours: int) -> np.ndarray:
    """Mean distance of the first `count` of some points (n, D) to their nearest others, (count,).

    Args:
        points: Each column is measured in its standard deviation.
        count: How many are asked about.
        neighbours: How many of the nearest, or all others where there are fewer.
    """
    scale = points.std(axis=0)
    points = points / np.where(scale > 0.0, scale, 1.0)
    nearest = min(neighbours, len(points) - 1)
    found = np.zeros(count)
    if nearest < 1:
        return found
    for first in range(0, count, BLOCK):
        some = np.arange(first, min(first + BLOCK, count))
        squared = np.zeros((len(some), len(points)))
        for column in points.T:
            squared += (column[some, None] - column) ** 2
        squared[np.arange(len(some)), some] = np.inf
        # Sorted, so that the sum does not depend on how they were partitioned.
        least = np.sort(np.partition(squared, nearest - 1, axis=1)[:, :nearest], axis=1)
        found[some] = np.sqrt(least).mean(axis=1)
    return found


def _rank(values: np.ndarray) -> np.ndarray:
    """Share of the others that are lower, shape (n,); equals have equal ranks."""
    return np.searchsorted(np.sort(values), values) / max(len(values) - 1, 1)
