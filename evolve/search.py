"""The loop of a search, in memory: ask, judge, tell."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evolve.cluster import Cluster
from evolve.config import RunConfig
from evolve.evaluate import Evaluator
from evolve.judge import Judge, Simulator
from evolve.optimizers.base import Candidates, Individuals
from evolve.pool import Pool
from evolve.scores import Scores
from evolve.store import Store
from evolve.streams import Role, Streams

__all__ = ["Generation", "Search", "judge_together"]


@dataclass(frozen=True)
class Generation:
    """What a generation brought."""

    number: int
    candidates: Candidates
    blobs: Sequence[bytes]
    """The genomes as bytes."""
    scores: Scores
    wall_time: float
    """Seconds it took, evaluation included [s]."""


class Search:
    """Encoding, optimizer and judge of a configuration, and the loop that joins them.

    Args:
        config: What to search for, and how.
        simulator: Who simulates genomes; made from the configuration when left out.
    """

    def __init__(self, config: RunConfig, simulator: Simulator | None = None) -> None:
        self.config = config
        self.encoding = config.make_encoding()
        self.optimizer = config.make_optimizer(self.encoding)
        self._own = simulator is None
        self.simulator = self._make_simulator() if simulator is None else simulator
        self.judge = Judge()
        self.cost, self.seconds = 0, 0.0

    def _make_simulator(self) -> Simulator:
        if self.config.simulation.cluster:
            return Cluster(self.config)
        if self.config.simulation.devices:
            return Pool(self.config)
        evaluator, encoding = Evaluator(self.config), self.encoding
        return lambda genomes, blobs: evaluator(encoding.express(genomes))

    def close(self) -> None:
        """End the workers, if there are any."""
        if self._own and isinstance(self.simulator, (Pool, Cluster)):
            self.simulator.close()

    @property
    def finished(self) -> bool:
        """Whether the generations or the budget of the configuration are used up."""
        optimizer, budget = self.optimizer, self.config.budget
        return (
            optimizer.generation >= self.config.generations
            or optimizer.evaluations >= (budget.evaluations or float("inf"))
            or self.cost >= (budget.spring_evaluations or float("inf"))
            or self.seconds >= (budget.seconds or float("inf"))
        )

    def prepare(self) -> None:
        """Load the kernels, so that the first step takes no longer than the others."""
        genomes = self.encoding.random(self.config.population, Streams(0)(0, Role.INITIAL))
        if isinstance(self.simulator, (Pool, Cluster)):
            self.simulator.prepare(self.encoding.to_bytes(genomes))
        else:
            Evaluator(self.config).prepare(self.encoding.express(genomes))

    def step(self) -> Generation:
        """Search one generation further."""
        return judge_together([self])[0]

    def tell(self, asked: Candidates, blobs: Sequence[bytes], scores: Scores) -> Generation:
        """Take the scores of the candidates that were asked for."""
        number = self.optimizer.generation
        self.optimizer.tell(asked, scores)
        self.cost += int(scores.spring_evaluations.sum())
        return Generation(number, asked, blobs, scores, 0.0)

    def restore(self, store: Store) -> None:
        """Go to where a record ends."""

        def recall(ids) -> Individuals:
            genomes = self.encoding.from_bytes(store.genomes(ids))
            return Individuals(ids, genomes, store.scores(ids))

        if state := store.optimizer_state():
            self.optimizer.restore(state, recall)
            self.cost, evaluating, driving = store.totals()
            self.seconds = evaluating + driving
            for blobs, scores in store.judged():
                self.judge.learn(blobs, scores)


def judge_together(searches: Sequence[Search]) -> list[Generation]:
    """Search one generation further in each of some searches that differ in their seed alone.

    Their candidates share one batch of the first one's simulator; what each gets to know is the
    same to the bit as if it were alone.
    """
    started = time.perf_counter()
    asked = [search.optimizer.ask(search.config.population) for search in searches]
    blobs = [
        search.encoding.to_bytes(candidates.genomes)
        for search, candidates in zip(searches, asked, strict=True)
    ]
    new = [search.judge.unknown(own) for search, own in zip(searches, blobs, strict=True)]
    evaluating = _simulate_new(searches, asked, blobs, new) / len(searches)
    generations = []
    for search, candidates, own, simulated in zip(searches, asked, blobs, new, strict=True):
        scores = replace(search.judge.recall(own, simulated), wall_time=evaluating)
        generations.append(search.tell(candidates, own, scores))
    seconds = (time.perf_counter() - started) / len(searches)
    for search in searches:
        search.seconds += seconds
    return [replace(generation, wall_time=seconds) for generation in generations]


def _simulate_new(searches, asked, blobs, new) -> float:
    """Simulate what no judge knows, in one batch, and tell them; the seconds that it took."""
    started, encoding = time.perf_counter(), searches[0].encoding
    if not sum(map(len, new)):
        return 0.0
    parts = [encoding.take(a.genomes, indices) for a, indices in zip(asked, new, strict=True)]
    fresh = [[own[i] for i in indices] for own, indices in zip(blobs, new, strict=True)]
    scores = searches[0].simulator(
        encoding.concatenate(parts), [blob for part in fresh for blob in part]
    )
    first = 0
    for search, part in zip(searches, fresh, strict=True):
        search.judge.learn(part, scores.take(np.arange(first, first + len(part))))
        first += len(part)
    return time.perf_counter() - started
