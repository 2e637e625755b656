"""Work-precision curves: a panel for each scene, error against cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from accuracy_measure import Row, Series, recommended, step_name
from accuracy_scenes import Case, Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw"]

MARKERS = {"float64": "o", "float32": "^", "mixed": "s"}
COLOURS = {"chin4": "#1f6fb2", "leapfrog": "#e08a1e", "euler": "#b5495b"}
NAMES = {"chin4": "chin4", "leapfrog": "leapfrog", "euler": "symplectic Euler"}
#: Where the name of a recommended step stands, in points from its ring.
LABELS = {"chin4": (-6, -13), "leapfrog": (-5, 10), "euler": (8, 5)}
INK, QUIET = "#1f2328", "#8a8d91"
COSTS = {
    "evaluations": "spring evaluations for one robot",
    "seconds": "seconds for one robot of a batch",
}
EXPLANATION = (
    "Lower and further left is better.\n"
    "Error: root mean square over the masses at the end.\n"
    "Recommended: the largest step below the dashed line,\n"
    "if the next smaller one is below it, too."
)
#: Errors that are shown [m].
SHOWN = (1e-10, 0.3)
STYLE = {
    "font.size": 10,
    "axes.edgecolor": QUIET,
    "axes.linewidth": 0.8,
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def draw(
    rows: Sequence[Row],
    cases: Mapping[str, Case],
    truths: Mapping[str, Truth],
    path: Path,
    cost: str,
    caption: str,
) -> None:
    """Draw all scenes and write a picture.

    Args:
        rows: What was measured.
        cases: The scenes, by name, in the order of the panels.
        truths: Their truths.
        path: File to write.
        cost: ``"evaluations"`` or ``"seconds"``.
        caption: What it was measured on, one line.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    across = min(4, len(cases) + 1)
    down = -(-(len(cases) + 1) // across)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.5 * across + 0.4, 3.05 * down + 0.5), layout="constrained")
        axes = figure.subplots(down, across, sharey=True, squeeze=False).ravel()
        for ax, (name, case) in zip(axes, cases.items(), strict=False):
            _panel(ax, [row for row in rows if row.scene == name], case, truths[name], cost)
        for ax in axes[len(cases) :]:
            ax.axis("off")
        spare = across - len(cases) % across
        _legend(axes[len(cases)], rows, columns=min(spare, 2))
        figure.supxlabel(COSTS[cost], fontsize=12)
        figure.supylabel("error [m]", fontsize=12)
        figure.suptitle(caption, fontsize=10, color=QUIET)
        figure.savefig(path, dpi=110)


def _panel(ax: Axes, rows: Sequence[Row], case: Case, truth: Truth, cost: str) -> None:
    ax.set_title(case.title, fontsize=11, loc="left", fontweight="bold")
    ax.set(xscale="log", yscale="log", ylim=SHOWN)
    ax.margins(x=0.14)
    ax.set_yticks([1e-10, 1e-8, 1e-6, 1e-4, 1e-2])
    ax.grid(which="major", color="#e6e8eb", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.minorticks_off()
    ax.axhspan(SHOWN[0], max(truth.uncertainty, SHOWN[0]), color="#f0f1f3", linewidth=0)
    ax.axhline(case.target, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    ax.text(
        1.0,
        0.99,
        f"- - -  {100 * case.fraction:g} % of {case.of}",
        transform=ax.transAxes,
        ha="right",
        va="top",
        fontsize=8.5,
        color=INK,
    )
    for series in dict.fromkeys(row.series for row in rows):
        own = [row for row in rows if row.series == series and np.isfinite(row.error)]
        costs, errors = [getattr(row, cost) for row in own], [row.error for row in own]
        ax.plot(costs, errors, **_look(series))
        best = recommended(own, case.target)
        if best and series.precision == "float64" and series.substeps != "one":
            _mark(ax, best, cost)


def _look(series: Series) -> dict:
    """How a series is drawn: integrator by colour, precision by marker, sub-steps by line."""
    colour = COLOURS[series.integrator]
    single, one = series.precision != "float64", series.substeps == "one"
    return {
        "color": colour,
        "linewidth": 0.9 if single or one else 1.8,
        "linestyle": (0, (1, 1.6)) if one else "-",
        "marker": MARKERS[series.precision],
        "markersize": 3.0 if one else 5.0 if single else 4.5,
        "markerfacecolor": "white" if single else colour,
        "markeredgewidth": 0.9,
        "alpha": 0.65 if one else 0.8 if single else 1.0,
        "zorder": 2.0 if one else 2.5 if single else 3.0,
    }


def _mark(ax: Axes, row: Row, cost: str) -> None:
    """Ring the recommended step and say what it is."""
    from matplotlib.patheffects import withStroke

    name = row.series.integrator
    place = getattr(row, cost), row.error
    ring = {"markersize": 10, "markerfacecolor": "none", "markeredgecolor": COLOURS[name]}
    ax.plot(*place, "o", **ring, zorder=4)
    ax.annotate(
        step_name(row.dt),
        place,
        xytext=LABELS[name],
        textcoords="offset points",
        ha="right" if LABELS[name][0] < 0 else "left",
        fontsize=8.5,
        color=COLOURS[name],
        fontweight="bold",
        zorder=5,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def _legend(ax: Axes, rows: Sequence[Row], columns: int) -> None:
    from matplotlib.lines import Line2D

    seen = dict.fromkeys(row.series.integrator for row in rows)
    entries = [(NAMES[name], _look(Series(name, "float64", "chosen"))) for name in seen]
    gray = {"color": QUIET, "markeredgecolor": QUIET}
    entries.append(
        ("float64", _look(Series("chin4", "float64", "chosen")) | gray | {"markerfacecolor": QUIET})
    )
    entries += [
        (single, _look(Series("chin4", single, "chosen")) | gray) for single in ("float32", "mixed")
    ]
    one = _look(Series("chin4", "float64", "one")) | gray | {"markerfacecolor": QUIET}
    entries.append(("one contact sub-step", one))
    ring = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "linestyle": "none"}
    entries.append(("recommended step", gray | ring))
    band = {"color": "#f0f1f3", "linewidth": 9}
    entries.append(("truth not known so well", band))
    handles = [Line2D([], [], label=label, **look) for label, look in entries]
    legend = ax.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0),
        frameon=False,
        ncols=columns,
        fontsize=10.5,
        labelspacing=0.8,
    )
    note = ax.text(
        0.03, 0.14, EXPLANATION, transform=ax.transAxes, fontsize=9.5, color=QUIET, linespacing=1.4
    )
    for artist in (legend, note):
        artist.set_in_layout(False)  # they may reach into the next, empty panel
