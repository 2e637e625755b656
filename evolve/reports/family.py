"""The family of an individual: everybody it descends from, and its line from parent to child."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from evolve.fitness import UNITS
from evolve.record import Ancestor
from evolve.reports.export import trial
from evolve.reports.plots import figure
from evolve.reports.units import titled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    import warp_springs as ws
    from evolve.run import Run
    from evolve.store import Store

__all__ = ["family", "family_tree", "line", "steps"]

PICTURES = 9
"""Ancestors that are shown as pictures, at most."""


def line(everybody: Sequence[Ancestor]) -> list[Ancestor]:
    """From the first ancestor to the individual, always by the fitter parent.

    Args:
        everybody: What `Store.ancestors` returned.
    """
    known = {one.id: one for one in everybody}
    found = [everybody[0]]
    while found[-1].parents:
        parents = [known[parent] for parent in found[-1].parents]
        found.append(max(parents, key=lambda one: (one.fitness == one.fitness, one.fitness)))
    return found[::-1]


def steps(line: Sequence[Ancestor]) -> list[Ancestor]:
    """Of a line, the first, whoever was fitter than all before, and the last."""
    shown = list(line[:1])
    for one in line[1:]:
        if not one.fitness <= shown[-1].fitness or one is line[-1]:
            shown.append(one)
    return shown


def family_tree(ax: Axes, everybody: Sequence[Ancestor], unit: str = "") -> Axes:
    """Draw everybody an individual descends from by generation and fitness, its line in red.

    Args:
        ax: Axes to draw into.
        everybody: What `Store.ancestors` returned.
        unit: Of the fitness.
    """
    from matplotlib.collections import LineCollection

    known = {one.id: (one.generation, one.fitness) for one in everybody}
    bonds = [(known[one.id], known[parent]) for one in everybody for parent in one.parents]
    ax.add_collection(LineCollection(bonds, colors="#8a8d91", linewidths=0.6, alpha=0.4))
    dots = np.array(list(known.values()))
    ax.scatter(*dots.T, s=11, color="#3a6ea5", alpha=0.7, zorder=2, label="ancestors")
    way = np.array([known[one.id] for one in line(everybody)])
    ax.plot(*way.T, "o-", color="#c8452d", markersize=4.5, linewidth=1.6, label="fitter parents")
    ax.set_xlabel("generation")
    ax.set_ylabel(titled("fitness", unit))
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.grid(axis="y", color="#8a8d91", alpha=0.25, linewidth=0.8)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False)
    return ax


def family(report: ws.Document, run: Run, store: Store, individual: int) -> None:
    """The section of a report on how an individual came about: its tree, and its ancestors."""
    everybody = store.ancestors(individual)
    if len(everybody) < 2:
        return
    way = steps(line(everybody))
    places = np.linspace(0, len(way) - 1, min(PICTURES, len(way))).round().astype(int)
    shown = [way[place] for place in places]
    report.section("Family")
    chart = figure(9.4, 4.4)
    family_tree(chart.subplots(), everybody, UNITS[run.config.task.fitness])
    words = f"The {len(everybody) - 1:,} ancestors of #{individual}, each bound to its parents."
    report.plot(chart, words)
    labels = [f"generation {one.generation}: #{one.id}   {one.fitness:.2f}" for one in shown]
    words = "Its line from parent to child, at the end of their trials: who was fitter than before."
    film = trial(run, store, [one.id for one in shown])
    report.still(film, words, labels=labels)
