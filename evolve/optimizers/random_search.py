"""Random search: the baseline that every optimizer has to beat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from evolve.encodings.base import Genomes
from evolve.optimizers.base import NOBODY, Individuals, Optimizer, OptimizerSettings, Recall
from evolve.streams import Role

__all__ = ["RandomSearch", "RandomSettings"]


class RandomSettings(OptimizerSettings):
    """Random search has nothing to set."""

    type: Literal["random"] = "random"


class RandomSearch(Optimizer):
    """Draws every candidate afresh and learns nothing but who was the best."""

    Settings: ClassVar[type[OptimizerSettings]] = RandomSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        rng = self.streams(self.turn, Role.INITIAL)
        return self.encoding.random(n, rng), np.full((n, 2), NOBODY)

    def _tell(self, individuals: Individuals) -> None:
        """The base class keeps the best."""

    def _state(self) -> dict[str, np.ndarray]:
        return {}

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        """There is nothing beyond the counters."""
