"""What all plots share: the palette, how axes are dressed, SI prefixes, the figure itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_springs.result import Result

ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PINK = (
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
"""The palette of Okabe and Ito, which the colour-blind can tell apart."""
INK, GREY = "#1f2328", "#8a8d91"
SERIES = (BLUE, RED, GREEN, PINK, ORANGE, SKY, INK)
"""Colours of several robots in one plot, in this order, then again."""

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}


def figure(width: float = 9.0, height: float = 5.2) -> Figure:
    """Return an empty figure, sizes in inches, that needs no display and belongs to its caller."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    new = Figure(figsize=(width, height), dpi=150, layout="constrained", facecolor="white")
    FigureCanvasAgg(new)
    return new


def overview(result: Result, robot: int = 0) -> Figure:
    """Return a page with every plot of one robot: energies, motion, feet, forces, way.

    Args:
        result: A run with ``fps=`` and ``energy=True``.
        robot: Index of a recorded robot.

    Raises:
        ValueError: The result holds no energies, or the robot was not recorded.
    """
    from warp_springs.view import plots

    page = figure(13.0, 11.0)
    left = (plots.energies, plots.height, plots.speed)
    right = (plots.trajectory, plots.footfall, plots.stress_histogram)
    for half, drawn in zip(page.subfigures(1, 2), (left, right), strict=True):
        for ax, plot in zip(half.subplots(len(drawn)), drawn, strict=True):
            plot(ax, result, robot)
    return page


def index_of(result: Result, robot: int) -> int:
    """Return the index of a robot, counted from the last one if negative, or refuse it."""
    count = len(result.robots)
    if not -count <= robot < count:
        raise ValueError(f"robot: got {robot}, expected 0 to {count - 1}")
    return robot % count


def centers_of_mass(result: Result, robot: int) -> NDArray[np.float64]:
    """Return the centre of mass of a recorded robot in every frame [m], (F, 3)."""
    masses = result.robots[robot].masses
    return np.einsum("m,fmx->fx", masses / masses.sum(), result.frames(robot))


def with_prefix(values: ArrayLike, unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which the largest of some values reads 1 ... 1000."""
    finite = np.abs(np.asarray(values, np.float64))
    largest = float(np.max(finite[np.isfinite(finite)], initial=0.0))
    power = 3 * int(np.floor(np.log10(largest) / 3)) if largest > 0.0 else 0
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return 10.0**-power, _PREFIXES[power] + unit


def dress(ax: Axes, x: str, y: str) -> Axes:
    """Name both axes and take away what says nothing."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.grid(color=GREY, alpha=0.22, linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def over_time(ax: Axes, result: Result, y: str) -> Axes:
    """Finish axes whose abscissa is the time of the run [s]."""
    if len(result.times) > 1:
        ax.set_xlim(result.times[0], result.times[-1])
    return dress(ax, "time [s]", y)


def legend_above(ax: Axes, columns: int = 6) -> None:
    """Write the legend in a row above the plot, where it hides nothing."""
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        frameon=False,
        handlelength=1.3,
        columnspacing=1.2,
        borderaxespad=0.2,
        fontsize="small",
    )
