"""A steady-state genetic algorithm: no generations, a child replaces whoever is worst."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import Individuals, OptimizerSettings, PopulationOptimizer
from evolve.optimizers.selection import SelectionSettings, order, select
from evolve.optimizers.variation import VariationSettings, children
from evolve.streams import Role

__all__ = ["SteadyState", "SteadyStateSettings"]


class SteadyStateSettings(SelectionSettings, VariationSettings):
    """How many live, and how strongly the fit are preferred."""

    type: Literal["steady_state"] = "steady_state"
    living: int = Field(256, ge=2)
    """How many individuals live at a time. Small batches of children (the run's population) keep
    the parents fresh."""


class SteadyState(PopulationOptimizer):
    """The best `living` individuals of all so far are the parents of the next batch.

    Syswerda's replacement of the worst (1991): a child of any batch joins the living as soon as its
    score is told, and the worst leave.
    """

    Settings: ClassVar[type[OptimizerSettings]] = SteadyStateSettings

    settings: SteadyStateSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._survivors is None or len(self._survivors) < self.settings.living:
            return self._newcomers(n)
        rng = self.streams(self.generation, Role.SELECTION)
        parents = select(self.settings, len(self._survivors), (n, 2), rng)
        return children(self, self._survivors, parents)

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._concatenate(self._survivors, individuals)
        self._survivors = self._take(pool, order(pool)[: self.settings.living])
