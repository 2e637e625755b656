"""What a run says about itself in words: computed from its record, nothing claimed beyond it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from evolve.record import Finalist, Record
from evolve.reports.comparison import Group, best_so_far
from evolve.reports.units import in_units, with_unit

__all__ = ["findings"]


def findings(
    record: Record, finalists: Sequence[Finalist], several: Sequence[Group], unit: str
) -> Iterator[str]:
    """Sentences about what worked and what did not.

    Args:
        record: Of the run.
        finalists: Who was looked at twice, survivors first.
        several: The groups of runs that it is compared with, its own among them.
        unit: Of the fitness.
    """
    yield from _progress(record, unit)
    yield from _failures(record)
    yield from _exploits(finalists)
    if len(several) > 1:
        yield from _ranking(several, unit)


def _progress(record: Record, unit: str) -> Iterator[str]:
    best = best_so_far(record.fitness)
    first = record.fitness[record.generations == record.generations[0]]
    first = first[np.isfinite(first)]
    if not np.isfinite(best[-1]) or not len(first):
        return
    start, end = float(first.max()), float(best[-1])
    figure = with_unit(f"{end:.3f}", unit)
    yield f"The best of the first generation had {start:.3f}, the best of all {figure}."
    if end > start:
        half = int(np.argmax(best >= start + 0.9 * (end - start))) + 1
        count = len(best)
        yield (
            f"Nine tenths of that gain were made after {half:,} of {count:,} evaluations"
            + ("; more evaluations would have brought little." if half < 0.5 * count else
               "; the search was still gaining when it ended.")
        )  # fmt: skip


def _failures(record: Record) -> Iterator[str]:
    import warp_springs as ws

    stopped = record.status != 0
    if not stopped.any():
        yield "No robot had to be stopped."
        return
    codes, counts = np.unique(record.status[stopped], return_counts=True)
    why = ", ".join(f"{ws.Status(int(c)).name} {n:,}" for c, n in zip(codes, counts, strict=True))
    late = record.generations > np.median(np.unique(record.generations))
    yield (
        f"{np.count_nonzero(stopped):,} of {len(stopped):,} robots ({stopped.mean():.1%}) were "
        f"stopped ({why}): {stopped[~late].mean():.1%} in the first half of the run, "
        f"{stopped[late].mean() if late.any() else 0.0:.1%} in the second."
    )


def _exploits(finalists: Sequence[Finalist]) -> Iterator[str]:
    if not finalists:
        return
    lost = [f for f in finalists if not f.survives]
    step = [f for f in lost if not f.halved_kept >= f.perturbed_kept]
    if not lost:
        yield f"All {len(finalists)} that were looked at twice kept their fitness."
        return
    yield (
        f"{len(lost)} of {len(finalists)} that were looked at twice did not keep their fitness: "
        f"{len(step)} lost more at half the time step (they exploited the simulator), "
        f"{len(lost) - len(step)} from perturbed starts (they were lucky)."
    )


def _ranking(several: Sequence[Group], unit: str) -> Iterator[str]:
    """Who was best at the number of evaluations that all groups reached."""
    curves = [group.curve() for group in several]
    shared = min(int(curve.evaluations[-1]) for curve in curves)
    at = [float(np.interp(shared, c.evaluations, c.mean)) for c in curves]
    order = np.argsort([-np.inf if np.isnan(v) else v for v in at])[::-1]
    words = "; ".join(f"{several[i].label}: {at[i]:.3f}" for i in order)
    means = in_units("means of the best so far", unit)
    yield f"After {shared:,} evaluations, {means} are {words}."
