"""Judging genomes: who simulates them, and that nobody is simulated twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Protocol

import numpy as np

from evolve.encodings.base import Encoding, Genomes
from evolve.judging.scores import Scores
from evolve.judging.worlds import judged

if TYPE_CHECKING:
    from evolve.config import RunConfig

__all__ = ["Here", "Judge", "Simulator", "Ticket"]


Ticket = Callable[[], Scores]
"""Waits for the scores of what was submitted, and returns them; may be called more than once."""


class Simulator(Protocol):
    """Whoever simulates genomes: this process, other processes, other machines."""

    def submit(self, genomes: Genomes, blobs: Sequence[bytes]) -> Ticket:
        """Begin to simulate n genomes, given both as such and as their bytes."""

    def prepare(self, genomes: Genomes, blobs: Sequence[bytes]) -> None:
        """Load the kernels for such genomes, everywhere."""

    def close(self) -> None:
        """End whatever was started."""


class Here:
    """Simulates genomes in this process, when the scores are waited for."""

    def __init__(self, config: RunConfig, encoding: Encoding) -> None:
        from evolve.judging.evaluate import Evaluator

        self._evaluator, self._encoding = Evaluator(config), encoding

    def submit(self, genomes: Genomes, blobs: Sequence[bytes]) -> Ticket:
        """The scores are computed the first time that somebody waits for them."""
        return cache(lambda: judged(self._evaluator, self._encoding, genomes))

    def prepare(self, genomes: Genomes, blobs: Sequence[bytes]) -> None:
        """Load the kernels for such genomes."""
        self._evaluator.prepare(self._encoding.express(genomes))

    def close(self) -> None:
        """Nothing was started."""


class Judge:
    """What is known of the genomes of a run.

    A trial follows from the genome alone, so a genome that was judged before, in this generation
    or an earlier one, has the same scores again, at no cost.

    Genomes are known by the 64 bits of Python's keyed hash of their bytes, which each bytes object
    computes once: two of a million genomes share them with a chance of one in 37 million.
    """

    def __init__(self) -> None:
        self._rows: dict[int, int] = {}  # which of all scores so far are those of a genome
        self._parts: list[Scores] = []
        self._starts: list[int] = []
        self._count = 0

    def unknown(self, blobs: Sequence[bytes]) -> np.ndarray:
        """Which of some genomes, given by their bytes, must be simulated: their indices."""
        keys = list(map(hash, blobs))
        if len(set(keys)) == len(keys) and self._rows.keys().isdisjoint(keys):
            return np.arange(len(keys))
        # Of equals the first: those before overwrite those behind.
        first = dict(zip(reversed(keys), range(len(keys) - 1, -1, -1), strict=True))
        new = [index for key, index in first.items() if key not in self._rows]
        return np.array(sorted(new), np.intp)

    def learn(self, blobs: Sequence[bytes], scores: Scores) -> None:
        """Take in scores of genomes; of what is known already the first scores stay."""
        self._parts.append(scores)
        self._starts.append(self._count)
        for row, key in enumerate(map(hash, blobs), self._count):
            self._rows.setdefault(key, row)
        self._count += len(blobs)

    def recall(self, blobs: Sequence[bytes], simulated: np.ndarray) -> Scores:
        """Scores of known genomes; all but those at the indices `simulated` cost nothing now."""
        row = np.array([self._rows[key] for key in map(hash, blobs)])
        part = np.searchsorted(self._starts, row, side="right") - 1
        order = np.argsort(part, kind="stable")
        pieces = []
        for p in np.unique(part).tolist():
            mine = row[order[part[order] == p]] - self._starts[p]
            pieces.append(self._parts[p].take(mine))
        scores = Scores.concatenate(pieces).take(np.argsort(order, kind="stable"))
        cost = np.zeros_like(scores.spring_evaluations)
        cost[simulated] = scores.spring_evaluations[simulated]
        return replace(scores, spring_evaluations=cost)
