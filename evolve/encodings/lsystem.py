"""L-systems: genomes are rules by which a short string grows into the blueprint of a body."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.bodies.lsystem import CLOSE, OPEN, PITCH, ROLL, TWIN, YAW, Module, Production, rewrite
from evolve.bodies.lsystem import build as walk
from evolve.encodings.base import EncodingSettings, folded
from evolve.encodings.cellular import PHASE, STIFFNESS, TISSUE, CellGenes, CellSettings, tissue
from evolve.encodings.evolving import PacedSettings

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.bodies.cells import Cells

__all__ = ["LsystemEncoding", "LsystemSettings"]

GROWING, RESTING = "ABCD", "EF"
"""Cells that are rewritten, and cells that stay as they are."""
NAMES = GROWING + RESTING
NOTHING = ""
ALTERNATIVES = 2
DRAWS = 12
"""Genes that choose among alternatives, in turn."""
MODULE = 4
"""Genes of a module: which symbol, its amount, its phase, its size."""
SYMBOLS = (
    *(NOTHING,) * 3, *NAMES, *NAMES, PITCH, PITCH, PITCH, YAW, ROLL, OPEN, *(TWIN,) * 5, CLOSE,
)  # fmt: skip
"""What the gene of a symbol chooses from, evenly."""


class LsystemSettings(PacedSettings, CellSettings):
    """How long rules are, and how often they are applied."""

    type: Literal["lsystem"] = "lsystem"
    rule_length: int = Field(6, ge=1, le=32)
    """Modules of a right side, at most."""
    most_steps: int = Field(4, ge=1, le=12)
    """Times that all symbols are replaced, at most; a gene says how often."""


class LsystemEncoding(CellGenes):
    """Parametric, stochastic L-systems over six kinds of cells.

    The symbols A to D each have two right sides and a chance of the second; E and F stay. A right
    side has cells, turns, and branches to one side or to a side and its mirror image; a gene of a
    symbol may also choose nothing, so right sides are of any length. Every kind of cell has a
    tissue. The string begins with A. What chance decides among right sides are genes too, so that
    the same genome always makes the same robot.
    """

    Settings: ClassVar[type[EncodingSettings]] = LsystemSettings
    settings: LsystemSettings

    def __init__(self, body: None, settings: LsystemSettings) -> None:
        self.settings = settings
        self._rules = (len(GROWING), ALTERNATIVES, settings.rule_length, MODULE)
        sizes = [int(np.prod(self._rules)), len(NAMES) * TISSUE, len(GROWING), DRAWS, 1]
        self._ends = np.cumsum(sizes)
        self.genome_shape = (int(self._ends[-1]),)
        genes = np.arange(self._ends[-1])
        in_rule = genes < self._ends[0]
        self._named = in_rule & (genes % MODULE == 0)
        in_tissue = ~in_rule & (genes < self._ends[1])
        self._behaviour = in_tissue | (in_rule & (genes % MODULE == 2))
        phases = in_tissue & ((genes - self._ends[0]) % TISSUE == PHASE)
        self.circular = phases | (in_rule & (genes % MODULE == 2))

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes, in which A becomes cells and a branch on either side."""
        genomes = super().random(n, rng)
        rules = genomes[:, : self._ends[0]].reshape(n, *self._rules)
        wanted = [NAMES, TWIN, NAMES]
        for place, symbols in enumerate(wanted[: self.settings.rule_length]):
            choices = [i for i, symbol in enumerate(SYMBOLS) if symbol and symbol in symbols]
            chosen = rng.choice(choices, size=n)
            rules[:, 0, :, place, 0] = ((chosen + 0.5) / len(SYMBOLS))[:, None]
        return genomes

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change some genes, a tissue that the body has at least; at times insert or delete."""
        mutants = self.shifted(genomes, rng, self._named)
        for row, genome in enumerate(genomes):
            self._retuned(mutants[row], genome, rng)
            if rng.random() < 0.3:
                rules = mutants[row, : self._ends[0]].reshape(self._rules)
                self._moved_on(rules[rng.integers(len(rules)), rng.integers(ALTERNATIVES)], rng)
        return self.paced(genomes, mutants, rng)

    def tune(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change tissues, one that the body has at least, and the phases of cells."""
        mutants = self.shifted(genomes, rng, self._named)
        mutants = np.where(self._behaviour, mutants, genomes)
        for mutant, genome in zip(mutants, genomes, strict=True):
            self._retuned(mutant, genome, rng)
        return mutants

    def _retuned(self, mutant: np.ndarray, genome: np.ndarray, rng: np.random.Generator) -> None:
        """Shift phase and stiffness of tissues that the body of a genome has, in place."""
        used = [m.symbol for m in self.string(genome) if m.symbol in NAMES][:3] or ["A"]
        # Only muscles have a phase, and only the first cell is sure to fit.
        some = NAMES.index(used[rng.integers(len(used))]), NAMES.index(used[0])
        gene = self._ends[0] + np.array(some) * TISSUE + [PHASE, STIFFNESS]
        shift = 0.5 * self.settings.mutation_step * rng.standard_normal(2)
        mutant[gene] = folded(mutant[gene] + shift, np.array([True, False]))

    def _moved_on(self, modules: np.ndarray, rng: np.random.Generator) -> None:
        """Insert a module into a right side, (L, 4), in place; or delete one."""
        place = rng.integers(len(modules))
        if rng.random() < 0.5:
            modules[place + 1 :] = modules[place:-1].copy()
            modules[place] = rng.random(MODULE)
        else:
            modules[place:-1] = modules[place + 1 :].copy()
            modules[-1, 0] = 0.0

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take the right sides and the tissue of every symbol from a[i] or from b[i]."""
        n, (rules, tissues, *_) = len(a), self._ends
        coins = rng.random((n, len(NAMES) + 1)) < 0.5
        each = int(np.prod(self._rules[1:]))
        theirs = np.repeat(coins[:, [-1]], self.genome_shape[0], axis=1)
        theirs[:, :rules] = np.repeat(coins[:, : len(GROWING)], each, axis=1)
        theirs[:, rules:tissues] = np.repeat(coins[:, : len(NAMES)], TISSUE, axis=1)
        return np.where(theirs, b, a)

    def productions(self, genome: np.ndarray) -> dict[str, Production]:
        """The rules of one genome: symbol -> what it becomes."""
        rules = genome[: self._ends[0]].reshape(self._rules).tolist()
        chances = genome[self._ends[1] : self._ends[2]].tolist()
        return {
            name: Production(
                (1.0 - chance, chance), tuple(tuple(_modules(side)) for side in alternatives)
            )
            for name, alternatives, chance in zip(GROWING, rules, chances, strict=True)
        }

    def string(self, genome: np.ndarray) -> list[Module]:
        """The blueprint into which the rules of one genome let A grow."""
        draws = cycle(genome[self._ends[2] : self._ends[3]].tolist())
        steps = 1 + min(int(genome[-1] * self.settings.most_steps), self.settings.most_steps - 1)
        productions = self.productions(genome)
        return rewrite([Module("A")], productions, steps, lambda: min(next(draws), 1.0 - 1e-9))

    def body(self, genome: np.ndarray) -> Cells:
        """The cells that the turtle builds along the blueprint of one genome."""
        genes = genome[self._ends[0] : self._ends[1]].reshape(len(NAMES), TISSUE)
        tissues = {name: tissue(row) for name, row in zip(NAMES, genes, strict=True)}
        return walk(self.string(genome), tissues, self.cells())

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the robots."""
        return self.robots(self.body(genome) for genome in np.asarray(genomes, np.float64))


def _modules(genes: list[list[float]]) -> list[Module]:
    """The right side that genes (L, 4) describe."""
    modules = []
    for name, amount, phase, size in genes:
        symbol = SYMBOLS[min(int(name * len(SYMBOLS)), len(SYMBOLS) - 1)]
        if symbol == NOTHING:
            continue
        if symbol in (OPEN, TWIN):
            # Left and right are the sides of limbs.
            sides = (1, 3) if symbol == TWIN else (0, 1, 2, 3)
            amount = sides[min(int(amount * len(sides)), len(sides) - 1)]
        else:
            amount = 2.0 * amount - 1.0
        modules.append(Module(symbol, phase, 0.8 + 0.5 * size, amount))
    return modules
