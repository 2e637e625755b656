"""A run as a page on this machine while it is going on: its curve, and the best robot in motion."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from evolve.fitness import UNITS
from evolve.reports.export import trial
from evolve.reports.figures import clock, metric
from evolve.reports.units import with_unit
from evolve.run import Progress, Run

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["Live"]

SHARE = 0.05
"""Share of the time of a run that may go into filming its best robots."""
POINTS = 400
"""Points of a curve."""
COLORS = ("#c8452d", "#3a6ea5", "#2e8b6f", "#b07cc6", "#d9a13b", "#5b4636")


@dataclass
class _Course:
    """How one run went so far."""

    progress: Progress | None = None
    evaluations: list[int] = field(default_factory=list)
    best: list[float] = field(default_factory=list)
    median: list[float] = field(default_factory=list)


class Live:
    """Keeps the page of a server up to date; tell it of every generation.

    The best of all is filmed anew when another one takes the lead, as often as a twentieth of the
    run's time allows, and once more at the end.

    Args:
        runs: What is evolved together.
        server: Serves the page.
    """

    def __init__(self, runs: Sequence[Run], server: ws.LiveServer) -> None:
        self._runs, self._server = runs, server
        self._courses = [_Course() for _ in runs]
        self._shown: tuple[int, int] | None = None
        self._started = time.perf_counter()
        self._filming = 0.0

    def update(self, progress: Progress, which: int = 0) -> None:
        """Take note of a generation of one of the runs."""
        course = self._courses[which]
        course.progress = progress
        if progress.evaluations:
            course.evaluations.append(progress.evaluations)
            course.best.append(progress.best_fitness)
            course.median.append(progress.median)
        self._show_state()
        passed = time.perf_counter() - self._started
        last = progress.generation >= progress.generations
        if last or self._filming <= SHARE * passed:
            self._show_best()

    def _show_state(self) -> None:
        import warp_springs as ws

        known = [c.progress for c in self._courses if c.progress]
        first, config = known[0], self._runs[0].config
        total = first.generations
        facts = [
            ("best", f"{max(p.best_fitness for p in known):.3f}"),
            ("evaluations", f"{sum(p.evaluations for p in known):,}"),
            ("springs/s", metric(first.springs_per_second)),
            ("stopped robots", f"{sum(p.failures for p in known):,}"),
        ]
        if not np.isnan(first.remaining):
            facts.append(("left", clock(first.remaining)))
        lines = [
            ws.LiveLine(self._label(i), COLORS[i % len(COLORS)], self._thin(course.best))
            for i, course in enumerate(self._courses)
        ]
        if len(self._courses) == 1:
            median = self._thin(self._courses[0].median)
            lines.append(ws.LiveLine("median of a generation", COLORS[1], median))
        self._server.show(
            done=first.generation / max(total, 1),
            words=f"generation {first.generation:,} of {total:,}",
            facts=facts,
            curve=config.task.fitness,
            unit=UNITS[config.task.fitness],
            x=self._thin(self._courses[0].evaluations),
            x_name="evaluations" + (" of each seed" if len(self._courses) > 1 else ""),
            lines=lines,
        )

    def _label(self, which: int) -> str:
        seed = self._runs[which].config.seed
        return "best so far" if len(self._runs) == 1 else f"best of seed {seed}"

    def _thin(self, values: Sequence[float]) -> list[float]:
        """As many values as a curve needs, in step with those of the first run."""
        count = len(self._courses[0].evaluations)
        picked = np.unique(np.linspace(0, max(count - 1, 0), min(count, POINTS)).astype(int))
        return [values[i] if i < len(values) else float("nan") for i in picked]

    def _show_best(self) -> None:
        """Film the best of all, unless it is on the page already."""
        import warp_springs as ws

        known = [(c.progress.best_fitness, i) for i, c in enumerate(self._courses) if c.progress]
        known = [(fitness, i) for fitness, i in known if not np.isnan(fitness)]
        if not known:
            return
        fitness, which = max(known, key=lambda entry: entry[0])
        individual = self._courses[which].progress.best_id
        if (which, individual) == self._shown:
            return
        started, run = time.perf_counter(), self._runs[which]
        with run.read() as store:
            film = trial(run, store, [individual], energy=True)
        unit = UNITS[run.config.task.fitness]
        self._server.show_robots(
            ws.html_page(
                film,
                names={0: f"#{individual}"},
                custom_data={0: {run.config.task.fitness: with_unit(f"{fitness:.3f}", unit)}},
                title=f"#{individual} of {run.directory.name}",
            )
        )
        self._shown = which, individual
        self._filming += time.perf_counter() - started
