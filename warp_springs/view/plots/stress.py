"""How the forces of the springs are distributed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_springs.view import appearance
from warp_springs.view.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warp_springs.result import Result

_WIDEST_PERCENTILE = 99.8


def stress_histogram(ax: Axes, result: Result, robot: int = 0, *, bins: int = 61) -> Axes:
    """Draw how often a spring of a robot carries which force, over all springs and frames.

    Colours are those of the pictures: red is tension, blue is compression. The few forces beyond
    the axis are counted in its outermost bars.

    Args:
        ax: Axes to draw into; their vertical scale becomes logarithmic.
        result: A run with ``fps=``.
        robot: Index of a recorded robot.
        bins: How many bars; an odd number has one around zero.

    Raises:
        ValueError: The robot was not recorded or has no springs, or there are no bins.
    """
    style.index_of(result, robot)
    if bins < 1:
        raise ValueError(f"bins: got {bins!r}, expected at least 1")
    force = result.tension_frames(robot)
    force = force[np.isfinite(force)]
    if force.size == 0:
        raise ValueError(f"robot {robot}: it has no spring that carries a force")
    widest = np.percentile(np.abs(force), _WIDEST_PERCENTILE) or appearance.LEAST_STRESS_SCALE
    factor, unit = style.with_prefix(widest, "N")
    edges = np.linspace(-widest, widest, bins + 1)
    counts, _ = np.histogram(np.clip(force, -widest, widest), edges)
    middle = (edges[1:] + edges[:-1]) / 2
    ax.bar(
        factor * middle,
        100 * counts / force.size,
        width=factor * (edges[1] - edges[0]),
        color=appearance.to_screen(appearance.stress_color(middle, appearance.stress_scale(force))),
        edgecolor=style.GREY,
        linewidth=0.4,
    )
    ax.set_yscale("log")
    ax.set_xlim(-factor * widest, factor * widest)
    style.dress(ax, f"force [{unit}]: compression < 0 < tension", "springs and frames [%]")
    low, high = factor * np.percentile(force, (5, 95))
    for end in (low, high):
        ax.axvline(end, color=style.INK, linewidth=0.9, linestyle=":")
    words = f"90 % between {low:.3g} and {high:.3g} {unit} (dotted)".replace("-", "\u2212")
    ax.text(0.0, 1.02, words, transform=ax.transAxes, va="bottom", fontsize="small")
    return ax
