"""Variation: children of chosen parents, by the operators of the encoding."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from evolve.encodings.base import Genomes
from evolve.optimizers.base import NOBODY, Individuals, OptimizerSettings, PopulationOptimizer
from evolve.streams import Role

__all__ = ["VariationSettings", "children"]


class VariationSettings(OptimizerSettings):
    """How children come about."""

    crossover_rate: float = Field(0.7, ge=0.0, le=1.0)
    """Share of the children with two parents; the others have one."""
    mutation_rate: float = Field(0.9, ge=0.0, le=1.0)
    """Share of the children with two parents that mutate; children of one always do."""


def children(
    optimizer: PopulationOptimizer, pool: Individuals, parents: np.ndarray
) -> tuple[Genomes, np.ndarray]:
    """Make a child of every pair of parents: crossed over or not, mutated or not.

    Args:
        optimizer: Whose encoding, streams and settings (`VariationSettings`) are used.
        pool: Where the parents are.
        parents: Their places in the pool, shape (n, 2).

    Returns:
        n genomes, and the ids of their parents, shape (n, 2).
    """
    encoding, streams, generation = optimizer.encoding, optimizer.streams, optimizer.generation
    n, settings = len(parents), optimizer.settings
    crossed = streams(generation, Role.CROSSOVER, 1).random(n) < settings.crossover_rate
    ids = pool.ids[parents]
    ids[~crossed, 1] = NOBODY
    mothers = encoding.take(pool.genomes, parents[:, 0])
    fathers = encoding.take(pool.genomes, parents[:, 1])
    both = encoding.cross(mothers, fathers, streams(generation, Role.CROSSOVER))
    young = encoding.take(encoding.concatenate([mothers, both]), np.arange(n) + n * crossed)
    mutants = encoding.mutate(young, streams(generation, Role.MUTATION))
    coins = streams(generation, Role.MUTATION, 1).random(n)
    mutated = ~crossed | (coins < settings.mutation_rate)
    return encoding.take(encoding.concatenate([young, mutants]), np.arange(n) + n * mutated), ids
