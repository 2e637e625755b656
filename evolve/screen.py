"""What a person sees while a run is going on."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import FrameType

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from evolve.reports.figures import clock, metric
from evolve.run import Progress

__all__ = ["Screen", "interruptible"]

BLOCKS = "▁▂▃▄▅▆▇█"
LINES = 20
"""About how many lines a whole run prints where there is no live display."""


class Screen:
    """Shows the progress of a run: live on a terminal, as some clean lines anywhere else.

    Of several runs at once it shows the sum of the evaluations, the best, and how many there are.
    """

    def __init__(self, console: Console, unit: str, runs: int = 1) -> None:
        self._console = console
        self._unit = unit
        self._all: list[Progress | None] = [None] * runs
        self._progress: Progress | None = None
        self._seen = 0.0
        self._bests: list[float] = []
        self._stopping: threading.Event | None = None
        self._live: Live | None = None

    @contextmanager
    def showing(self, stopping: threading.Event) -> Iterator[Screen]:
        """Show what `update` is told; `stopping` says that the end was asked for."""
        self._stopping = stopping
        if not self._console.is_terminal:
            yield self
            return
        with Live(
            get_renderable=self._picture, console=self._console, refresh_per_second=4
        ) as self._live:
            yield self
            self._live.refresh()

    def update(self, progress: Progress, which: int = 0) -> None:
        """Show the progress after a generation of one of the runs."""
        self._all[which] = progress
        if any(p is None or p.generation < progress.generation for p in self._all):
            return  # the others are not so far yet
        progress = _joined(self._all)
        news = self._progress is not None
        self._progress, self._seen = progress, time.perf_counter()
        self._bests.append(progress.best_fitness)
        if news and self._live is None and self._is_due(progress):
            self._console.print(self._line(progress), soft_wrap=True, highlight=False)

    def _is_due(self, progress: Progress) -> bool:
        every = math.ceil(progress.generations / LINES)
        last = progress.generation == progress.generations
        return progress.generation % every == 0 or last

    def _line(self, p: Progress) -> str:
        width = len(str(p.generations))
        return (
            f"generation {p.generation:>{width}}/{p.generations}   best {p.best_fitness:.3f}   "
            f"median {p.median:.3f}   {p.evaluations:,} evaluations   "
            f"{metric(p.springs_per_second)} springs/s   {clock(p.remaining)} left"
        )

    def _picture(self) -> RenderableType:
        p = self._progress
        if p is None:
            return Text("preparing ...", style="dim")
        bar = Table.grid(padding=(0, 2))
        bar.add_row(
            ProgressBar(p.generations, p.generation, width=40),
            f"[bold]{p.generation}[/]/{p.generations} generations",
            f"[dim]{self._time_left(p)}[/]",
        )
        if math.isnan(p.best_fitness):
            words = "nobody has a fitness yet"
            if p.generation == 0:
                words = "the first generation; a new machine compiles the kernels once"
            return Group(bar, Text(words, style="dim"))
        lines = Table.grid(padding=(0, 2))
        lines.add_column(min_width=40)
        lines.add_row(
            Text(sparkline(self._bests, 40), style="red"),
            f"[bold red]{p.best_fitness:.3f}[/] {self._unit}  "
            f"[dim]#{p.best_id}, median {p.median:.3f}[/]",
        )
        facts = (
            f"{p.evaluations:,} evaluations   {metric(p.springs_per_second)} springs/s   "
            f"{p.failures:,} stopped   {clock(p.elapsed + self._since())} elapsed"
        )
        return Group(bar, lines, Text(facts, style="dim"))

    def _time_left(self, p: Progress) -> str:
        if self._stopping is not None and self._stopping.is_set():
            return "stopping; Ctrl-C again to stop at once"
        if math.isnan(p.remaining):
            return ""
        return f"{clock(max(p.remaining - self._since(), 0.0))} left"

    def _since(self) -> float:
        """Seconds since the last update, none once the run is complete."""
        p = self._progress
        done = p is None or p.generation == p.generations
        return 0.0 if done else time.perf_counter() - self._seen


def _joined(parts: list[Progress]) -> Progress:
    """The progress of several runs as one."""
    if len(parts) == 1:
        return parts[0]
    best = max(parts, key=lambda p: -math.inf if math.isnan(p.best_fitness) else p.best_fitness)
    medians = [p.median for p in parts if not math.isnan(p.median)]
    return replace(
        best,
        generation=min(p.generation for p in parts),
        evaluations=sum(p.evaluations for p in parts),
        failures=sum(p.failures for p in parts),
        median=float(np.median(medians)) if medians else math.nan,
        elapsed=max(p.elapsed for p in parts),
        remaining=max(p.remaining for p in parts),
    )


def sparkline(values: list[float], width: int) -> str:
    """A row of blocks as high as the values are, at most `width` of them."""
    array = np.array([v for v in values if not math.isnan(v)])
    if not len(array):
        return ""
    picked = array[np.linspace(0, len(array) - 1, min(width, len(array))).round().astype(int)]
    low, high = min(0.0, picked.min()), picked.max()
    levels = np.zeros(len(picked)) if high <= low else (picked - low) / (high - low)
    return "".join(BLOCKS[round(level * (len(BLOCKS) - 1))] for level in levels)


@contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Within, the first Ctrl-C only sets the event that is yielded; the second one interrupts."""
    stopping = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        if stopping.is_set():
            raise KeyboardInterrupt
        stopping.set()

    before = signal.signal(signal.SIGINT, on_signal)
    try:
        yield stopping
    finally:
        signal.signal(signal.SIGINT, before)
