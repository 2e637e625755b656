"""A genetic algorithm: selection, crossover, mutation, elites."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.optimizers.base import Individuals, OptimizerSettings
from evolve.optimizers.selection import order
from evolve.optimizers.variation import Breeder, BreedingSettings

__all__ = ["GeneticAlgorithm", "GeneticSettings"]


class GeneticSettings(BreedingSettings):
    """How strongly the fit are preferred, and how their children come about."""

    type: Literal["genetic"] = "genetic"
    elites: float = Field(0.2, ge=0.0, le=1.0)
    """Share of the population reserved for the best of all so far, who live on unchanged."""


class GeneticAlgorithm(Breeder):
    """Children of the selected replace all but an elite, which is not evaluated again."""

    Settings: ClassVar[type[OptimizerSettings]] = GeneticSettings

    settings: GeneticSettings

    def _tell(self, individuals: Individuals) -> None:
        if self._survivors is None:
            self._survivors = self._take(individuals, order(individuals))
            return
        size = len(individuals)
        pool = self._joined(self._survivors, individuals)
        elite, others = np.split(order(pool), [round(self.settings.elites * size)])
        young = others[others >= len(self._survivors)]
        # Whoever is not of the elite is no better than the elite: the whole stays sorted.
        self._survivors = self._take(pool, np.concatenate([elite, young])[:size])
