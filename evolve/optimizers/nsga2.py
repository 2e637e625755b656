"""NSGA-II: several objectives at once, a front of trade-offs instead of one winner."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import Individuals, OptimizerSettings, PopulationOptimizer
from evolve.optimizers.pareto import best_first, objectives
from evolve.optimizers.selection import SelectionSettings, select
from evolve.optimizers.variation import VariationSettings, children
from evolve.streams import Role

__all__ = ["Nsga2", "Nsga2Settings"]


class Nsga2Settings(SelectionSettings, VariationSettings):
    """What to optimize at once."""

    type: Literal["nsga2"] = "nsga2"
    objectives: tuple[str, ...] = Field(("fitness", "-energy"), min_length=1)
    """`fitness` or a descriptor of the trial; with a minus in front, less is better."""
    tournament: int = Field(2, ge=1)
    """How many individuals compete to become a parent; 1 = no preference. For "tournament"."""

    @property
    def measures(self) -> tuple[str, ...]:
        """The objectives that are not the fitness."""
        names = (name.removeprefix("-") for name in self.objectives)
        return tuple(name for name in names if name != "fitness")


class Nsga2(PopulationOptimizer):
    """Deb et al. (2002): the better Pareto front survives, of the last front the lonelier."""

    Settings: ClassVar[type[OptimizerSettings]] = Nsga2Settings

    settings: Nsga2Settings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._survivors is None:
            return self._newcomers(n)
        rng = self.streams(self.generation, Role.SELECTION)
        parents = select(self.settings, len(self._survivors), (n, 2), rng)
        return children(self, self._survivors, parents)

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._concatenate(self._survivors, individuals)
        points = objectives(pool.scores, self.settings.objectives)
        self._survivors = self._take(pool, best_first(points, pool.ids)[: len(individuals)])
