"""Plots of a search. Each function draws into the axes it is given and returns them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evolve.fitness import UNITS
from evolve.reports.comparison import best_so_far
from evolve.reports.units import titled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from evolve.record import Record

__all__ = ["dot_plot", "figure", "learning_curve", "performance"]

INK, GREY, BLUE, RED = "#1f2328", "#8a8d91", "#3a6ea5", "#c8452d"


def figure(width: float = 9.0, height: float = 5.2) -> Figure:
    """A figure that belongs to nobody but the caller: drawn without pyplot or a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    new = Figure(figsize=(width, height), dpi=150, layout="constrained", facecolor="white")
    FigureCanvasAgg(new)
    return new


def learning_curve(ax: Axes, record: Record, fitness: str = "speed") -> Axes:
    """Draw the best so far, and median and quantiles of each generation, against evaluations.

    Args:
        ax: Axes to draw into.
        record: Evaluations of a run.
        fitness: Name of the fitness, for the label of the axis.
    """
    ends, quantiles = _quantiles(record)
    ax.fill_between(ends, quantiles[0], quantiles[4], color=BLUE, alpha=0.13, linewidth=0)
    ax.fill_between(ends, quantiles[1], quantiles[3], color=BLUE, alpha=0.22, linewidth=0)
    best = best_so_far(record.fitness)
    ax.plot(record.ids, best, color=RED, linewidth=2.2, label="best so far", zorder=3)
    ax.plot(ends, quantiles[2], color=BLUE, linewidth=1.6, label="median of a generation")
    # The bands overlap: the legend shows the colours that they have together.
    ax.fill_between([], [], [], color=BLUE, alpha=0.32, linewidth=0, label="its middle half")
    ax.fill_between([], [], [], color=BLUE, alpha=0.13, linewidth=0, label="10 % to 90 % of it")
    _mark_last(ax, record, best)
    _dress(ax, fitness, right=float(record.ids[-1]))
    _legend_above(ax)
    return ax


def dot_plot(ax: Axes, record: Record, fitness: str = "speed") -> Axes:
    """Draw every individual as a dot, the best so far as a line, the stopped at the bottom.

    Args:
        ax: Axes to draw into.
        record: Evaluations of a run.
        fitness: Name of the fitness, for the label of the axis.
    """
    fit = np.isfinite(record.fitness)
    size = float(np.clip(60_000 / max(len(record.ids), 1), 2.5, 14.0))
    ax.scatter(
        record.ids[fit],
        record.fitness[fit],
        s=size,
        color=BLUE,
        alpha=0.25,
        linewidths=0,
        rasterized=True,
        label="individuals",
    )
    best = best_so_far(record.fitness)
    ax.plot(record.ids, best, color=RED, linewidth=1.6, label="best so far", zorder=3)
    _mark_last(ax, record, best)
    if not fit.all():
        ax.plot(
            record.ids[~fit],
            np.full(np.count_nonzero(~fit), 0.012),
            "|",
            color=INK,
            markersize=6,
            transform=ax.get_xaxis_transform(),
            label=f"stopped: {np.count_nonzero(~fit):,}",
        )
    _dress(ax, fitness, right=float(record.ids[-1]))
    _legend_above(ax)
    return ax


def performance(
    ax: Axes,
    record: Record,
    costs: tuple[np.ndarray, np.ndarray, np.ndarray],
    fitness: str = "speed",
) -> Axes:
    """Draw the best so far against spring evaluations, and above it the seconds that they took.

    Args:
        ax: Axes to draw into.
        record: Evaluations of a run.
        costs: What `Store.costs` returned: evaluations, spring evaluations and seconds so far.
        fitness: Name of the fitness, for the label of the axis.
    """
    evaluations, springs, seconds = costs
    best = best_so_far(record.fitness)[evaluations.astype(int) - 1]
    ax.plot(springs / 1e9, best, color=RED, linewidth=2.0)
    _dress(ax, fitness, right=float(springs[-1]) / 1e9)
    ax.set_xlabel("spring evaluations [10⁹]")
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    above = ax.secondary_xaxis(
        "top",
        functions=(
            lambda x: np.interp(x, np.append(0.0, springs / 1e9), np.append(0.0, seconds)),
            lambda t: np.interp(t, np.append(0.0, seconds), np.append(0.0, springs / 1e9)),
        ),
    )
    # Evenly along the axis: where the pace changed, round numbers of seconds would overlap.
    shown = np.linspace(0.0, float(springs[-1]), 6)
    ticks = np.interp(shown, np.append(0.0, springs), np.append(0.0, seconds))
    above.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
    above.set_xlabel("time [s]")
    return ax


def _quantiles(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Evaluations at the end of each of G generations, and 5 quantiles of its fitness, (5, G)."""
    starts = np.flatnonzero(np.diff(record.generations, prepend=-1))
    ends = np.append(starts[1:], len(record.ids))
    levels = [0.1, 0.25, 0.5, 0.75, 0.9]
    table = np.full((len(levels), len(starts)), np.nan)
    for g, (start, end) in enumerate(zip(starts, ends, strict=True)):
        fitness = record.fitness[start:end]
        fitness = fitness[np.isfinite(fitness)]
        if len(fitness):
            table[:, g] = np.quantile(fitness, levels)
    return ends, table


def _mark_last(ax: Axes, record: Record, best: np.ndarray) -> None:
    """Mark the individual that is the best of all."""
    if not np.isfinite(best[-1]):
        return
    first = int(np.argmax(best == best[-1]))
    ax.plot(record.ids[first], best[-1], "o", color=RED, markersize=7, markeredgecolor="white")
    ax.annotate(
        f"{best[-1]:.3g}",
        (record.ids[first], best[-1]),
        xytext=(0, 9),
        textcoords="offset points",
        ha="center",
        color=RED,
        fontweight="bold",
    )


def _legend_above(ax: Axes) -> None:
    """A legend in one row between the title and the plot, where it hides nothing."""
    legend = ax.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderaxespad=0.2
    )
    for handle in legend.legend_handles:
        if hasattr(handle, "set_sizes"):  # dots: as small as they are, nobody would see one
            handle.set_sizes([14.0])
            handle.set_alpha(1.0)


def _dress(ax: Axes, fitness: str, right: float) -> None:
    """Labels, limits and a light grid."""
    ax.set_xlabel("evaluations")
    ax.set_ylabel(titled(fitness, UNITS[fitness]))
    ax.set_xlim(0.0, right * 1.02)
    ax.set_ylim(bottom=0.0)
    ax.margins(y=0.12)
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    ax.grid(axis="y", color=GREY, alpha=0.25, linewidth=0.8)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
