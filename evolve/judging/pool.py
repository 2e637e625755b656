"""A pool of worker processes, one for each device, that survives a killed worker."""

from __future__ import annotations

import multiprocessing as mp
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING

from evolve.encodings.base import Genomes
from evolve.errors import RunError
from evolve.judging.judge import Ticket
from evolve.judging.scores import Scores
from evolve.judging.workshop import Workshop, chunks, cores

if TYPE_CHECKING:
    from evolve.config import RunConfig

__all__ = ["Pool"]

LIVES = 3
"""Workers that one chunk may kill before the run gives up."""


@dataclass
class _Job:
    """Genomes that were submitted together: their scores in parts, None for those to come."""

    scores: list[Scores | None]
    failure: Exception | None = None

    @property
    def done(self) -> bool:
        return self.failure is not None or None not in self.scores


@dataclass
class _Chunk:
    """A part of a job, and how many workers died over it."""

    job: _Job
    index: int
    blobs: list[bytes]
    deaths: int = 0


@dataclass
class _Worker:
    """A process, our end of the pipe to it, and the chunk it works on."""

    device: str
    process: mp.process.BaseProcess
    pipe: Connection
    chunk: _Chunk | None = None


class Pool:
    """Simulates genomes in processes of their own; the scores do not depend on how many.

    Args:
        config: Of the run; `simulation.devices` names the device of each worker.
    """

    def __init__(self, config: RunConfig) -> None:
        from evolve.toml import dump

        self._context = mp.get_context("spawn")
        self._config = dump(config)
        devices = config.simulation.devices
        self._threads = max(1, (config.simulation.threads or cores()) // len(devices))
        self._waiting: deque[_Chunk] = deque()
        self._workers = [self._start(device) for device in devices]

    def submit(self, genomes: Genomes, blobs: Sequence[bytes]) -> Ticket:
        """Begin to simulate n genomes, by their bytes; several may be under way at once."""
        parts = chunks(blobs, len(self._workers))
        job = _Job([None] * len(parts))
        self._waiting.extend(_Chunk(job, i, part) for i, part in enumerate(parts))
        self._feed(self._workers)
        return lambda: self._finished(job, self._workers)

    def prepare(self, genomes: Genomes, blobs: Sequence[bytes]) -> None:
        """Load the kernels in every worker, one after the other: the first may compile them."""
        for index in range(len(self._workers)):
            job = _Job([None])
            self._waiting.append(_Chunk(job, 0, list(blobs)))
            self._finished(job, self._workers[index : index + 1])

    def close(self) -> None:
        """End the workers."""
        for worker in self._workers:
            worker.pipe.close()
            worker.process.join(timeout=5.0)
            if worker.process.is_alive():
                worker.process.kill()
        self._workers = []

    @property
    def processes(self) -> list[int]:
        """Process ids of the workers."""
        return [worker.process.pid for worker in self._workers]

    def _finished(self, job: _Job, workers: Sequence[_Worker]) -> Scores:
        """Scores of a job; whoever dies over a chunk is replaced, and the chunk is done again."""
        try:
            while not job.done:
                self._feed(workers)
                busy = [worker for worker in self._workers if worker.chunk is not None]
                ready = wait([worker.pipe for worker in busy])
                for worker in busy:
                    if worker.pipe in ready:
                        self._hear(worker)
        except BaseException:
            self._abandon()
            raise
        if job.failure is not None:
            self._abandon()
            raise job.failure
        return Scores.concatenate(job.scores)

    def _feed(self, workers: Sequence[_Worker]) -> None:
        """Give waiting chunks to idle workers."""
        for worker in workers:
            if worker.chunk is None and self._waiting:
                worker.chunk = self._waiting.popleft()
                with suppress(OSError):  # it died while idle: hearing it will say so
                    worker.pipe.send(worker.chunk.blobs)

    def _hear(self, worker: _Worker) -> None:
        """Take the answer of a worker that has one, or that has died."""
        chunk = worker.chunk
        try:
            answer = worker.pipe.recv()
        except (EOFError, OSError):
            chunk.deaths += 1
            if chunk.deaths >= LIVES:
                code = worker.process.exitcode
                words = f"{LIVES} worker processes died over the same robots"
                chunk.job.failure = RunError(f"{words} (last exit code {code})")
            self._replace(worker)
            self._waiting.appendleft(chunk)
            return
        worker.chunk = None
        if isinstance(answer, Exception):
            chunk.job.failure = answer
        else:
            chunk.job.scores[chunk.index] = Scores(*answer)

    def _abandon(self) -> None:
        """Forget what is under way: nobody waits for it any more."""
        self._waiting.clear()
        for worker in self._workers:
            if worker.chunk is not None:
                self._replace(worker)

    def _replace(self, worker: _Worker) -> None:
        worker.pipe.close()
        worker.process.kill()
        worker.process.join()
        new = self._start(worker.device)
        worker.process, worker.pipe, worker.chunk = new.process, new.pipe, None

    def _start(self, device: str) -> _Worker:
        ours, theirs = self._context.Pipe()
        arguments = (self._config, device, self._threads, theirs)
        process = self._context.Process(target=_work, args=arguments, daemon=True)
        process.start()
        theirs.close()
        return _Worker(device, process, ours)


def _work(config: str, device: str, threads: int, pipe: Connection) -> None:
    """A worker: takes chunks of genomes as bytes and answers their scores, until the pipe ends."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to answer
    workshop = Workshop(config, device, threads)
    while True:
        try:
            blobs = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer = workshop.judge(blobs)
        except Exception as error:
            answer = RunError(f"a worker on {device} failed: {type(error).__name__}: {error}")
        pipe.send(answer)
