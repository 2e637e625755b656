"""A genetic algorithm: tournaments, crossover, mutation, elites."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import (
    NOBODY,
    Individuals,
    OptimizerSettings,
    PopulationOptimizer,
)
from evolve.streams import Role

__all__ = ["GeneticAlgorithm", "GeneticSettings"]


class GeneticSettings(OptimizerSettings):
    """How strongly the fit are preferred, and how their children come about."""

    type: Literal["genetic"] = "genetic"
    tournament: int = Field(4, ge=1)
    """How many individuals compete to become a parent; 1 = no preference."""
    elites: float = Field(0.2, ge=0.0, le=1.0)
    """Share of the population reserved for the best of all so far, who live on unchanged."""
    crossover_rate: float = Field(0.7, ge=0.0, le=1.0)
    """Share of the children with two parents; the others have one."""
    mutation_rate: float = Field(0.9, ge=0.0, le=1.0)
    """Share of the children with two parents that mutate; children of one always do."""


class GeneticAlgorithm(PopulationOptimizer):
    """Children of tournament winners replace all but an elite, which is not evaluated again."""

    Settings: ClassVar[type[OptimizerSettings]] = GeneticSettings

    settings: GeneticSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._survivors is None:
            rng = self.streams(self.generation, Role.INITIAL)
            return self.encoding.random(n, rng), np.full((n, 2), NOBODY)
        parents = self._select(n)
        crossed = self.streams(self.generation, Role.CROSSOVER, 1).random(n)
        crossed = crossed < self.settings.crossover_rate
        ids = self._survivors.ids[parents]
        ids[~crossed, 1] = NOBODY
        return self._vary(parents, crossed), ids

    def _select(self, n: int) -> np.ndarray:
        """Pick two parents for each of n children, each the winner of a tournament: (n, 2)."""
        rng = self.streams(self.generation, Role.SELECTION)
        entrants = rng.integers(len(self._survivors), size=(n, 2, self.settings.tournament))
        # Survivors are sorted, the best first: the smallest index wins.
        return entrants.min(axis=2)

    def _vary(self, parents: np.ndarray, crossed: np.ndarray) -> Genomes:
        """Make the children of the pairs: crossed over or not, mutated or not."""
        encoding, pool, n = self.encoding, self._survivors.genomes, len(parents)
        mothers = encoding.take(pool, parents[:, 0])
        fathers = encoding.take(pool, parents[:, 1])
        both = encoding.cross(mothers, fathers, self.streams(self.generation, Role.CROSSOVER))
        children = encoding.take(encoding.concatenate([mothers, both]), np.arange(n) + n * crossed)
        mutants = encoding.mutate(children, self.streams(self.generation, Role.MUTATION))
        coins = self.streams(self.generation, Role.MUTATION, 1).random(n)
        mutated = ~crossed | (coins < self.settings.mutation_rate)
        return encoding.take(encoding.concatenate([children, mutants]), np.arange(n) + n * mutated)

    def _tell(self, individuals: Individuals) -> None:
        if self._survivors is None:
            self._survivors = self._take(individuals, _order(individuals))
            return
        size = len(individuals)
        pool = self._concatenate(self._survivors, individuals)
        order = _order(pool)
        elite, others = np.split(order, [round(self.settings.elites * size)])
        children = others[others >= len(self._survivors)]
        # Whoever is not of the elite is no better than the elite: the whole stays sorted.
        self._survivors = self._take(pool, np.concatenate([elite, children])[:size])


def _order(individuals: Individuals) -> np.ndarray:
    """Indices that sort individuals, the best first; of equals, the older first.

    Equal to the last bit means a copy: whoever repeats the fitness of an older one comes after
    everybody else, so that one genome never fills the elite.
    """
    worth = individuals.scores.worth
    order = np.lexsort((individuals.ids, -worth))
    repeats = np.append(False, worth[order][1:] == worth[order][:-1])
    return np.concatenate([order[~repeats], order[repeats]])
