"""Coevolution: robots that get faster, and hills that get harder for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
        if not hasattr(encoding, "sides"):
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
        both = (
            side.take(found, which)
            for side, found, which in zip(self.encoding.sides, genes, (robot, hill), strict=True)
        )
        met = self.encoding.joined(*both)
        return met, np.stack([parents[0][robot], parents[1][hill]], axis=1)

    def _brood(self, number: int, count: int) -> tuple[Genomes, np.ndarray]:
        """A new generation of robots (side 0) or hills (1), and a parent of each."""
        side, rng = self.encoding.sides[number], self.streams(self.turn, Role.INITIAL, number)
        if not self._pools:
            return side.random(count, rng), np.full(count, NOBODY)
        pool, size = self._pools[number], len(self._pools[number])
        living = self.encoding.split(pool.genomes)[number]
        elite = np.arange(min(round(self.settings.elites * count), size))
        drawn = rng.integers(size, size=(2, count - len(elite), self.settings.tournament))
        a, b = drawn.min(axis=2)  # sorted, the best first
        cross = self.streams(self.turn, Role.CROSSOVER, number)
        mutate = self.streams(self.turn, Role.MUTATION, number)
        young = side.mutate(side.cross(side.take(living, a), side.take(living, b), cross), mutate)
        genes = side.concatenate([side.take(living, elite), young])
        return genes, pool.ids[np.concatenate([elite, a])]

    def _tell(self, individuals: Individuals) -> None:
        self._pools, self._worths = [], []
        worth = individuals.scores.worth
        genes = self.encoding.split(individuals.genomes)
        for number, sign in enumerate((1.0, -1.0)):
            first, kind = _kinds(self.encoding.sides[number].to_bytes(genes[number]))
            met = np.bincount(kind)
            good = np.isfinite(worth)
            sums = np.bincount(kind, np.where(good, worth, 0.0))
            healthy = np.bincount(kind, good)
            mean = np.where(
                healthy == met if number == 0 else healthy > 0,
                sums / np.maximum(healthy, 1),
                np.nan,
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


def _kinds(blobs: Sequence[bytes]) -> tuple[np.ndarray, np.ndarray]:
    """Where each of K different genomes is first, (K,), and which of them each of n is, (n,)."""
    numbers: dict[bytes, int] = {}
    kind = np.array([numbers.setdefault(blob, len(numbers)) for blob in blobs])
    return np.unique(kind, return_index=True)[1], kind
