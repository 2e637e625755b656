"""What encodings of bodies that are built of cells share: their size, and what cells do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from evolve.bodies import build
from evolve.bodies.cells import BEND, SWELL, SWING_SIDEWAYS, Cells, Tissue
from evolve.encodings.base import ArrayGenomes, folded
from evolve.encodings.evolving import BodySettings, EvolvingBody

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["PHASE", "STIFFNESS", "TISSUE", "CellBody", "CellGenes", "CellSettings", "tissue"]

TISSUE = 5
"""Genes of a tissue: rest length, swing, phase, stiffness, kind."""
PHASE, STIFFNESS = 2, 3
"""Two of them; the phase goes round."""


class CellSettings(BodySettings):
    """How large cells are, how many a body may have, and how much a mutation changes."""

    largest_extent: float = Field(1.2, gt=0.0)
    """Longest side of the bounding box that a body may have [m]."""
    edge: float = Field(0.1, gt=0.0)
    """Length of the edges of the first cell [m]."""
    most_cells: int = Field(14, ge=1, le=256)
    """Cells that a body may have."""
    mutation_rate: float = Field(0.06, gt=0.0, le=1.0)
    """Share of the genes that a mutation changes, on average."""
    mutation_step: float = Field(0.2, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range."""


class CellBody(EvolvingBody):
    """A robot of cells, within the limits of masses, springs and size."""

    settings: CellSettings

    def cells(self, behind: float = -np.inf) -> Cells:
        """An empty body that takes no more cells than the limits allow; see `Cells`."""
        settings = self.settings
        most = min(
            settings.most_cells, (settings.most_masses - 4) // 4, (settings.most_springs - 6) // 22
        )
        return Cells(settings.edge, max(most, 1), settings.largest_extent, behind)

    def robots(self, bodies: Iterable[Cells]) -> list[ws.Robot]:
        """The robots of grown bodies."""
        return [build.robot(body.plan(), self.settings) for body in bodies]


class CellGenes(CellBody, ArrayGenomes):
    """A body of cells whose genome is one row of genes in [0, 1]."""

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes."""
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def shifted(
        self, genomes: np.ndarray, rng: np.random.Generator, redrawn: np.ndarray
    ) -> np.ndarray:
        """Shift some genes of every genome; those that name something are drawn anew instead.

        Args:
            genomes: Shape (n, D).
            rng: Where chance comes from.
            redrawn: Which genes name something, shape (D,), bool.
        """
        chosen = rng.random(genomes.shape, dtype=np.float32) < self.settings.mutation_rate
        shift = rng.standard_normal(genomes.shape, dtype=np.float32)
        moved = folded(genomes + np.float32(self.settings.mutation_step) * shift, self.circular)
        fresh = rng.random(genomes.shape, dtype=np.float32)
        return np.where(chosen, np.where(redrawn, fresh, moved), genomes)

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Mean difference of the genes, in that of unrelated ones, shape (n,)."""
        gap = np.abs(a.astype(np.float64) - b)
        gap = np.where(self.circular, 4.0 * np.minimum(gap, 1.0 - gap), 3.0 * gap)
        return gap.mean(axis=1)


def tissue(genes: Sequence[float], later: float = 0.0) -> Tissue:
    """What five genes make of a cell; one whose swing is below 0.3 is no muscle.

    Args:
        genes: Rest length, swing, phase, stiffness, kind, each in [0, 1].
        later: Added to the phase [cycles].
    """
    rest, swing, phase, stiffness, kind = map(float, genes)
    kinds = (SWELL, BEND, BEND, SWING_SIDEWAYS)
    return Tissue(
        rest=rest,
        swing=swing if swing > 0.3 else 0.0,
        phase=(phase + later) % 1.0,
        stiffness=stiffness,
        kind=kinds[min(int(4.0 * kind), 3)],
    )
