"""Variation: children of selected parents, by the operators of the encoding."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import NOBODY, PopulationOptimizer
from evolve.optimizers.selection import SelectionSettings, select
from evolve.streams import Role

__all__ = ["Breeder", "BreedingSettings"]


class BreedingSettings(SelectionSettings):
    """How strongly the fit are preferred, and how their children come about."""

    crossover_rate: float = Field(0.7, ge=0.0, le=1.0)
    """Share of the children with two parents; the others have one."""
    mutation_rate: float = Field(0.9, ge=0.0, le=1.0)
    """Share of the children with two parents that mutate; children of one always do."""


class Breeder(PopulationOptimizer):
    """Whoever survives has children: selected, crossed over or not, mutated or not."""

    settings: BreedingSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._survivors is None:
            return self._newcomers(n)
        return self._children(self._parents(n))

    def _parents(self, n: int) -> np.ndarray:
        """Places among the survivors of the parents of n children, shape (n, 2)."""
        rng = self.streams(self.turn, Role.SELECTION)
        return select(self.settings, len(self._survivors), (n, 2), rng)

    def _children(self, parents: np.ndarray) -> tuple[Genomes, np.ndarray]:
        """A child of every pair of survivors, shape (n, 2): n genomes, and the parents' ids."""
        encoding, streams, turn, pool = self.encoding, self.streams, self.turn, self._survivors
        n, settings = len(parents), self.settings
        crossed = streams(turn, Role.CROSSOVER, 1).random(n) < settings.crossover_rate
        ids = pool.ids[parents]
        ids[~crossed, 1] = NOBODY
        young, both = encoding.take(pool.genomes, parents[:, 0]), np.flatnonzero(crossed)
        if len(both):
            mothers = encoding.take(young, both)
            fathers = encoding.take(pool.genomes, parents[both, 1])
            children = encoding.cross(mothers, fathers, streams(turn, Role.CROSSOVER))
            encoding.overwrite(young, both, children, np.arange(len(both)))
        mutants = encoding.mutate(young, streams(turn, Role.MUTATION))
        coins = streams(turn, Role.MUTATION, 1).random(n)
        spared = np.flatnonzero(crossed & (coins >= settings.mutation_rate))
        encoding.overwrite(mutants, spared, young, spared)
        return mutants, ids
