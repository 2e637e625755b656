"""Hill climbers: one or many, each moving to the best of its mutants unless that is worse."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import NOBODY, Individuals, OptimizerSettings, PopulationOptimizer
from evolve.streams import Role

__all__ = ["HillClimber", "HillClimberSettings"]


class HillClimberSettings(OptimizerSettings):
    """How many climbers there are."""

    type: Literal["hill_climber"] = "hill_climber"
    climbers: int | None = Field(None, ge=1)
    """Independent climbers: one for every member of the population when left out (the parallel
    hill climber); 1 is the plain hill climber, all of whose candidates are mutants of one."""


class HillClimber(PopulationOptimizer):
    """Each climber offers its share of mutants and moves to the best unless that is worse.

    A climber that has no fitness yet starts anew at random. The first candidates start the
    climbers.
    """

    Settings: ClassVar[type[OptimizerSettings]] = HillClimberSettings

    settings: HillClimberSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        fresh, nobody = self._newcomers(n)
        if self._survivors is None:
            return fresh, nobody
        whose = self._whose(n)
        climbers = self._take(self._survivors, whose)
        rng = self.streams(self.generation, Role.MUTATION)
        mutants = self.encoding.mutate(climbers.genomes, rng)
        lost = np.isneginf(climbers.scores.worth)
        parents = np.where(lost, NOBODY, climbers.ids)
        anew = np.flatnonzero(lost)
        self.encoding.overwrite(mutants, anew, fresh, anew)
        return mutants, np.stack([parents, np.full(n, NOBODY)], axis=1)

    def _tell(self, individuals: Individuals) -> None:
        whose = self._whose(len(individuals))
        # The last of each climber in this order is its best; of equals, the younger.
        order = np.lexsort((individuals.ids, individuals.scores.worth, whose))
        best = order[np.append(whose[order][1:] != whose[order][:-1], True)]
        if self._survivors is None:
            self._survivors = self._take(individuals, best)
            return
        moved = individuals.scores.worth[best] >= self._survivors.scores.worth
        n = len(best)
        pool = self._joined(self._survivors, self._take(individuals, best))
        self._survivors = self._take(pool, np.arange(n) + n * moved)

    def _whose(self, n: int) -> np.ndarray:
        """Which climber each of n candidates belongs to, shape (n,)."""
        first = self._survivors is None
        climbers = (self.settings.climbers or n) if first else len(self._survivors)
        if n < climbers:
            raise ValueError(f"{climbers} hill climbers were asked for {n} candidates")
        return np.arange(n) % climbers
