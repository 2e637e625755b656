"""NSGA-II: several objectives at once, a front of trade-offs instead of one winner."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from evolve.optimizers.base import Individuals, OptimizerSettings
from evolve.optimizers.pareto import best_first, objectives
from evolve.optimizers.variation import Breeder, BreedingSettings

__all__ = ["Nsga2", "Nsga2Settings"]


class Nsga2Settings(BreedingSettings):
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


class Nsga2(Breeder):
    """Deb et al. (2002): the better Pareto front survives, of the last front the lonelier."""

    Settings: ClassVar[type[OptimizerSettings]] = Nsga2Settings

    settings: Nsga2Settings

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._joined(self._survivors, individuals)
        points = objectives(pool.scores, self.settings.objectives)
        self._survivors = self._take(pool, best_first(points, pool.ids)[: len(individuals)])
