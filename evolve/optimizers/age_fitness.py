"""Age-fitness Pareto optimization: young lineages are protected from older, fitter ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding, Genomes
from evolve.optimizers.base import (
    NOBODY,
    Individuals,
    OptimizerSettings,
    Recall,
)
from evolve.optimizers.pareto import ranks
from evolve.optimizers.variation import Breeder, BreedingSettings
from evolve.streams import Streams

__all__ = ["AgeFitness", "AgeFitnessSettings"]


class AgeFitnessSettings(BreedingSettings):
    """How many unrelated newcomers every generation gets."""

    type: Literal["age_fitness"] = "age_fitness"
    newcomers: float = Field(0.05, ge=0.0, le=1.0)
    """Share of every generation that is drawn at random, at least one; their age is 0."""
    tournament: int = Field(2, ge=1)
    """How many individuals compete to become a parent; 1 = no preference. For "tournament"."""


class AgeFitness(Breeder):
    """Schmidt and Lipson's method (2011): survivors are fit for the age of their lineage.

    An individual's age is the number of generations since its oldest ancestor was drawn at random.
    Of survivors and children together those live on that are not dominated in (fitness, youth),
    front by front, the fitter first within the last.
    """

    Settings: ClassVar[type[OptimizerSettings]] = AgeFitnessSettings

    settings: AgeFitnessSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        self._ages = np.zeros(0, np.int64)
        self._young_ages = np.zeros(0, np.int64)

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        self._young_ages = np.zeros(n, np.int64)
        if self._survivors is None:
            return self._newcomers(n)
        count = min(max(1, round(self.settings.newcomers * n)), n)
        fresh, nobody = self._newcomers(count)
        parents = self._parents(n - count)
        young, ids = self._children(parents)
        older = np.where(ids == NOBODY, 0, self._ages[parents]).max(axis=1)
        self._young_ages[: n - count] = older + 1
        return self.encoding.concatenate([young, fresh]), np.concatenate([ids, nobody])

    def _tell(self, individuals: Individuals) -> None:
        ages, pool = self._young_ages, individuals
        if self._survivors is not None:
            ages = np.concatenate([self._ages + 1, ages])
            pool = self._joined(self._survivors, individuals)
        worth = pool.scores.worth
        front = ranks(np.stack([worth, -ages.astype(np.float64)], axis=1))
        kept = np.lexsort((pool.ids, -worth, front))[: len(individuals)]
        # Sorted by fitness at the end: selection prefers the first.
        kept = kept[np.lexsort((pool.ids[kept], -worth[kept]))]
        self._survivors, self._ages = self._take(pool, kept), ages[kept]

    def _state(self) -> dict[str, np.ndarray]:
        return {**super()._state(), "ages": self._ages, "young_ages": self._young_ages}

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        super()._restore(state, recall)
        self._ages = np.array(state["ages"], dtype=np.int64)
        self._young_ages = np.array(state["young_ages"], dtype=np.int64)
