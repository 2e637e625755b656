"""Graph grammars: a genome is a derivation, the rules that make a robot out of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from evolve.bodies.derivation import Tree, derive
from evolve.bodies.graph_grammar import Grammar, load_grammar
from evolve.bodies.limbs import GENES, PHASES, build
from evolve.encodings.base import EncodingSettings, folded
from evolve.encodings.cellular import CellGenes, CellSettings
from evolve.encodings.evolving import PacedSettings

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.bodies.cells import Cells

__all__ = ["GrammarEncoding", "GrammarSettings"]

RULE, PLACE = 0, 1
"""Genes of a step: which rule, and where; then those of the parts that it makes."""
STEP = 2 + len(GENES)
SHIFTED = tuple(2 + GENES.index(name) for name in ("size", "stiffness"))
"""Genes that are seen in every part."""
STIFFNESS = 2 + GENES.index("stiffness")
BEHAVIOUR = (*PHASES, "swing", "stiffness")
"""Genes that leave the shape of a part as it is."""
PARTS_PER_CELL = 2
"""Parts that a tree may have for each cell of a body: some build none, some build several."""


class GrammarSettings(PacedSettings, CellSettings):
    """Which rules there are, and how many of them make a robot."""

    type: Literal["grammar"] = "grammar"
    grammar: str = "legged"
    """Name of a packaged grammar, or a file of your own, .toml or .json; its rules are kept in
    run.toml then."""
    rules: Grammar | None = None
    """The rules themselves, instead of the packaged ones."""
    most_steps: int = Field(14, ge=1, le=128)
    """Rules that are applied, at most."""
    most_cells: int = Field(20, ge=1, le=256)
    """Cells that a body may have."""
    most_masses: int = Field(96, ge=4)
    """Points that a body may have."""
    most_springs: int = Field(480, ge=6)
    """Springs that a body may have."""

    @model_validator(mode="before")
    @classmethod
    def _keeps_a_file(cls, data: Any, info: ValidationInfo) -> Any:
        if isinstance(data, Mapping) and data.get("rules") is None:
            name = data.get("grammar")
            if isinstance(name, str) and Path(name).suffix in (".toml", ".json"):
                folder = (info.context or {}).get("folder")
                return {**data, "rules": load_grammar(name, folder), "grammar": Path(name).stem}
        return data

    @model_validator(mode="after")
    def _exists(self) -> GrammarSettings:
        self.loaded()
        return self

    def loaded(self) -> Grammar:
        """The rules."""
        return self.rules or load_grammar(self.grammar)


class GrammarEncoding(CellGenes):
    """A genome is a derivation of a graph grammar, (steps, 10): rules, places, genes of parts.

    The gene of a rule chooses among those that apply when its turn comes, so every genome makes a
    robot. The genes of a step say how the parts that it makes are long, turned and stiff, and how
    far and when they move; a mirrored limb moves as its twin does, by a gene of its own later.
    """

    Settings: ClassVar[type[EncodingSettings]] = GrammarSettings
    settings: GrammarSettings

    def __init__(self, body: None, settings: GrammarSettings) -> None:
        self.settings, self.grammar = settings, settings.loaded()
        self.genome_shape = (settings.most_steps, STEP)
        self.circular = np.array([False, False, *(name in PHASES for name in GENES)])
        self._named = np.arange(STEP) <= PLACE
        self._behaviour = np.array([False, False, *(name in BEHAVIOUR for name in GENES)])

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change some genes, a part that is there at least; at times insert or delete a step."""
        mutants = self.shifted(genomes, rng, self._named)
        for row, genome in enumerate(mutants):
            _, used = self.derivation(genome)
            for step in (0, rng.integers(max(used, 1))):  # the first is sure to make a part
                gene = SHIFTED[rng.integers(len(SHIFTED))]
                genome[step, gene] += self.settings.mutation_step * rng.standard_normal()
            if rng.random() < 0.25:
                _moved_on(genome, int(rng.integers(max(used, 1))), rng)
            mutants[row] = folded(genome, self.circular)
        return self.paced(genomes, mutants, rng)

    def tune(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change when and how far parts move and how stiff they are, two that are there too."""
        mutants = self.shifted(genomes, rng, self._named)
        mutants = np.where(self._behaviour, mutants, genomes)
        for row, genome in enumerate(mutants):
            _, used = self.derivation(genome)
            for step in (0, rng.integers(max(used, 1))):
                genome[step, STIFFNESS] += self.settings.mutation_step * rng.standard_normal()
            mutants[row] = folded(genome, self.circular)
        return mutants

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take the first steps from a[i] and the others from b[i], or the genes of parts of each.

        Where the rules and places stay those of one parent, the body does too.
        """
        n, steps = len(a), self.genome_shape[0]
        late = np.arange(steps) >= rng.integers(1, steps + 1, size=(n, 1))
        coins = rng.random((n, steps)) < 0.5
        whole = rng.random((n, 1)) < 0.5
        theirs = np.repeat(np.where(whole, late, coins)[:, :, None], STEP, axis=2)
        theirs[:, :, self._named] &= whole[:, :, None]
        return np.where(theirs, b, a)

    def derivation(self, genome: np.ndarray) -> tuple[Tree, int]:
        """The parts of one genome's robot, and how many of its steps made them."""
        rows = np.asarray(genome, np.float64).tolist()
        steps = ((row[RULE], row[PLACE], tuple(row[2:])) for row in rows)
        return derive(self.grammar, steps, PARTS_PER_CELL * self.settings.most_cells)

    def body(self, genome: np.ndarray) -> Cells:
        """The cells of one genome's robot."""
        return build(self.derivation(genome)[0], self.grammar, self.cells())

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the robots."""
        return self.robots(self.body(genome) for genome in genomes)


def _moved_on(steps: np.ndarray, place: int, rng: np.random.Generator) -> None:
    """Insert a step into a derivation, (S, 10), in place; or delete one."""
    if rng.random() < 0.5:
        steps[place + 1 :] = steps[place:-1].copy()
        steps[place] = rng.random(STEP)
    else:
        steps[place:-1] = steps[place + 1 :].copy()
        steps[-1] = rng.random(STEP)
