"""Speciation: individuals compete with those that resemble them, so that new kinds get time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import Encoding
from evolve.optimizers.base import Individuals, OptimizerSettings, Recall
from evolve.optimizers.selection import order, select
from evolve.optimizers.variation import Breeder, BreedingSettings
from evolve.streams import Role, Streams

__all__ = ["Speciation", "SpeciationSettings"]

STEP = 1.15
"""Factor by which the radius of a species changes where there are too many or too few."""


class SpeciationSettings(BreedingSettings):
    """How many species there are, and how long each may go without progress."""

    type: Literal["speciation"] = "speciation"
    species: int = Field(8, ge=1)
    """How many there should be; their radius grows while there are more and shrinks while there
    are fewer."""
    radius: float = Field(0.3, gt=0.0)
    """Distance of genomes within which an individual belongs to a species, at first: 0 is equal,
    about 1 unrelated."""
    patience: int = Field(15, ge=1)
    """Generations without a new best after which a species dies out, unless it has the best of
    all."""
    tournament: int = Field(3, ge=1)
    """How many individuals of a species compete to become a parent; 1 = no preference. For
    "tournament"."""


class Speciation(Breeder):
    """Niches by the distance of genomes, with shared fitness (Stanley and Miikkulainen 2002).

    An individual belongs to the first species whose representative, its best so far, is within the
    radius; otherwise it founds one. Everybody's fitness, counted from the worst, is divided by the
    size of its species; species get children, and places among the survivors, by the sum of that.
    Parents are of one species.
    """

    Settings: ClassVar[type[OptimizerSettings]] = SpeciationSettings

    settings: SpeciationSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        self.radius = settings.radius
        """Distance within which an individual belongs to a species."""
        self._sizes = np.zeros(0, np.int64)  # survivors of each species, one species after another
        self._bests = np.zeros(0)
        self._stale = np.zeros(0, np.int64)  # generations since each had a new best
        self._shares = np.zeros(0)

    @property
    def sizes(self) -> np.ndarray:
        """Survivors of each species, the oldest species first."""
        return self._sizes

    def _parents(self, n: int) -> np.ndarray:
        rng = self.streams(self.turn, Role.SELECTION)
        broods = _portions(self._shares, n)
        return np.concatenate(
            [
                first + select(self.settings, int(size), (int(count), 2), rng)
                for first, size, count in zip(self._heads, self._sizes, broods, strict=True)
                if count
            ]
        )

    def _tell(self, individuals: Individuals) -> None:
        pool, n = individuals, len(individuals)
        if self._survivors is not None:
            pool = self._joined(self._survivors, individuals)
        species, count = self._sorted_into_species(pool)
        worth = pool.scores.worth
        bests = np.full(count, -np.inf)
        np.maximum.at(bests, species, worth)
        old = len(self._bests)
        progress = np.append(bests[:old] > self._bests, np.ones(count - old, bool))
        stale = np.where(progress, 0, np.append(self._stale, np.zeros(count - old, int)) + 1)
        shares = self._shared_fitness(worth, species, count)
        exhausted = (stale > self.settings.patience) & (bests < bests.max())
        places = _portions(np.where(exhausted, 0.0, shares), n)
        best_first = order(pool)
        members = [best_first[species[best_first] == s] for s in range(count)]
        kept = [mine[:most] for mine, most in zip(members, places, strict=True)]
        alive = np.array([len(mine) > 0 for mine in kept])
        self._survivors = self._take(pool, np.concatenate(kept))
        self._sizes = np.array([len(mine) for mine in kept])[alive]
        self._bests, self._stale, self._shares = bests[alive], stale[alive], shares[alive]
        living, wanted = int(alive.sum()), self.settings.species
        if living != wanted:
            self.radius *= STEP if living > wanted else 1.0 / STEP

    def _sorted_into_species(self, pool: Individuals) -> tuple[np.ndarray, int]:
        """Which species each of a pool belongs to, the survivors first, (n,), and how many are.

        Species that came to lie within the radius of an older one are left without members.
        """
        species, heads = np.full(len(pool), -1), self._heads.tolist()
        for number, head in enumerate(heads):
            if species[head] < 0:
                free = np.flatnonzero(species < 0)
                species[free[self._near(pool, head, free)]] = number
        count, free = len(heads), np.flatnonzero(species < 0)
        while len(free):
            species[free[self._near(pool, int(free[0]), free)]] = count
            count, free = count + 1, np.flatnonzero(species < 0)
        return species, count

    @property
    def _heads(self) -> np.ndarray:
        """Places of the best of each species among the survivors."""
        return np.cumsum(self._sizes) - self._sizes

    def _near(self, pool: Individuals, head: int, others: np.ndarray) -> np.ndarray:
        """Which of some places in the pool are within the radius of one, (k,) bool."""
        genomes = self._take(pool, others).genomes
        same = self._take(pool, np.full(len(others), head)).genomes
        return (self.encoding.distance(same, genomes) <= self.radius) | (others == head)

    def _shared_fitness(self, worth: np.ndarray, species: np.ndarray, count: int) -> np.ndarray:
        """Sum over each species of its members' fitness divided by its size, shape (count,)."""
        good = np.isfinite(worth)
        if not good.any():
            return np.ones(count)
        low, high = worth[good].min(), worth[good].max()
        # The worst of all still counts a little, so that a species of it alone has its chance.
        above = np.where(good, worth - low + 0.05 * max(high - low, 1e-12), 0.0)
        sizes = np.bincount(species, minlength=count)
        return np.bincount(species, above, minlength=count) / np.maximum(sizes, 1)

    def _state(self) -> dict[str, np.ndarray]:
        return {
            **super()._state(),
            "radius": np.array([self.radius]),
            "sizes": np.asarray(self._sizes, np.int64),
            "bests": self._bests,
            "stale": np.asarray(self._stale, np.int64),
            "shares": self._shares,
        }

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        super()._restore(state, recall)
        self.radius = float(state["radius"][0])
        self._sizes, self._bests = np.array(state["sizes"]), np.array(state["bests"])
        self._stale, self._shares = np.array(state["stale"]), np.array(state["shares"])


def _portions(shares: np.ndarray, n: int) -> np.ndarray:
    """n places divided in proportion to shares (S,), by largest remainder: whole numbers (S,)."""
    exact = n * shares / shares.sum()
    found = np.floor(exact).astype(np.int64)
    rest = np.argsort(found - exact, kind="stable")[: n - int(found.sum())]
    found[rest] += 1
    return found
