"""The maps of stability_maps as one figure: a row for each integrator, a column for each axis."""

from pathlib import Path

import numpy as np
from stability_maps import ACCURATE, AXES, INTEGRATORS, Map

__all__ = ["draw"]

INK, PAPER, QUIET = "#1d2733", "#ffffff", "#66717e"
UNSTABLE = "#2b1d2e"
#: From exact to useless: cool while the error is below ACCURATE, warm above.
COOL = ("#0b3c5d", "#1f6f8b", "#5fa8a3", "#a9d3bf", "#e3efd9")
WARM = ("#fbe3a6", "#f5b461", "#e5774a", "#c8442f")
ERRORS = (1e-8, 1e-1)
NOTES = {
    "chin4": "fourth order,\nthree times the work\na step",
    "leapfrog": "second order",
    "euler": "the classroom's,\nfirst order",
}


def draw(maps: list[Map], path: Path) -> None:
    """Draw all maps and save the figure."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style = {
        "font.size": 9.0,
        "text.color": INK,
        "axes.labelcolor": INK,
        "xtick.color": QUIET,
        "ytick.color": QUIET,
        "hatch.linewidth": 0.5,
    }
    with rc_context(style):
        figure = Figure(figsize=(11.4, 9.8), dpi=150, facecolor=PAPER)
        grid = figure.add_gridspec(
            len(INTEGRATORS),
            len(AXES),
            left=0.198,
            right=0.978,
            top=0.862,
            bottom=0.158,
            wspace=0.09,
            hspace=0.1,
        )
        for found in maps:
            row, column = INTEGRATORS.index(found.integrator), AXES.index(found.axis)
            axes = figure.add_subplot(grid[row, column])
            image = _panel(axes, found, label=(row, column) == (0, 0))
            _frame(axes, found, row, column)
        _titles(figure, grid)
        _legend(figure, image)
        figure.savefig(path)


def _colours():
    """Error -> colour, with the change from cool to warm exactly at ACCURATE."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    low, high = np.log10(ERRORS)
    turn = (np.log10(ACCURATE) - low) / (high - low)
    stops = [
        *zip(np.linspace(0.0, turn, len(COOL)), COOL, strict=True),
        *zip(np.linspace(turn, 1.0, len(WARM)), WARM, strict=True),
    ]
    return LinearSegmentedColormap.from_list("error", stops, N=512), LogNorm(*ERRORS)


def _panel(axes, found: Map, label: bool):
    from matplotlib.patheffects import withStroke

    colours, norm = _colours()
    error = np.where(found.unstable, np.nan, np.clip(found.error, *ERRORS))
    axes.set_facecolor(UNSTABLE)
    image = axes.pcolormesh(
        _edges(found.values), _edges(found.steps), error, cmap=colours, norm=norm, linewidth=0
    )
    image.set_edgecolor("face")
    for width, colour in ((3.8, INK), (1.7, PAPER)):
        axes.plot(found.values, found.bound, color=colour, lw=width, solid_capstyle="butt")
    if label:
        text = axes.annotate(
            "ws.stable_dt",
            (found.values[0], found.bound[0]),
            xytext=(7, 5),
            textcoords="offset points",
            color=PAPER,
            fontsize=9.5,
            fontweight="bold",
        )
        text.set_path_effects([withStroke(linewidth=2.6, foreground=INK)])
    return image


def _edges(centres: np.ndarray) -> np.ndarray:
    """Edges of cells whose centres are evenly spaced in their logarithm."""
    logs = np.log(centres)
    inner = (logs[1:] + logs[:-1]) / 2.0
    outer = 2.0 * logs[[0, -1]] - inner[[0, -1]]
    return np.exp(np.concatenate([outer[:1], inner, outer[1:]]))


def _frame(axes, found: Map, row: int, column: int) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(found.values.min(), found.values.max())
    axes.set_ylim(found.steps.min(), found.steps.max())
    axes.set_xticks(10.0 ** np.arange(np.ceil(found.axis.low + 0.5), found.axis.high))
    axes.minorticks_off()
    axes.tick_params(length=3, width=0.6)
    for spine in axes.spines.values():
        spine.set_visible(False)
    if row < len(INTEGRATORS) - 1:
        axes.tick_params(labelbottom=False)
    else:
        axes.set_xlabel(found.axis.label, labelpad=5)
    if column:
        axes.tick_params(labelleft=False)
    else:
        axes.set_ylabel("step dt [s]", labelpad=4)


def _titles(figure, grid) -> None:
    figure.text(
        0.03, 0.955, "How large may a step be?", fontsize=17, fontweight="bold", va="center"
    )
    figure.text(
        0.03,
        0.908,
        "A spinning cube of 28 springs bounces on a corner: how far its masses are from a "
        "reference after 0.3 s.\nWhat does not vary: k = 1000 N/m, m = 0.1 kg, K$_G$ = 10$^5$ N/m.",
        fontsize=9.5,
        color=QUIET,
        va="center",
        linespacing=1.4,
    )
    for row, integrator in enumerate(INTEGRATORS):
        box = grid[row, 0].get_position(figure)
        figure.text(0.03, box.y1 - 0.004, integrator, fontsize=12, fontweight="bold", va="top")
        figure.text(
            0.03,
            box.y1 - 0.031,
            NOTES[integrator],
            fontsize=8.4,
            color=QUIET,
            va="top",
            linespacing=1.35,
        )


def _legend(figure, image) -> None:
    from matplotlib.patches import Rectangle

    axes = figure.add_axes((0.198, 0.068, 0.5, 0.016))
    bar = figure.colorbar(image, cax=axes, orientation="horizontal")
    bar.outline.set_visible(False)
    bar.set_ticks([1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1])
    bar.ax.set_xticklabels(["10 nm", "1 µm", "0.1 mm", "1 mm", "1 cm", "10 cm"])
    bar.ax.minorticks_off()
    bar.ax.tick_params(length=3, width=0.6)
    bar.set_label("rms distance of the masses from the reference", labelpad=3)
    figure.add_artist(Rectangle((0.748, 0.068), 0.026, 0.016, facecolor=UNSTABLE, linewidth=0))
    figure.text(
        0.782,
        0.076,
        "unstable: stopped by its Status,\nor three times the energy",
        fontsize=8.6,
        va="center",
        linespacing=1.3,
    )
