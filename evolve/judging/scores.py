"""What an evaluation says about every individual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

__all__ = ["Scores"]


@dataclass(frozen=True)
class Scores:
    """The outcome of evaluating n individuals; row i belongs to individual i.

    Higher fitness is better. An individual whose simulation was stopped has no fitness: NaN here,
    NULL in a run's record, behind every other individual when individuals are compared.
    """

    fitness: np.ndarray
    """Shape (n,), float64; NaN = no fitness."""
    status: np.ndarray
    """Shape (n,), integers of `warp_springs.Status`; 0 = OK."""
    descriptors: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Further figures about each individual: name -> float64 array, shape (n,)."""
    spring_evaluations: np.ndarray | None = None
    """Simulated cost, shape (n,), int64. Zeros when left out."""
    wall_time: float = 0.0
    """Seconds that the evaluation took [s]. Says nothing about the individuals."""

    def __post_init__(self) -> None:
        fitness = np.asarray(self.fitness, dtype=np.float64)
        if fitness.ndim != 1:
            raise ValueError(f"fitness must have shape (n,), not {fitness.shape}")
        status = np.asarray(self.status, dtype=np.int64)
        cost = self.spring_evaluations
        cost = np.zeros(len(fitness), np.int64) if cost is None else np.asarray(cost, np.int64)
        descriptors = {k: np.asarray(v, dtype=np.float64) for k, v in self.descriptors.items()}
        for name, array in {"status": status, "spring_evaluations": cost, **descriptors}.items():
            if array.shape != fitness.shape:
                raise ValueError(
                    f"{name} must have the shape of fitness, {fitness.shape}, not {array.shape}"
                )
        object.__setattr__(self, "fitness", np.where(status == 0, fitness, np.nan))
        object.__setattr__(self, "status", status)
        object.__setattr__(self, "descriptors", descriptors)
        object.__setattr__(self, "spring_evaluations", cost)

    def __len__(self) -> int:
        return len(self.fitness)

    @property
    def worth(self) -> np.ndarray:
        """Fitness for comparing, shape (n,): -inf where there is no (finite) fitness."""
        return np.where(np.isfinite(self.fitness), self.fitness, -np.inf)

    def take(self, indices: np.ndarray) -> Scores:
        """The scores of the individuals at `indices`, in that order. The wall time is dropped."""
        return Scores(
            fitness=self.fitness[indices],
            status=self.status[indices],
            descriptors={k: v[indices] for k, v in self.descriptors.items()},
            spring_evaluations=self.spring_evaluations[indices],
        )

    @classmethod
    def concatenate(cls, parts: Sequence[Scores]) -> Scores:
        """One table from several with the same descriptors. The wall times are dropped."""
        return cls(
            fitness=np.concatenate([p.fitness for p in parts]),
            status=np.concatenate([p.status for p in parts]),
            descriptors={
                k: np.concatenate([p.descriptors[k] for p in parts]) for k in parts[0].descriptors
            },
            spring_evaluations=np.concatenate([p.spring_evaluations for p in parts]),
        )
