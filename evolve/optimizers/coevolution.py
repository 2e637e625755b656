"""Coevolution: robots that get faster, and hills that get harder for them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding, Genomes
from evolve.optimizers.base import NOBODY, Individuals, Optimizer, OptimizerSettings, Recall
from evolve.streams import Role, Streams

__all__ = ["Coevolution", "CoevolutionSettings"]


class CoevolutionSettings(OptimizerSettings):
    """How the two populations meet."""

    type: Literal["coevolution"] = "coevolution"
    opponents: int = Field(4, ge=1)
    """Hills that each robot meets in a generation; the population counts meetings."""
    hills: int = Field(8, ge=1)
    """Hills in their population."""
    elites: float = Field(0.25, ge=0.0, lt=1.0)
    """Share of each population that lives on, to meet the other's new generation."""
    tournament: int = Field(3, ge=1)
    """How many compete to become a parent."""


class Coevolution(Optimizer):
    """Two populations, for the encoding `arena`; an individual is a meeting of the two.

    A robot is worth the mean fitness of its meetings; hills are worth what the robots lacked on
    them, minus the mean. Both breed by tournament, crossover and mutation, and keep an elite, which
    meets the new generation of the other. A meeting that stopped the robot costs the robot its
    worth and gains the hills nothing.
    """

    Settings: ClassVar[type[OptimizerSettings]] = CoevolutionSettings

    settings: CoevolutionSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        if not hasattr(encoding, "split"):
            raise ValueError("coevolution: needs two populations in a genome, encoding 'arena'")
        self._pools: list[Individuals] = []  # of robots and of hills: a meeting of each
        self._worths: list[np.ndarray] = []

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        settings, rng = self.settings, self.streams(self.turn, Role.SELECTION)
        robots = -(-n // settings.opponents)
        genes, parents = zip(
            *(self._brood(side, count) for side, count in enumerate((robots, settings.hills))),
            strict=True,
        )
        robot = np.arange(n) // settings.opponents
        # Each robot meets different hills, all hills equally many robots.
        shuffled = np.concatenate(
            [rng.permutation(settings.hills) for _ in range(-(-n // settings.hills))]
        )
        hill = shuffled[:n]
        met = self.encoding.joined(genes[0][robot], genes[1][hill])
        return met, np.stack([parents[0][robot], parents[1][hill]], axis=1)

    def _brood(self, side: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Genes of a new generation of robots (side 0) or hills (1), and a parent of each."""
        rng = self.streams(self.turn, Role.INITIAL, side)
        if not self._pools:
            return self.encoding.split(self.encoding.random(count, rng))[side], np.full(
                count, NOBODY
            )
        pool, size = self._pools[side], len(self._pools[side])
        elite = np.arange(min(round(self.settings.elites * count), size))
        drawn = rng.integers(size, size=(2, count - len(elite), self.settings.tournament))
        a, b = drawn.min(axis=2)  # sorted, the best first
        mother, father = (self.encoding.take(pool.genomes, which) for which in (a, b))
        cross = self.streams(self.turn, Role.CROSSOVER, side)
        mutate = self.streams(self.turn, Role.MUTATION, side)
        young = self.encoding.mutate(self.encoding.cross(mother, father, cross), mutate)
        old = self.encoding.take(pool.genomes, elite)
        genes = self.encoding.split(np.concatenate([old, young]))[side]
        return genes, pool.ids[np.concatenate([elite, a])]

    def _tell(self, individuals: Individuals) -> None:
        self._pools, self._worths = [], []
        worth = individuals.scores.worth
        for side, sign in enumerate((1.0, -1.0)):
            genes = self.encoding.split(individuals.genomes)[side]
            _, first, kind = np.unique(genes, axis=0, return_index=True, return_inverse=True)
            kind = kind.ravel()
            met = np.bincount(kind)
            good = np.isfinite(worth)
            sums = np.bincount(kind, np.where(good, worth, 0.0))
            healthy = np.bincount(kind, good)
            mean = np.where(
                healthy == met if side == 0 else healthy > 0, sums / np.maximum(healthy, 1), np.nan
            )
            value = np.where(np.isnan(mean), -np.inf, sign * mean)
            best = np.lexsort((first, -value))
            self._pools.append(self._take(individuals, first[best]))
            self._worths.append(value[best])

    @property
    def worths(self) -> tuple[np.ndarray, np.ndarray]:
        """What the last generation of robots and of hills was worth, the best first."""
        return tuple(self._worths) if self._worths else (np.zeros(0), np.zeros(0))

    def _state(self) -> dict[str, np.ndarray]:
        state = {}
        for name, pool, worth in zip(("robots", "hills"), self._pools, self._worths, strict=False):
            state |= {name: pool.ids, f"{name}_worth": worth}
        return state

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        names = [name for name in ("robots", "hills") if name in state]
        self._pools = [recall(state[name]) for name in names]
        self._worths = [state[f"{name}_worth"] for name in names]
