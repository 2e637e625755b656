"""The direct encoding: four genes for every spring of a fixed body."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.actuation import ActuationSettings, FixedBody
from evolve.encodings.base import ArrayGenomes, EncodingSettings, coins, folded, sparse

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["DirectEncoding", "DirectSettings"]

REST, AMPLITUDE, PHASE, STIFFNESS = range(4)
"""Rows of a genome."""


class DirectSettings(ActuationSettings):
    """Bounds of the genes and how they vary."""

    type: Literal["direct"] = "direct"
    mutation_spread: float = Field(1.0, ge=0.0, le=3.0)
    """Standard deviation of the logarithm of the step of each mutant: some are bold, some careful;
    0 where all take `mutation_step`."""
    region_mutation: float = Field(0.5, ge=0.0, le=1.0)
    """Share of the mutations that shift all springs of a neighbourhood by the same amount."""
    region_crossover: float = Field(0.5, ge=0.0, le=1.0)
    """Share of the crossovers that cut the body by a plane; the others mix spring by spring."""


class DirectEncoding(FixedBody, ArrayGenomes):
    """Rest length, amplitude, phase and stiffness of each of the R springs that have genes.

    A genome has shape (4, R), float32, every gene in [0, 1]; the phase is circular. Expressed as
    L0(t) = a + b sin(2 pi t / period + c) with stiffness k, where a and b are measured in initial
    lengths of the spring.
    """

    Settings: ClassVar[type[EncodingSettings]] = DirectSettings

    kinds: int = 4
    """Genes of a spring."""
    on_circle = np.arange(4) == PHASE
    """Which of them go round."""

    def __init__(self, body: ws.Robot, settings: DirectSettings) -> None:
        super().__init__(body, settings)
        self.genome_shape = (self.kinds, len(self.own))
        self.circular = self.on_circle[:, None]

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes, shape (n, 4, R)."""
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift some genes of every genome, either of scattered springs or of a neighbourhood.

        Each mutation changes a random choice of the kinds of gene. All but phases are reflected at
        their bounds.
        """
        n, kinds_of, own = len(genomes), self.kinds, len(self.own)
        in_region = rng.random(n) < self.settings.region_mutation
        chosen = np.empty((n, own), bool)
        where = np.flatnonzero(in_region), np.flatnonzero(~in_region)
        chosen[where[0]] = self.balls(len(where[0]), rng)
        chosen[where[1]] = sparse((len(where[1]), own), self.settings.mutation_rate, rng)
        kinds = coins((n, kinds_of), rng)
        kinds[np.arange(n), rng.integers(kinds_of, size=n)] = True
        bold = np.exp(self.settings.mutation_spread * rng.standard_normal(n, dtype=np.float32))
        step = np.float32(self.settings.mutation_step) * bold
        shared = rng.standard_normal((n, kinds_of), dtype=np.float32)
        # Few genes change: only these are shifted. A line is one kind of gene of one genome.
        places = np.flatnonzero(chosen[:, None] & kinds[:, :, None])
        line = places // own
        genes = shared.ravel()[line]
        scattered = np.flatnonzero(np.repeat(~in_region, kinds_of)[line])
        genes[scattered] = rng.standard_normal(len(scattered), dtype=np.float32)
        genes *= np.repeat(step, kinds_of)[line]
        mutants = genomes.copy()
        genes += mutants.ravel()[places]
        beyond = np.flatnonzero((genes < 0.0) | (genes > 1.0))
        genes[beyond] = folded(genes[beyond], self.on_circle[line[beyond] % kinds_of])
        mutants.ravel()[places] = genes
        return mutants

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every spring, with all its genes, from a[i] or from b[i]."""
        n, springs = len(a), self.genome_shape[1]
        by_plane = rng.random(n) < self.settings.region_crossover
        where = np.flatnonzero(by_plane), np.flatnonzero(~by_plane)
        from_b = np.empty((n, springs), bool)
        from_b[where[0]] = self.half_spaces(len(where[0]), rng)
        from_b[where[1]] = coins((len(where[1]), springs), rng)
        # By bits: a branch for each of a million random coins takes seven times as long.
        a, b = a.view(np.int32), b.view(np.int32)
        child = a ^ b
        child &= -from_b.astype(np.int32)[:, None, :]
        child ^= a
        return child.view(np.float32)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        return self.actuated(*(genomes[:, k] for k in (REST, AMPLITUDE, PHASE, STIFFNESS)))

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Mean difference of the genes, shape (n,), scaled so that uniform genes differ by 1."""
        gaps = np.abs(a.astype(np.float64) - b)
        gaps[:, self.on_circle] = np.minimum(gaps[:, self.on_circle], 1 - gaps[:, self.on_circle])
        # Two uniform numbers differ by 1/3 on average on a line, by 1/4 on a circle.
        gaps *= np.where(self.on_circle, 4.0, 3.0)[:, None]
        return gaps.mean(axis=(1, 2))
