"""What a record tells: evaluations, finalists, ancestors, times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Ancestor", "Finalist", "Record", "Timing"]


@dataclass(frozen=True)
class Timing:
    """How long the parts of a generation took [s]."""

    evaluation: float
    driver: float


@dataclass(frozen=True)
class Record:
    """All evaluations of a run as columns, in the order of the ids; n of them."""

    ids: np.ndarray
    """Shape (n,), int64."""
    generations: np.ndarray
    """Shape (n,), int64."""
    fitness: np.ndarray
    """Shape (n,), float64; NaN = no fitness."""
    status: np.ndarray
    """Shape (n,), int64."""


@dataclass(frozen=True)
class Finalist:
    """An individual that was looked at twice."""

    id: int
    generation: int
    fitness: float
    dt: float
    """Half the step that it took at first, or less where that was not stable [s]."""
    halved: float
    """Fitness at that step in float64; NaN = none."""
    halved_kept: float
    """That fitness / fitness."""
    perturbed: float
    """Quantile of the fitness from perturbed starts; NaN = none."""
    perturbed_kept: float
    """That fitness / fitness."""
    survives: bool
    """Whether enough is left of both."""


@dataclass(frozen=True)
class Ancestor:
    """An individual in the line of descent of another."""

    id: int
    generation: int
    fitness: float
    """NaN = none."""
    parents: tuple[int, ...]
    """Ids of its parents: none, one or two."""
