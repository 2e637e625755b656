"""Regions: materials by place, as few regions of a body choose them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from evolve.encodings.actuation import ActuationSettings, FixedBody
from evolve.encodings.base import ArrayGenomes, EncodingSettings, folded

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["RegionsEncoding", "RegionsSettings"]

X, Y, Z, WIDTH, MATERIAL = range(5)
"""Columns of a genome."""


class RegionsSettings(ActuationSettings):
    """How many regions there are, and of what."""

    type: Literal["regions"] = "regions"
    regions: int = Field(8, ge=1, le=256)
    """Regions of the body."""
    shape: Literal["centroids", "gaussians"] = "gaussians"
    """Whether a spring belongs to the nearest centre, or to the Gaussian that is largest there."""
    materials: tuple[str, ...] = ("tissue", "bone", "muscle", "muscle2")
    """Names of `ws.materials.BUILT_IN` among which each region chooses; they decide stiffness,
    amplitude and phase in place of the bounds."""

    @field_validator("materials")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        import warp_springs as ws

        known = ws.materials.BUILT_IN
        if not names or any(name not in known for name in names):
            raise ValueError(f"expected names of materials, which are {', '.join(known)}")
        return names


class RegionsEncoding(FixedBody, ArrayGenomes):
    """K regions of a body, each of one material.

    A genome has shape (K, 5), float32, in [0, 1]: centre x, y, z within the bounding box, width
    (of a Gaussian, up to half the longest extent), and the material. The four classic materials of
    the course are the default: tissue, bone, and two muscles in opposite phase.
    """

    Settings: ClassVar[type[EncodingSettings]] = RegionsSettings
    settings: RegionsSettings

    def __init__(self, body: ws.Robot, settings: RegionsSettings) -> None:
        import warp_springs as ws

        super().__init__(body, settings)
        self.genome_shape = (settings.regions, 5)
        self._table = [ws.materials.BUILT_IN[name] for name in settings.materials]
        self.body = body.replace(
            materials=(*body.materials, *(m for m in self._table if m not in body.materials))
        )
        self._label = np.array([self.body.materials.index(m) for m in self._table])
        lengths = body.lengths
        self._stiffness = np.stack([m.stiffness_of(lengths) for m in self._table])
        self._strain = np.array([m.strain for m in self._table])
        self._phase = np.array([m.phase for m in self._table])

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes."""
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Move or widen some regions, at least one, or give them another material."""
        n, regions = genomes.shape[:2]
        chosen = rng.random((n, regions)) < self.settings.mutation_rate
        chosen[np.arange(n), rng.integers(regions, size=n)] = True
        rows, places = np.nonzero(chosen)
        shift = rng.standard_normal((len(rows), 5), dtype=np.float32)
        shift *= np.float32(self.settings.mutation_step)
        other = rng.random(len(rows), dtype=np.float32)
        changes = rng.random(len(rows)) < 0.5
        shift[:, MATERIAL] = 0.0
        shift[changes, :MATERIAL] *= rng.random((changes.sum(), 1)) < 0.5
        genes = folded(genomes[rows, places] + shift)
        genes[changes, MATERIAL] = other[changes]
        mutants = genomes.copy()
        mutants[rows, places] = genes
        return mutants

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every region whole from a[i] or from b[i]."""
        coins = rng.random(a.shape[:2], dtype=np.float32) < 0.5
        return np.where(coins[:, :, None], b, a)

    def chosen(self, genomes: np.ndarray) -> np.ndarray:
        """Which of the materials each of the R springs is made of, shape (n, R)."""
        genes = np.asarray(genomes, np.float64)
        low, high = self.body.bounds
        extent = max(float((high - low).max()), np.finfo(float).tiny)
        centres = low + (high - low) * genes[:, :, :WIDTH]
        squared = sum(
            (self.middles[:, i] - centres[:, :, i, None]) ** 2 for i in range(3)
        )  # (n, K, R)
        if self.settings.shape == "gaussians":
            width = extent * (0.05 + 0.45 * genes[:, :, WIDTH, None])
            squared = squared / width**2
        region = squared.argmin(axis=1)
        count = len(self._table)
        material = np.minimum((genes[:, :, MATERIAL] * count).astype(np.int64), count - 1)
        return np.take_along_axis(material, region, axis=1)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n choices of materials."""
        chosen = self.spread(self.chosen(genomes))
        springs, lengths = np.arange(self.body.n_springs), self.body.lengths
        later = self.spread_phase(np.zeros((1, len(self.own))))
        return self.variants(
            stiffness=self._stiffness[chosen, springs],
            rest_length=np.broadcast_to(lengths, chosen.shape),
            amplitude=lengths * self._strain[chosen],
            phase=self._phase[chosen] + 2.0 * np.pi * later,
            material=self._label[chosen].astype(np.int32),
            omega=np.full(len(chosen), 2.0 * np.pi / self.settings.period),
        )

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Share of the springs that are made of something else, shape (n,), 1 for unrelated."""
        differs = (self.chosen(a) != self.chosen(b)).mean(axis=1)
        count = len(self._table)
        return differs * (count / (count - 1) if count > 1 else 1.0)
