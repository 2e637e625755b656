"""The report of a simulation: what was simulated, how it moves, and how to make it again."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from warp_springs.stability import Status
from warp_springs.view.pages.document import Document
from warp_springs.view.parameters import energy_change, of_result, outcome

if TYPE_CHECKING:
    from warp_springs.result import Result

__all__ = ["write_report"]

MOST_PLOTTED = 4
"""Robots whose plots are in a report."""
MOST_SHOWN = 16
"""Robots that are filmed and can be walked around."""
PLOTS = {
    "energies": "Its energies, and what the ledger cannot account for.",
    "height": "Height of its centre of mass.",
    "speed": "Speed of its centre of mass over the ground.",
    "trajectory": "Its way over the floor, seen from above.",
    "footfall": "Which of its masses touch the ground when.",
    "stress_histogram": "How strongly its springs are stretched and compressed.",
}
"""Of a robot: name in `warp_springs.plots`, caption."""


def write_report(
    result: Result,
    path: str | os.PathLike[str],
    *,
    title: str = "A simulation",
    about: str = "",
    names: Mapping[int, str] | None = None,
    parameters: Iterable[tuple[str, str]] | None = None,
    commands: Iterable[str] = (),
    progress: Callable[[str], None] = lambda words: None,
) -> Path:
    """Write the report of a result as one HTML file below 5 MB, and return its path.

    Verdict, a film, a page in which the robots move, plots of the first robots, every parameter.
    It needs no network, and prints well.

    Args:
        result: A run with ``fps=``; energies are plotted where they were recorded.
        path: File to write, ``.html``.
        title: What it is called.
        about: What was simulated, in a line.
        names: Name of a robot by its index.
        parameters: Names and values of all parameters; those of the result by default.
        commands: Lines that make the result again.
        progress: Told what is being done.

    Raises:
        ValueError: The result holds no frames, or the path does not end in ``.html``.
        OSError: The file cannot be written.
    """
    if not result.recorded or not len(result.times):
        raise ValueError("result: it holds no frames to report on; simulate with fps=")
    named = {i: f"robot {i}" for i in result.recorded} | dict(names or {})
    report = Document(title, about)
    stopped = {int(s) for s in result.status} - {int(Status.OK)}
    report.verdict(_verdict(result), good=not stopped)
    report.table(outcome(result))
    progress("filming")
    _watch(report, result, named, title)
    progress("drawing")
    for robot in result.recorded[:MOST_PLOTTED]:
        _plots(report, result, robot, named[robot])
    report.section("Every parameter")
    report.table(of_result(result, named) if parameters is None else parameters)
    if lines := list(commands):
        report.section("Make it again")
        report.code(*lines)
    progress("writing")
    return report.write(path)


def _verdict(result: Result) -> str:
    """How many robots came through, and how good the energies are, in one line."""
    count, healthy = len(result), int((result.status == Status.OK).sum())
    robots = "the robot" if count == 1 else f"all {count:,} robots"
    words = f"{robots} came through" if healthy == count else (
        f"{count - healthy:,} of {count:,} robots had to be stopped")  # fmt: skip
    words += f" {result.end_time - result.start_time:g} s"
    if result.energy is not None:
        words += f"; the energy ledger closes to {energy_change(result)[1]:.2g} % of the total"
    return words[0].upper() + words[1:]


def _watch(report: Document, result: Result, names: Mapping[int, str], title: str) -> None:
    report.section("Watch")
    shown = result.recorded[:MOST_SHOWN]
    several = len(shown) > 1
    caption = f"{len(shown)} robots of {len(result):,}." if several else f"{names[shown[0]]}."
    films = [report.film(result, caption, list(shown))]
    if several:
        films.append(report.film(result, f"{names[shown[0]]} alone.", shown[0]))
    report.row(*films)
    report.player(
        result,
        "The same, to walk around.",
        shown,
        names={i: names[i] for i in shown},
        title=title,
    )


def _plots(report: Document, result: Result, robot: int, name: str) -> None:
    """Plots of one robot, two in a row; those that its recording does not allow are left out."""
    from warp_springs.view import plots

    report.section(f"Motion of {name}")
    missing = set() if result.energy is not None else {"energies"}
    if result.scene.ground is None:
        missing.add("footfall")
    drawn = []
    for plot, caption in PLOTS.items():
        if plot not in missing:
            page = plots.figure(6.8, 4.3)
            called = {"name": name} if plot == "speed" else {}
            getattr(plots, plot)(page.subplots(), result, robot, **called)
            drawn.append(report.plot(page, caption))
    report.row(*drawn)
