"""The loop of a search, in memory: ask, judge, tell."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evolve.config import RunConfig
from evolve.judging.cluster import Cluster
from evolve.judging.judge import Here, Judge, Simulator, Ticket
from evolve.judging.pool import Pool
from evolve.judging.scores import Scores
from evolve.memory import keep_memory
from evolve.optimizers.base import Candidates, Individuals
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


@dataclass(frozen=True)
class _Asked:
    """Candidates that were asked for and not told yet."""

    candidates: Candidates
    blobs: Sequence[bytes]
    simulated: np.ndarray
    """Indices of those that nobody had simulated."""
    ticket: Ticket
    """Scores of these, perhaps among others."""
    first: int
    """Where they begin there."""


class Search:
    """Encoding, optimizer and judge of a configuration, and the loop that joins them.

    Args:
        config: What to search for, and how.
        simulator: Who simulates genomes; made from the configuration when left out.
    """

    def __init__(self, config: RunConfig, simulator: Simulator | None = None) -> None:
        keep_memory()
        self.config = config
        self.encoding = config.make_encoding()
        self.optimizer = config.make_optimizer(self.encoding)
        self._own = simulator is None
        self.simulator = self._make_simulator() if simulator is None else simulator
        self.judge = Judge()
        self.cost, self.seconds = 0, 0.0
        self.waiting: deque[_Asked] = deque()

    def _make_simulator(self) -> Simulator:
        if self.config.simulation.cluster:
            return Cluster(self.config)
        if self.config.simulation.devices:
            return Pool(self.config)
        return Here(self.config, self.encoding)

    def close(self) -> None:
        """End the workers, if there are any."""
        if self._own:
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

    @property
    def asks(self) -> bool:
        """Whether another generation is to be asked for before the next is told."""
        generation = self.optimizer.generation + len(self.waiting)
        ahead = len(self.waiting) <= self.optimizer.ahead
        return ahead and (not self.waiting or generation < self.config.generations)

    def prepare(self) -> None:
        """Load the kernels, so that the first step takes no longer than the others."""
        genomes = self.encoding.random(self.config.population, Streams(0)(0, Role.INITIAL))
        self.simulator.prepare(genomes, self.encoding.to_bytes(genomes))

    def step(self) -> Generation:
        """Search one generation further."""
        return judge_together([self])[0]

    def tell(self, seconds: float) -> Generation:
        """Wait for the scores of the candidates asked for first, and tell them."""
        asked, number = self.waiting.popleft(), self.optimizer.generation
        blobs, scores = asked.blobs, None
        if len(asked.simulated):
            scores = asked.ticket().take(asked.first + np.arange(len(asked.simulated)))
            self.judge.learn([blobs[i] for i in asked.simulated.tolist()], scores)
        if len(asked.simulated) < len(blobs):
            scores = self.judge.recall(blobs, asked.simulated)
        scores = replace(scores, wall_time=seconds)
        self.optimizer.tell(asked.candidates, scores)
        self.cost += int(scores.spring_evaluations.sum())
        return Generation(number, asked.candidates, asked.blobs, scores, 0.0)

    def state(self) -> dict[str, np.ndarray]:
        """What a resumed search must be given back, as plain arrays: name -> array."""
        state = self.optimizer.state()
        if self.waiting:
            blobs = [blob for asked in self.waiting for blob in asked.blobs]
            state |= {
                "waiting": np.array([len(asked.candidates) for asked in self.waiting]),
                "waiting_ids": np.concatenate([a.candidates.ids for a in self.waiting]),
                "waiting_parents": np.concatenate([a.candidates.parents for a in self.waiting]),
                "waiting_lengths": np.array([len(blob) for blob in blobs]),
                "waiting_genomes": np.frombuffer(b"".join(blobs), np.uint8),
            }
        return state

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
            self._restore_waiting(state)

    def _restore_waiting(self, state: Mapping[str, np.ndarray]) -> None:
        """Submit again what was under way."""
        if "waiting" not in state:
            return
        ends = np.cumsum(state["waiting_lengths"]).tolist()
        whole, first = state["waiting_genomes"].tobytes(), 0
        blobs = [whole[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True)]
        for size in state["waiting"].tolist():
            part = slice(first, first + size)
            genomes = self.encoding.from_bytes(blobs[part])
            ids, parents = state["waiting_ids"][part], state["waiting_parents"][part]
            _submit([self], [Candidates(ids, genomes, parents)], [blobs[part]])
            first += size


def judge_together(searches: Sequence[Search]) -> list[Generation]:
    """Search one generation further in each of some searches that differ in their seed alone.

    Their candidates share one batch of the first one's simulator; what each gets to know is the
    same to the bit as if it were alone.
    """
    started = time.perf_counter()
    while asking := [search for search in searches if search.asks]:
        asked = [
            search.optimizer.ask(search.config.population, [a.candidates for a in search.waiting])
            for search in asking
        ]
        blobs = [s.encoding.to_bytes(a.genomes) for s, a in zip(asking, asked, strict=True)]
        _submit(asking, asked, blobs)
    waited = time.perf_counter()
    for search in searches:
        search.waiting[0].ticket()
    evaluating = (time.perf_counter() - waited) / len(searches)
    generations = [search.tell(evaluating) for search in searches]
    seconds = (time.perf_counter() - started) / len(searches)
    for search in searches:
        search.seconds += seconds
    return [replace(generation, wall_time=seconds) for generation in generations]


def _submit(
    searches: Sequence[Search], asked: Sequence[Candidates], blobs: Sequence[Sequence[bytes]]
) -> None:
    """Begin to simulate, in one batch, what the judges of some searches do not know."""
    new = [search.judge.unknown(own) for search, own in zip(searches, blobs, strict=True)]
    encoding, ticket = searches[0].encoding, _nothing
    if sum(map(len, new)):
        parts = [
            a.genomes if len(rows) == len(a) else encoding.take(a.genomes, rows)
            for a, rows in zip(asked, new, strict=True)
        ]
        fresh = [own[i] for own, rows in zip(blobs, new, strict=True) for i in rows]
        ticket = searches[0].simulator.submit(encoding.concatenate(parts), fresh)
    first = 0
    for search, candidates, own, rows in zip(searches, asked, blobs, new, strict=True):
        search.waiting.append(_Asked(candidates, own, rows, ticket, first))
        first += len(rows)


def _nothing() -> Scores:
    """The scores of nobody."""
    return Scores(np.zeros(0), np.zeros(0))
