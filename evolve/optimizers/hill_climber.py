"""Parallel hill climber: many independent climbers, each keeping the better of two."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from evolve.encodings.base import Genomes
from evolve.optimizers.base import (
    NOBODY,
    Individuals,
    OptimizerSettings,
    PopulationOptimizer,
)
from evolve.streams import Role

__all__ = ["HillClimber", "HillClimberSettings"]


class HillClimberSettings(OptimizerSettings):
    """A hill climber has nothing to set: one climber for every member of the population."""

    type: Literal["hill_climber"] = "hill_climber"


class HillClimber(PopulationOptimizer):
    """Each climber offers a mutant of itself and moves there unless the mutant is worse.

    A climber that has no fitness yet starts anew at random. With n = 1 this is the plain hill
    climber. The number of climbers is that of the first generation.
    """

    Settings: ClassVar[type[OptimizerSettings]] = HillClimberSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        fresh = self.encoding.random(n, self.streams(self.generation, Role.INITIAL))
        climbers = self._survivors
        if climbers is None:
            return fresh, np.full((n, 2), NOBODY)
        if n != len(climbers):
            raise ValueError(f"{len(climbers)} hill climbers were asked for {n} candidates")
        rng = self.streams(self.generation, Role.MUTATION)
        mutants = self.encoding.mutate(climbers.genomes, rng)
        lost = np.isneginf(climbers.scores.worth)
        parents = np.where(lost, NOBODY, climbers.ids)
        pool = self.encoding.concatenate([mutants, fresh])
        genomes = self.encoding.take(pool, np.arange(n) + n * lost)
        return genomes, np.stack([parents, np.full(n, NOBODY)], axis=1)

    def _tell(self, individuals: Individuals) -> None:
        if self._survivors is None:
            self._survivors = individuals
            return
        moved = individuals.scores.worth >= self._survivors.scores.worth
        pool = self._concatenate(self._survivors, individuals)
        n = len(individuals)
        self._survivors = self._take(pool, np.arange(n) + n * moved)
