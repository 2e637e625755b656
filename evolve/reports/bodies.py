"""Which robots show what a run has found that keeps kinds apart: good ones, unlike each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evolve.config import DESCRIPTORS
from evolve.record import Finalist
from evolve.reports.archive import atlas, niches
from evolve.run import Run
from evolve.store import Store

__all__ = ["shown", "spread_out", "various"]

CANDIDATES = 512
"""How many of the best different individuals are considered."""
SHARE = 0.4
"""Share of the best fitness that makes an individual a good one."""
FEW = 2
"""For each that is shown, so many of the best are considered in any case."""


def various(run: Run, store: Store, count: int) -> list[int]:
    """Ids of good individuals that differ in their `niches`, the best first.

    Each next one is, of the good, the one least like those before: farthest from the nearest of
    them in those descriptors (in way and height, where there are none), each in units of its
    standard deviation. An optimizer with an archive has the best of each of its cells considered,
    others the best of all.

    Args:
        run: A run in which somebody has a fitness.
        store: Its record.
        count: How many; fewer where fewer are good.
    """
    best = store.best(CANDIDATES)
    if run.config.optimizer.niches and (found := atlas(run, store)) is not None:
        best = list(dict.fromkeys([best[0], *found.filled.tolist()]))
    scores = store.scores(best)
    names = niches(run.config) or DESCRIPTORS
    values = np.stack([scores.descriptors[name] for name in names], axis=1)
    least = scores.fitness[0] * (SHARE if scores.fitness[0] > 0.0 else 1.0 / SHARE)
    # Where few are good, some that are less so: in an archive most kinds are slower than the best.
    few = np.arange(len(best)) < FEW * count
    good = ((scores.fitness >= least) | few) & np.isfinite(values).all(axis=1)
    good[0] = True
    chosen = spread_out(np.nan_to_num(values[good]), count)
    return [best[place] for place in np.flatnonzero(good)[chosen]]


def spread_out(values: np.ndarray, count: int) -> np.ndarray:
    """Rows of a table (n, D) that lie far apart, the first row first, shape (<= count,)."""
    scale = values.std(axis=0)
    scaled = values / np.where(scale > 0.0, scale, 1.0)
    chosen = [0]
    nearest = np.linalg.norm(scaled - scaled[0], axis=1)
    nearest[0] = -1.0
    while len(chosen) < min(count, len(values)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        nearest[chosen] = -1.0
    return np.array(chosen)


def shown(run: Run, store: Store, finalists: Sequence[Finalist], count: int) -> Sequence[Finalist]:
    """Who of those that were looked at twice is shown in the zoo.

    The best, if nothing tells individuals apart but their fitness; else the champion and `various`
    others, filled up with the best where there are too few of them.
    """
    if not niches(run.config):
        return finalists[:count]
    wanted = set(various(run, store, count))
    different = [one for one in finalists[1:] if one.id in wanted]
    others = [one for one in finalists[1:] if one.id not in wanted]
    return [*finalists[:1], *different, *others][:count]
