"""The loop of a search, in memory: ask, express, evaluate, tell."""

from __future__ import annotations

import time
from dataclasses import dataclass

from evolve.config import RunConfig
from evolve.evaluate import Evaluator
from evolve.optimizers.base import Candidates, Individuals
from evolve.scores import Scores
from evolve.store import Store
from evolve.streams import Role, Streams

__all__ = ["Generation", "Search"]


@dataclass(frozen=True)
class Generation:
    """What a generation brought."""

    number: int
    candidates: Candidates
    scores: Scores
    wall_time: float
    """Seconds it took, evaluation included [s]."""


class Search:
    """Encoding, optimizer and evaluator of a configuration, and the loop that joins them."""

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self.encoding = config.make_encoding()
        self.optimizer = config.make_optimizer(self.encoding)
        self.evaluator = Evaluator(config)

    @property
    def finished(self) -> bool:
        """Whether all generations of the configuration are done."""
        return self.optimizer.generation >= self.config.generations

    def prepare(self) -> None:
        """Load the kernels, so that the first step takes no longer than the others."""
        genomes = self.encoding.random(self.config.population, Streams(0)(0, Role.INITIAL))
        self.evaluator.prepare(self.encoding.express(genomes))

    def step(self) -> Generation:
        """Search one generation further."""
        started, number = time.perf_counter(), self.optimizer.generation
        candidates = self.optimizer.ask(self.config.population)
        scores = self.evaluator(self.encoding.express(candidates.genomes))
        self.optimizer.tell(candidates, scores)
        return Generation(number, candidates, scores, time.perf_counter() - started)

    def restore(self, store: Store) -> None:
        """Go to where a record ends."""

        def recall(ids) -> Individuals:
            genomes = self.encoding.from_bytes(store.genomes(ids))
            return Individuals(ids, genomes, store.scores(ids))

        if state := store.optimizer_state():
            self.optimizer.restore(state, recall)
