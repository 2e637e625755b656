"""The run that a report is about, and what was found of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.errors import RunError
from evolve.fitness import UNITS
from evolve.record import Finalist, Record
from evolve.reports.bodies import shown
from evolve.reports.export import FILM_CYCLES, ZOO_SIZE, trial
from evolve.run import Run

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Subject", "examine", "share"]


@dataclass(frozen=True)
class Subject:
    """The run that a report is about, and what was found of it."""

    run: Run
    record: Record
    finalists: Sequence[Finalist]
    zoo: Sequence[int]
    """Ids of the best, the champion first."""
    film: ws.Result
    """Their whole trial, with energies, in the order of the zoo."""

    @property
    def unit(self) -> str:
        """Of the fitness."""
        return UNITS[self.run.config.task.fitness]

    def fitness(self, individual: int) -> float:
        """Fitness of an individual at the first look."""
        return float(self.record.fitness[np.searchsorted(self.record.ids, individual)])

    @property
    def shown(self) -> float:
        """Seconds that a film shows: some cycles, or all where there are fewer."""
        times = self.film.times
        return min(FILM_CYCLES * self.run.config.encoding.period, float(times[-1] - times[0]))


def examine(run: Run) -> Subject:
    """Read a run and simulate its best again.

    Raises:
        RunError: Nobody has a fitness.
    """
    with run.read() as store:
        finalists = store.finalists()
        shows = shown(run, store, finalists, ZOO_SIZE)
        zoo = [one.id for one in shows] or store.best(ZOO_SIZE)
        if not zoo:
            raise RunError(f"nobody in {run.directory} has a fitness: there is nothing to report")
        record = store.record()
        film = trial(run, store, zoo, energy=True)
    return Subject(run, record, finalists, zoo, film)


def share(kept: float) -> str:
    """What is left of a fitness, in words."""
    return "stopped" if np.isnan(kept) else f"{kept:.0%}"
