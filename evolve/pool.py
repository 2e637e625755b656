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
from evolve.scores import Scores
from evolve.workshop import Workshop, chunks, cores

if TYPE_CHECKING:
    from evolve.config import RunConfig

__all__ = ["Pool"]

LIVES = 3
"""Workers that one chunk may kill before the run gives up."""


@dataclass
class _Worker:
    """A process, our end of the pipe to it, and the chunk it works on."""

    device: str
    process: mp.process.BaseProcess
    pipe: Connection
    chunk: int | None = None


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
        self._workers = [self._start(device) for device in devices]

    def __call__(self, genomes: Genomes, blobs: Sequence[bytes]) -> Scores:
        """Scores of n genomes, by their bytes."""
        parts = chunks(blobs, len(self._workers))
        return Scores.concatenate(self._judged(parts))

    def prepare(self, blobs: Sequence[bytes]) -> None:
        """Load the kernels in every worker, one after the other: the first may compile them."""
        for index in range(len(self._workers)):
            self._judged([list(blobs)], only=index)

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

    def _judged(self, chunks: Sequence[list[bytes]], only: int | None = None) -> list[Scores]:
        """Scores of each chunk; whoever dies is replaced, and its chunk is done again."""
        waiting, done = deque(range(len(chunks))), {}
        deaths = [0] * len(chunks)
        members = range(len(self._workers)) if only is None else (only,)
        try:
            while len(done) < len(chunks):
                for index in members:
                    worker = self._workers[index]
                    if worker.chunk is None and waiting:
                        worker.chunk = waiting.popleft()
                        self._send(worker, chunks[worker.chunk])
                busy = [i for i in members if self._workers[i].chunk is not None]
                wait([self._workers[i].pipe for i in busy])
                for index in busy:
                    worker = self._workers[index]
                    if not worker.pipe.poll():
                        continue
                    try:
                        answer = worker.pipe.recv()
                    except (EOFError, OSError):
                        self._mourn(index, deaths, waiting)
                        continue
                    if isinstance(answer, Exception):
                        raise answer
                    done[worker.chunk], worker.chunk = Scores(*answer), None
        except BaseException:
            # Whatever is still under way belongs to nobody any more.
            for index in members:
                if self._workers[index].chunk is not None:
                    self._replace(index)
            raise
        return [done[i] for i in range(len(chunks))]

    def _send(self, worker: _Worker, chunk: list[bytes]) -> None:
        with suppress(OSError):  # it died while idle: reading from it will say so
            worker.pipe.send(chunk)

    def _mourn(self, index: int, deaths: list[int], waiting: deque[int]) -> None:
        chunk = self._workers[index].chunk
        deaths[chunk] += 1
        code = self._workers[index].process.exitcode
        if deaths[chunk] >= LIVES:
            raise RunError(
                f"{LIVES} worker processes died over the same robots (last exit code {code})"
            )
        self._replace(index)
        waiting.appendleft(chunk)

    def _replace(self, index: int) -> None:
        worker = self._workers[index]
        worker.pipe.close()
        worker.process.kill()
        worker.process.join()
        self._workers[index] = self._start(worker.device)

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
