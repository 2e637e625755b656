"""What an optimizer is: ask for candidates, tell their scores; the bookkeeping of all of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from evolve.encodings.base import Encoding, Genomes
from evolve.judging.scores import Scores
from evolve.streams import Role, Streams

__all__ = [
    "NOBODY",
    "Candidates",
    "Individuals",
    "Optimizer",
    "OptimizerSettings",
    "PopulationOptimizer",
    "Recall",
    "described",
]

NOBODY = -1
"""In place of the id of a parent that does not exist."""


class OptimizerSettings(BaseModel):
    """What an optimizer can be told; each adds its own, and a field `type` with its name."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of the measures that it looks at beside the fitness."""
        return ()

    @property
    def niches(self) -> tuple[str, ...]:
        """Those by which it tells individuals apart, to keep some of each kind."""
        return ()


@dataclass(frozen=True)
class Candidates:
    """Genomes that wait for their scores."""

    ids: np.ndarray
    """Shape (n,), int64: numbered from 1 in the order of asking, unique within a run."""
    genomes: Genomes
    parents: np.ndarray
    """Shape (n, 2), int64: ids of the first and second parent, `NOBODY` where there is none."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True)
class Individuals:
    """Genomes with their scores."""

    ids: np.ndarray
    """Shape (n,), int64."""
    genomes: Genomes
    scores: Scores

    def __len__(self) -> int:
        return len(self.ids)


Recall = Callable[[np.ndarray], Individuals]
"""Ids, shape (n,) -> these individuals, in that order, from the record of a run."""


class Optimizer(ABC):
    """Searches for genomes of high fitness, generation by generation.

    ``candidates = optimizer.ask(n)`` and ``optimizer.tell(candidates, scores)`` in turn. The
    optimizer knows nothing of robots: genomes vary by the operators of the encoding. Everything
    it decides follows from the seed and the scores it was told, so ``state()`` plus the record of
    the run suffice to continue with the same bits.

    Attributes:
        generation: How often scores were told.
        turn: Which generation is asked for.
        evaluations: How many scores were told.
        failures: How many of them were without fitness.
        best_id: Id of the best individual so far, `NOBODY` while nobody has a fitness. Of equals,
            the first.
        best_fitness: Its fitness; NaN while nobody has one.
    """

    Settings: ClassVar[type[OptimizerSettings]]

    @property
    def ahead(self) -> int:
        """How many generations may be asked for before the scores of the first are told."""
        return 0

    def __init__(self, encoding: Encoding, streams: Streams, settings: OptimizerSettings) -> None:
        self.encoding = encoding
        self.streams = streams
        self.settings = settings
        self.generation = 0
        self.turn = 0
        self.evaluations = 0
        self.failures = 0
        self.best_id = NOBODY
        self.best_fitness = float("nan")

    def ask(self, n: int, waiting: Sequence[Candidates] = ()) -> Candidates:
        """Make n candidates (n >= 1).

        Args:
            n: How many.
            waiting: Candidates that were asked for and will be told before these; none for an
                optimizer that learns from each generation before the next (`ahead` = 0).
        """
        if n < 1:
            raise ValueError(f"an optimizer is asked for at least one candidate, not {n}")
        self.turn = self.generation + len(waiting)
        genomes, parents = self._ask(n)
        first = self.evaluations + sum(map(len, waiting)) + 1
        ids = first + np.arange(n, dtype=np.int64)
        return Candidates(ids, genomes, np.asarray(parents, dtype=np.int64))

    def tell(self, candidates: Candidates, scores: Scores) -> None:
        """Take the scores of the candidates and pass to the next generation."""
        if len(scores) != len(candidates):
            raise ValueError(f"{len(candidates)} candidates were told {len(scores)} scores")
        worth = scores.worth
        best = int(np.argmax(worth))
        if worth[best] > (-np.inf if np.isnan(self.best_fitness) else self.best_fitness):
            self.best_id = int(candidates.ids[best])
            self.best_fitness = float(worth[best])
        self._tell(Individuals(candidates.ids, candidates.genomes, scores))
        self.generation += 1
        self.evaluations += len(candidates)
        self.failures += int(np.count_nonzero(np.isneginf(worth)))

    def state(self) -> dict[str, np.ndarray]:
        """What a resumed run must be given back, as plain arrays: name -> array."""
        counters = [self.generation, self.evaluations, self.failures, self.best_id]
        return {
            "counters": np.array(counters, dtype=np.int64),
            "best_fitness": np.array([self.best_fitness]),
            **self._state(),
        }

    def restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        """Return to a state; `recall` finds the individuals whose ids the state contains."""
        counters = (int(x) for x in state["counters"])
        self.generation, self.evaluations, self.failures, self.best_id = counters
        self.best_fitness = float(state["best_fitness"][0])
        self._restore(state, recall)

    @abstractmethod
    def _ask(self, n: int) -> tuple[Genomes, np.ndarray]:
        """Return n genomes and the ids of their parents, shape (n, 2)."""

    @abstractmethod
    def _tell(self, individuals: Individuals) -> None:
        """Learn from the scores of what was asked."""

    @abstractmethod
    def _state(self) -> dict[str, np.ndarray]:
        """What this optimizer knows beyond the counters."""

    @abstractmethod
    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        """Take back what `_state` returned."""

    def _take(self, individuals: Individuals, indices: np.ndarray) -> Individuals:
        """The individuals at `indices`, in that order."""
        genomes, encoding = individuals.genomes, self.encoding
        if isinstance(genomes, _Two):
            taken = genomes.taken(encoding, indices)
        else:
            taken = encoding.take(genomes, indices)
        return Individuals(individuals.ids[indices], taken, individuals.scores.take(indices))

    def _joined(self, old: Individuals, new: Individuals) -> Individuals:
        """One group from two, to `_take` from: their genomes stay where they are till then."""
        return Individuals(
            np.concatenate([old.ids, new.ids]),
            _Two(old.genomes, new.genomes),
            Scores.concatenate([old.scores, new.scores]),
        )


@dataclass(frozen=True)
class _Two:
    """Two populations, end to end."""

    first: Genomes
    second: Genomes

    def taken(self, encoding: Encoding, indices: np.ndarray) -> Genomes:
        """The genomes at `indices`, in that order."""
        of_second = indices >= len(self.first)
        parts = [
            (self.first, ~of_second, indices),
            (self.second, of_second, indices - len(self.first)),
        ]
        # First as if all were of the part that most are of.
        parts.sort(key=lambda part: -np.count_nonzero(part[1]))
        (most, mine, place), (others, theirs, whence) = parts
        found = encoding.take(most, np.where(mine, place, 0))
        rows = np.flatnonzero(theirs)
        if len(rows):
            encoding.overwrite(found, rows, others, whence[rows])
        return found


def described(scores: Scores, names: Sequence[str]) -> np.ndarray:
    """Some descriptors of n individuals, shape (n, len(names)).

    Raises:
        ValueError: There is no such descriptor.
    """
    known = scores.descriptors
    for name in names:
        if name not in known:
            raise ValueError(f"descriptor {name!r}: there is none; there are {', '.join(known)}")
    return np.stack([known[name] for name in names], axis=1)


class PopulationOptimizer(Optimizer):
    """An optimizer whose whole knowledge is a group of surviving individuals."""

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        self._survivors: Individuals | None = None

    def _newcomers(self, n: int) -> tuple[Genomes, np.ndarray]:
        """Unrelated genomes without parents, as `_ask` returns them."""
        rng = self.streams(self.turn, Role.INITIAL)
        return self.encoding.random(n, rng), np.full((n, 2), NOBODY)

    def _state(self) -> dict[str, np.ndarray]:
        ids = [] if self._survivors is None else self._survivors.ids
        return {"survivors": np.array(ids, dtype=np.int64)}

    def _restore(self, state: Mapping[str, np.ndarray], recall: Recall) -> None:
        ids = state["survivors"]
        self._survivors = recall(ids) if len(ids) else None
