"""Fields: the actuation as a function of the place in the body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evolve.encodings.actuation import ActuationSettings, FixedBody
from evolve.encodings.base import ArrayGenomes, folded

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ArrayField", "FieldBody", "squashed"]

RANGE = 4.0
"""Coefficients lie between minus and plus this: far enough to saturate what they feed."""


class FieldBody(FixedBody):
    """A fixed body whose springs read their actuation off four fields.

    L0 = f(x, y, z, t) = a + b sin(wt + c), where a, b, c and the stiffness k depend on the place.
    The fields are rest length, b cos c, b sin c and log k, each a real number that is squashed
    into its bounds.
    """

    def from_fields(self, fields: np.ndarray) -> ws.Variants:
        """The robots of n controllers from four fields at the R springs, shape (n, 4, R)."""
        rest, cosine, sine, stiffness = np.moveaxis(np.asarray(fields, np.float64), 1, 0)
        amplitude = np.hypot(cosine, sine)
        phase = np.arctan2(sine, cosine) / (2.0 * np.pi)
        return self.actuated(squashed(rest), np.tanh(amplitude), phase, squashed(stiffness))


class ArrayField(FieldBody, ArrayGenomes):
    """A field with a fixed number of coefficients, each a gene in [0, 1] that stands for +-RANGE.

    Subclasses set `genome_shape` and turn coefficients into fields. Genes are drawn from a normal
    distribution, so that fields begin gentle.
    """

    settings: ActuationSettings

    def coefficients(self, genomes: np.ndarray) -> np.ndarray:
        """Real coefficients of the genes, shape (n, *genome_shape), float64."""
        return (2.0 * np.asarray(genomes, np.float64) - 1.0) * RANGE

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes whose coefficients have a standard deviation of 1."""
        drawn = rng.standard_normal((n, *self.genome_shape), dtype=np.float32)
        return folded(np.float32(0.5) + drawn * np.float32(0.5 / RANGE))

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift scattered genes of every genome, at least one; reflected at the bounds."""
        n, size = len(genomes), int(np.prod(self.genome_shape))
        chosen = rng.random((n, size), dtype=np.float32) < np.float32(self.settings.mutation_rate)
        chosen[np.arange(n), rng.integers(size, size=n)] = True
        shift = rng.standard_normal((n, size), dtype=np.float32)
        shift *= np.float32(self.settings.mutation_step) * chosen
        return folded(genomes + shift.reshape(genomes.shape))

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every gene from a[i] or from b[i]; in half of the crossings, mix them evenly."""
        coins = rng.random(a.shape, dtype=np.float32) < 0.5
        weight = rng.random(len(a), dtype=np.float32).reshape(-1, *[1] * (a.ndim - 1))
        blended = a + weight * (b - a)
        blend = rng.random(len(a)) < 0.5
        return np.where(blend.reshape(weight.shape), blended, np.where(coins, b, a))

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Mean difference of the coefficients, shape (n,), about 1 for unrelated genomes."""
        gap = np.abs(self.coefficients(a) - self.coefficients(b))
        # Two numbers of a normal distribution of deviation 1 are 2 / sqrt(pi) apart on average.
        return gap.reshape(len(a), -1).mean(axis=1) * (np.sqrt(np.pi) / 2.0)


def squashed(field: np.ndarray) -> np.ndarray:
    """Real numbers into 0 to 1, 0 into the middle."""
    return 0.5 + 0.5 * np.tanh(field)
