"""The direct encoding: four genes for every spring of a fixed body."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from evolve.encodings.base import ArrayGenomes, EncodingSettings, folded

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["DirectEncoding", "DirectSettings"]

REST, AMPLITUDE, PHASE, STIFFNESS = range(4)
"""Rows of a genome."""
ON_CIRCLE = np.arange(4) == PHASE


class DirectSettings(EncodingSettings):
    """Bounds of the genes and how they vary."""

    type: Literal["direct"] = "direct"
    rest_length: tuple[float, float] = (0.9, 1.1)
    """Lowest and highest mean rest length, in initial lengths of the spring."""
    amplitude: float = Field(0.25, ge=0.0)
    """Largest amplitude of the rest length, in initial lengths of the spring."""
    stiffness: tuple[float, float] = (1000.0, 20000.0)
    """Lowest and highest stiffness [N/m]; the gene is their logarithm."""
    mutation_rate: float = Field(0.1, gt=0.0, le=1.0)
    """Share of the springs that a scattered mutation changes, on average."""
    mutation_step: float = Field(0.15, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range."""
    region_mutation: float = Field(0.5, ge=0.0, le=1.0)
    """Share of the mutations that shift all springs of a neighbourhood by the same amount."""
    region_crossover: float = Field(0.5, ge=0.0, le=1.0)
    """Share of the crossovers that cut the body by a plane; the others mix spring by spring."""

    @field_validator("rest_length", "stiffness")
    @classmethod
    def _ordered(cls, bounds: tuple[float, float]) -> tuple[float, float]:
        if not 0.0 < bounds[0] <= bounds[1] < float("inf"):
            raise ValueError("expected two finite numbers with 0 < lowest <= highest")
        return bounds


class DirectEncoding(ArrayGenomes):
    """Rest length, amplitude, phase and stiffness of each of the S springs of one body.

    A genome has shape (4, S), float32, every gene in [0, 1]; the phase is circular. Expressed as
    L0(t) = a + b sin(2 pi t / period + c) with stiffness k, where a and b are measured in initial
    lengths of the spring.
    """

    Settings: ClassVar[type[EncodingSettings]] = DirectSettings
    fixed_body: ClassVar[bool] = True

    def __init__(self, body: ws.Robot, settings: DirectSettings) -> None:
        if body.n_springs == 0:
            raise ValueError("the direct encoding needs a body with springs; this one has none")
        self.body = body
        self.settings = settings
        self.genome_shape = (4, body.n_springs)
        self.circular = ON_CIRCLE[:, None]
        ends = body.positions[body.springs]
        self._middles = ends.mean(axis=1)
        self._reach = float(np.linalg.norm(np.ptp(self._middles, axis=0)))

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes, shape (n, 4, S)."""
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift some genes of every genome, either of scattered springs or of a neighbourhood.

        Each mutation changes a random choice of the four kinds of gene. Rest length, amplitude
        and stiffness are reflected at their bounds.
        """
        n = len(genomes)
        in_region = rng.random(n) < self.settings.region_mutation
        chosen = np.where(in_region[:, None], self._balls(n, rng), self._scattered(n, rng))
        kinds = rng.random((n, 4)) < 0.5
        kinds[np.arange(n), rng.integers(4, size=n)] = True
        shared = rng.standard_normal((n, 4), dtype=np.float32)
        # Few springs change: only their genes are shifted, as K rows of four.
        rows, springs = np.nonzero(chosen)
        shift = rng.standard_normal((len(rows), 4), dtype=np.float32)
        shift = np.where(in_region[rows, None], shared[rows], shift) * kinds[rows]
        genes = genomes[rows, :, springs] + np.float32(self.settings.mutation_step) * shift
        mutants = genomes.copy()
        mutants[rows, :, springs] = folded(genes, ON_CIRCLE)
        return mutants

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every spring, with its four genes, from a[i] or from b[i]."""
        n, springs = len(a), self.genome_shape[1]
        by_plane = rng.random(n) < self.settings.region_crossover
        coins = rng.random((n, springs), dtype=np.float32) < 0.5
        from_b = np.where(by_plane[:, None], self._half_spaces(n, rng), coins)
        return np.where(from_b[:, None, :], b, a)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        genes = np.asarray(genomes, dtype=np.float64)
        (low, high), (soft, hard) = self.settings.rest_length, self.settings.stiffness
        lengths = self.body.lengths
        return self.body.variants(
            rest_length=lengths * (low + (high - low) * genes[:, REST]),
            amplitude=lengths * (self.settings.amplitude * genes[:, AMPLITUDE]),
            phase=2.0 * np.pi * genes[:, PHASE],
            stiffness=soft * (hard / soft) ** genes[:, STIFFNESS],
            omega=np.full(len(genes), 2.0 * np.pi / self.settings.period),
        )

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Mean difference of the genes, shape (n,), scaled so that uniform genes differ by 1."""
        gaps = np.abs(a.astype(np.float64) - b)
        gaps[:, PHASE] = np.minimum(gaps[:, PHASE], 1.0 - gaps[:, PHASE])
        # Two uniform numbers differ by 1/3 on average on a line, by 1/4 on a circle.
        gaps *= np.array([3.0, 3.0, 4.0, 3.0])[:, None]
        return gaps.mean(axis=(1, 2))

    def _scattered(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """For each of n genomes, independent springs and at least one: shape (n, S), bool."""
        chosen = rng.random((n, self.genome_shape[1]), dtype=np.float32)
        chosen = chosen < np.float32(self.settings.mutation_rate)
        chosen[np.arange(n), rng.integers(self.genome_shape[1], size=n)] = True
        return chosen

    def _balls(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """For each of n genomes, the springs within a ball about one of them: shape (n, S)."""
        centres = self._middles[rng.integers(self.genome_shape[1], size=n)]
        radii = rng.random(n) * (0.5 * self._reach)
        squared = sum((self._middles[:, i] - centres[:, i, None]) ** 2 for i in range(3))
        return squared <= radii[:, None] ** 2

    def _half_spaces(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """For each of n pairs, the springs on one side of a plane through the body: (n, S)."""
        normals = rng.standard_normal((n, 3))
        through = self._middles[rng.integers(self.genome_shape[1], size=n)]
        # Written out: a matrix product might add up differently on another number of threads.
        offsets = sum(
            normals[:, i, None] * (self._middles[:, i] - through[:, i, None]) for i in range(3)
        )
        return offsets > 0.0
