"""CMA-ES, by the library `cma`: a normal distribution that learns where to search."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding, Genomes
from evolve.optimizers.base import NOBODY, Individuals, Optimizer, OptimizerSettings, Recall
from evolve.streams import Role, Streams

__all__ = ["CmaEs", "CmaEsSettings"]


class CmaEsSettings(OptimizerSettings):
    """Where the search begins."""

    type: Literal["cma"] = "cma"
    sigma: float = Field(0.3, gt=0.0)
    """Standard deviation at first, as a share of a gene's range."""
    full: int = Field(500, ge=1)
    """Genomes of more genes than this keep a diagonal covariance matrix."""


class CmaEs(Optimizer):
    """Hansen's covariance matrix adaptation (2016) over the genes as one long vector.

    For encodings whose genomes are arrays of numbers. A search that has converged begins again
    somewhere else. The state is the number of candidates of every generation: a resumed run
    replays what the distribution was told.
    """

    Settings: ClassVar[type[OptimizerSettings]] = CmaEsSettings

    settings: CmaEsSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        if not hasattr(encoding, "from_vectors"):
            raise ValueError("cma: this encoding has no genomes of a fixed number of real genes")
        self._distribution: Any = None
        self._rng = streams(0, Role.MUTATION)
        self._asked: list[np.ndarray] = []
        self._sizes: list[int] = []

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if n < 2:
            raise ValueError("cma: a population of at least 2 is needed")
        return self.encoding.from_vectors(self._draw(n)), np.full((n, 2), NOBODY)

    def _draw(self, n: int) -> np.ndarray:
        """Vectors of this generation, shape (n, D)."""
        self._rng = self.streams(self.generation, Role.MUTATION)
        if self._distribution is None or self._distribution.stop(ignore_list=["maxiter"]):
            self._distribution = self._begin(n)
        self._asked = self._distribution.ask(number=n)
        return np.asarray(self._asked, np.float64)

    def _begin(self, n: int) -> Any:
        import cma

        start = self.encoding.random(1, self.streams(self.generation, Role.INITIAL))
        mean = self.encoding.to_vectors(start)[0]
        options = {
            "popsize": n,
            "seed": np.nan,  # it leaves the global generator alone ...
            "randn": lambda *shape: self._rng.standard_normal(shape),  # ... and uses ours
            "CMA_diagonal": len(mean) > self.settings.full,
            "verbose": -9,
            "verb_log": 0,
            "maxiter": np.inf,
        }
        return cma.CMAEvolutionStrategy(mean, self.settings.sigma, options)

    def _tell(self, individuals: Individuals) -> None:
        self._learn(individuals.scores.worth)

    def _learn(self, worth: np.ndarray) -> None:
        """Minimizes: whoever has no fitness comes after everybody who has."""
        self._sizes.append(len(worth))
        finite = worth[np.isfinite(worth)]
        if len(finite):
            last = finite.min() - 1.0
            self._distribution.tell(self._asked, -np.where(np.isfinite(worth), worth, last))
        else:
            self._distribution = None  # nothing to learn from here

    def _state(self) -> dict[str, np.ndarray]:
        return {"sizes": np.array(self._sizes, dtype=np.int64)}

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        generation, first = self.generation, 1
        for self.generation, size in enumerate(state["sizes"].tolist()):
            self._draw(size)
            self._learn(recall(np.arange(first, first + size)).scores.worth)
            first += size
        self.generation = generation
