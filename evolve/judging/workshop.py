"""What a worker is made of, in whichever process or on whichever machine it works."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence

import numpy as np

from evolve.judging.worlds import judged
from evolve.memory import keep_memory

__all__ = ["Answer", "Workshop", "chunks", "cores"]

CHUNKS_PER_WORKER = 2
"""So that whoever is done early takes over work of the others."""

Answer = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray], np.ndarray]
"""Fitness, status, descriptors and spring evaluations: what `Scores` is made from."""


class Workshop:
    """Encoding and evaluator of a run on one device.

    Args:
        config: The run, as TOML.
        device: Where to simulate.
        threads: Processor cores to use there.
    """

    def __init__(self, config: str, device: str, threads: int) -> None:
        import warp_springs as ws
        from evolve.judging.evaluate import Evaluator
        from evolve.toml import parse

        ws.quiet()
        keep_memory()
        # Only what decides no bit differs from the run: where and on how many cores.
        settings = {
            "simulation.device": device,
            "simulation.threads": threads,
            "simulation.devices": [],
            "simulation.cluster": "",
        }
        run = parse(config, "the run", settings)
        self.encoding, self.evaluator = run.make_encoding(), Evaluator(run)

    def judge(self, blobs: Sequence[bytes]) -> Answer:
        """Scores of genomes, given by their bytes."""
        scores = judged(self.evaluator, self.encoding, self.encoding.from_bytes(blobs))
        return scores.fitness, scores.status, dict(scores.descriptors), scores.spring_evaluations


def chunks(blobs: Sequence[bytes], workers: int) -> list[list[bytes]]:
    """Genomes in parts of about equal number, some for each worker."""
    count = min(len(blobs), CHUNKS_PER_WORKER * workers)
    edges = np.linspace(0, len(blobs), count + 1).round().astype(int).tolist()
    return [list(blobs[a:b]) for a, b in itertools.pairwise(edges)]


def cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
