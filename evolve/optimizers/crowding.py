"""Deterministic crowding: a child competes with the parent that it resembles."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from evolve.encodings.base import Genomes
from evolve.optimizers.base import NOBODY, Individuals, OptimizerSettings, PopulationOptimizer
from evolve.streams import Role

__all__ = ["CrowdingSettings", "DeterministicCrowding"]


class CrowdingSettings(OptimizerSettings):
    """Deterministic crowding has nothing to set."""

    type: Literal["crowding"] = "crowding"


class DeterministicCrowding(PopulationOptimizer):
    """Mahfoud's niching (1995): diverse solutions live on side by side.

    The population is shuffled into pairs; each pair has two children, crossed over and mutated.
    Children and parents are matched so that the sum of their distances is smallest, and a child
    takes the place of its match unless it is worse. Of an odd population the last has one mutant.
    """

    Settings: ClassVar[type[OptimizerSettings]] = CrowdingSettings

    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        if self._survivors is None:
            return self._newcomers(n)
        if n != len(self._survivors):
            raise ValueError(
                f"deterministic crowding of {len(self._survivors)} was asked for {n} candidates"
            )
        encoding, living = self.encoding, self._survivors
        mothers, fathers, lonely = self._couples(n)
        one, two = (encoding.take(living.genomes, parents) for parents in (mothers, fathers))
        rng = self.streams(self.generation, Role.CROSSOVER)
        young = [encoding.cross(one, two, rng), encoding.cross(two, one, rng)]
        ids = np.stack([living.ids[mothers], living.ids[fathers]], axis=1)
        parents = [ids, ids[:, ::-1]]
        if len(lonely):
            young.append(encoding.take(living.genomes, lonely))
            parents.append(np.array([[living.ids[lonely[0]], NOBODY]]))
        rng = self.streams(self.generation, Role.MUTATION)
        return encoding.mutate(encoding.concatenate(young), rng), np.concatenate(parents)

    def _tell(self, individuals: Individuals) -> None:
        if self._survivors is None:
            self._survivors = individuals
            return
        old, n = self._survivors, len(individuals)
        mothers, fathers, lonely = self._couples(n)
        half = len(mothers)
        first, second = np.arange(half), half + np.arange(half)

        def apart(parents: np.ndarray, young: np.ndarray) -> np.ndarray:
            a = self.encoding.take(old.genomes, parents)
            return self.encoding.distance(a, self.encoding.take(individuals.genomes, young))

        straight = apart(mothers, first) + apart(fathers, second)
        swapped = straight > apart(mothers, second) + apart(fathers, first)
        rival = np.empty(n, np.int64)
        rival[mothers] = np.where(swapped, second, first)
        rival[fathers] = np.where(swapped, first, second)
        rival[lonely] = n - 1
        replaced = individuals.scores.worth[rival] >= old.scores.worth
        pool = self._joined(old, individuals)
        self._survivors = self._take(pool, np.where(replaced, n + rival, np.arange(n)))

    def _couples(self, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places of the mothers, of the fathers, and of who is left alone, this generation."""
        shuffled = self.streams(self.generation, Role.SELECTION).permutation(n)
        half = n // 2
        return shuffled[:half], shuffled[half : 2 * half], shuffled[2 * half :]
