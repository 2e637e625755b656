"""Several objectives at once: what they are, Pareto ranks, crowding."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evolve.judging.scores import Scores

__all__ = ["best_first", "crowding", "objectives", "ranks"]


def objectives(scores: Scores, names: Sequence[str]) -> np.ndarray:
    """The objectives of n individuals, all to be maximised, shape (n, len(names)).

    Args:
        scores: Of the individuals.
        names: `fitness` or a descriptor; with a minus in front, less is better.

    Returns:
        -inf in every column for an individual without fitness or with a figure that is not finite.

    Raises:
        ValueError: There is no such descriptor.
    """
    columns = []
    for name in names:
        key = name.removeprefix("-")
        if key != "fitness" and key not in scores.descriptors:
            known = ", ".join(["fitness", *scores.descriptors])
            raise ValueError(f"objective {name!r}: there is no {key!r}; there are {known}")
        values = scores.fitness if key == "fitness" else scores.descriptors[key]
        columns.append(-values if name.startswith("-") else values)
    table = np.stack(columns, axis=1)
    good = np.isfinite(table).all(axis=1) & np.isfinite(scores.fitness)
    return np.where(good[:, None], table, -np.inf)


def ranks(points: np.ndarray) -> np.ndarray:
    """Pareto rank of each row, shape (n,): 0 for those that nobody dominates. Maximises."""
    from moocore import pareto_rank

    return np.asarray(pareto_rank(points, maximise=True), dtype=np.int64)


def crowding(points: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Crowding distance of each row among those of its rank (Deb et al. 2002), shape (n,).

    Infinite at the ends of a front; larger is lonelier.
    """
    distance = np.zeros(len(points))
    for front in (np.flatnonzero(rank == r) for r in np.unique(rank)):
        for column in points.T:
            along = front[np.argsort(column[front], kind="stable")]
            values = column[along]
            distance[along[[0, -1]]] = np.inf
            if np.isfinite(values[0]) and values[-1] > values[0]:
                distance[along[1:-1]] += (values[2:] - values[:-2]) / (values[-1] - values[0])
    return distance


def best_first(points: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """Indices that sort by rank, then the lonelier first, then the older."""
    rank = ranks(points)
    return np.lexsort((ids, -crowding(points, rank), rank))
