"""Random numbers without hidden state: every stream is named by where it is used."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

__all__ = ["Role", "Streams"]


class Role(IntEnum):
    """What a stream of random numbers is used for. The numbers are part of a run's meaning."""

    INITIAL = 0
    SELECTION = 1
    CROSSOVER = 2
    MUTATION = 3
    SECOND_LOOK = 4
    TRIAL = 5
    DIVERSITY = 100  # of reports: decides nothing of a run


@dataclass(frozen=True)
class Streams:
    """The streams of one run, all derived from one seed.

    A stream depends on nothing but the seed and its name (generation, role, index). A resumed run
    therefore draws the same numbers as an uninterrupted one although no generator was ever saved.
    """

    seed: int

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed must be a whole number >= 0, not {self.seed}")

    def __call__(self, generation: int, role: Role, index: int = 0) -> np.random.Generator:
        """Return a fresh generator for one use: asking twice gives the same numbers twice."""
        key = (int(generation), int(role), int(index))
        return np.random.Generator(
            np.random.Philox(np.random.SeedSequence(self.seed, spawn_key=key))
        )
