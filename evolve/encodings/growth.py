"""Growth: a genome is a local rule, by which a body grows cell by cell before its trial."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.bodies.growth import INPUTS, Bud, Light, Wish, grow
from evolve.encodings.base import EncodingSettings, folded
from evolve.encodings.cellular import STIFFNESS, TISSUE, CellGenes, CellSettings, tissue
from evolve.encodings.evolving import PacedSettings

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.bodies.cells import Cells

__all__ = ["GrowingBody", "GrowthEncoding", "GrowthSettings", "GrowthSettingsBase"]

Triple = tuple[float, float, float]

OUTPUTS = ("urge", "length", "up", "away", "taper", "state", "twin")
"""What a rule says of a bud, each from -1 to 1; the tissue of the cell follows."""
LARGEST = 3.0
"""Largest weight of a rule."""
STRONGEST_TURN = 0.7
"""[rad]"""


class GrowthSettingsBase(PacedSettings, CellSettings):
    """How much may grow, and how large the rule is."""

    material: float = Field(12.0, gt=0.0)
    """Sum of the lengths of all cells but the first that a body may have [edges]."""
    least_cells: int = Field(4, ge=1)
    """Cells up to which a body grows even if its rule wants no more."""
    hidden: int = Field(6, ge=1, le=64)
    """Hidden neurons of the rule."""
    mutation_rate: float = Field(0.04, gt=0.0, le=1.0)
    """Share of the weights that a mutation changes, on average: each is felt in all cells."""
    mutation_step: float = Field(0.1, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range."""


class GrowthSettings(GrowthSettingsBase):
    """Where the light is towards which a body grows before its trial."""

    type: Literal["growth"] = "growth"
    lamp: Triple = (1.0, 0.0, 0.5)
    """Where it is, seen from the middle of the first cell's base [m]; x is forward."""
    far: float = Field(1.0, gt=0.0)
    """Distance at which its light is half as bright [m]."""


class GrowingBody(CellGenes):
    """A rule of growth: the weights of a small network, and the tissue of the first cell.

    At each side of each cell the network senses the light, how the side is turned, how far the
    cell is from the first, and what that cell was told; it says whether a cell is to grow there,
    how strongly, what of, and what it is told. The strongest wish of the whole body comes first.
    """

    settings: GrowthSettingsBase

    def __init__(self, body: None, settings: GrowthSettingsBase) -> None:
        self.settings = settings
        into = (settings.hidden, INPUTS)
        out = (len(OUTPUTS) + TISSUE, settings.hidden + 1)
        self._shapes = (into, out)
        self._sizes = np.cumsum([int(np.prod(into)), int(np.prod(out))])
        self.genome_shape = (int(self._sizes[-1]) + TISSUE + self.own_genes,)
        row = (np.arange(self.genome_shape[0]) - self._sizes[0]) // out[1]
        self._behaviour = (row == OUTPUTS.index("twin")) | (row >= len(OUTPUTS))

    own_genes: ClassVar[int] = 0
    """Genes that follow those of the rule and of the first cell."""

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift some weights of every rule, one at least that says what cells are made of."""
        mutants = self.shifted(genomes, rng, np.zeros(genomes.shape[1], bool))
        return self.paced(genomes, self._stiffened(mutants, rng), rng)

    def tune(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift what rules say of tissues and of when they move, not where cells grow."""
        mutants = self.shifted(genomes, rng, np.zeros(genomes.shape[1], bool))
        return self._stiffened(np.where(self._behaviour, mutants, genomes), rng)

    def _stiffened(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """With the stiffness of the first cell, and of all others, shifted."""
        genomes = genomes.copy()
        first = int(self._sizes[-1]) + STIFFNESS
        others = int(self._sizes[-1]) - (TISSUE - STIFFNESS - 1) * self._shapes[1][1] - 1
        for gene in (first, others):
            shift = 0.5 * self.settings.mutation_step * rng.standard_normal(len(genomes))
            genomes[:, gene] = folded(genomes[:, gene] + shift)
        return genomes

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every neuron of the rule, with its weights, from a[i] or from b[i]."""
        into, out = self._shapes
        rest = self.genome_shape[0] - int(self._sizes[-1])
        groups = np.concatenate([
            np.repeat(np.arange(into[0]), into[1]),
            into[0] + np.repeat(np.arange(out[0]), out[1]),
            into[0] + out[0] + np.arange(rest),
        ])  # fmt: skip
        coins = rng.random((len(a), groups[-1] + 1)) < 0.5
        return np.where(coins[:, groups], b, a)

    def grown(
        self, genome: np.ndarray, light: Light, material: float, behind: float = -np.inf
    ) -> Cells:
        """The cells of one genome's body: see `grow`, and `Cells` for how far `behind`."""
        genes = np.asarray(genome, np.float64)
        first = tissue(genes[self._sizes[-1] :][:TISSUE])
        rule = self._rule(genes)
        settings = self.settings
        return grow(self.cells(behind), first, rule, light, settings.material, settings.least_cells)

    def _rule(self, genes: np.ndarray):
        """What buds want, by the network of one genome."""
        weights = LARGEST * (2.0 * genes - 1.0)
        into, out = (
            part.reshape(shape)
            for part, shape in zip(np.split(weights, self._sizes)[:2], self._shapes, strict=True)
        )

        def rule(buds: list[Bud]) -> list[Wish]:
            senses = np.stack([bud.senses for bud in buds])
            # Written out: the order of a matrix product's sums is not the same everywhere.
            hidden = np.tanh((into[None] * senses[:, None]).sum(axis=2))
            seen = np.concatenate([hidden, np.ones((len(buds), 1))], axis=1)
            said = np.tanh((out[None] * seen[:, None]).sum(axis=2))
            return [_wish(bud, row) for bud, row in zip(buds, said.tolist(), strict=True)]

        return rule


def _wish(bud: Bud, said: list[float]) -> Wish:
    """What a network's outputs want at a bud."""
    urge, length, up, away, taper, state, twin = said[: len(OUTPUTS)]
    rest, swing, delay, stiffness, kind = said[len(OUTPUTS) :]
    # What is on the right may breathe later than what is on the left.
    later = 0.5 * delay + (0.5 * twin if bud.aside < 0.0 else 0.0)
    genes = (0.5 + 0.5 * value for value in (rest, swing, 2.0 * bud.phase - 1.0, stiffness, kind))
    return Wish(
        urge=urge,
        tissue=tissue(tuple(genes), later),
        length=1.0 + 0.4 * length,
        turn=(STRONGEST_TURN * up, STRONGEST_TURN * away),
        taper=0.9 + 0.15 * taper,
        state=state,
    )


class GrowthEncoding(GrowingBody):
    """A body grows towards a lamp, by a local rule and with a budget of material, then it moves."""

    Settings: ClassVar[type[EncodingSettings]] = GrowthSettings
    settings: GrowthSettings

    def body(self, genome: np.ndarray) -> Cells:
        """The cells of one genome's body."""
        settings = self.settings
        return self.grown(genome, Light(settings.lamp, settings.far), settings.material)

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the robots."""
        return self.robots(self.body(genome) for genome in genomes)
