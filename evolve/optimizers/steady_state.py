"""A steady-state genetic algorithm: no generations, a child replaces whoever is worst."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import Individuals, OptimizerSettings
from evolve.optimizers.selection import order
from evolve.optimizers.variation import Breeder, BreedingSettings

__all__ = ["SteadyState", "SteadyStateSettings"]


class SteadyStateSettings(BreedingSettings):
    """How many live, and how strongly the fit are preferred."""

    type: Literal["steady_state"] = "steady_state"
    living: int = Field(256, ge=2)
    """How many individuals live at a time. Small batches of children (the run's population) keep
    the parents fresh."""
    ahead: int = Field(1, ge=0)
    """Batches that are under way when the next is asked for: workers never wait for the slowest of
    a batch. The search is the same on any number of them."""


class SteadyState(Breeder):
    """The best `living` individuals of all so far are the parents of the next batch.

    Syswerda's replacement of the worst (1991): a child of any batch joins the living as soon as its
    score is told, and the worst leave.
    """

    Settings: ClassVar[type[OptimizerSettings]] = SteadyStateSettings

    settings: SteadyStateSettings

    @property
    def ahead(self) -> int:
        """How many batches may be asked for before the scores of the first are told."""
        return self.settings.ahead

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        living = 0 if self._survivors is None else len(self._survivors)
        return super()._ask(n) if living >= self.settings.living else self._newcomers(n)

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._joined(self._survivors, individuals)
        self._survivors = self._take(pool, order(pool)[: self.settings.living])
