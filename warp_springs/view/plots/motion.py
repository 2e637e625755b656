"""Plots of the centre of mass: its height and speed over time, its way over the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.view.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warp_springs.result import Result


def height(ax: Axes, result: Result, robot: int = 0) -> Axes:
    """Draw the height of a robot's centre of mass [m] over time, above the ground if there is one.

    Several robots can be drawn into the same axes, one call each; add a legend for their labels.

    Args:
        ax: Axes to draw into.
        result: A run with ``fps=``.
        robot: Index of a recorded robot.

    Raises:
        ValueError: The robot was not recorded.
    """
    style.index_of(result, robot)
    values = style.centers_of_mass(result, robot)[:, 2]
    ax.plot(result.times, values, color=_next_color(ax), linewidth=1.6, label=f"robot {robot}")
    if result.scene.ground is not None:
        ax.axhline(0.0, color=style.GREY, linewidth=3.0, zorder=1.0)
    return style.over_time(ax, result, "height of the centre of mass [m]")


def speed(ax: Axes, result: Result, robot: int = 0, *, name: str | None = None) -> Axes:
    """Draw the speed of a robot's centre of mass [m/s] over time.

    The thin line is the speed between neighbouring frames. For a robot with muscles the thick line
    is the speed of its progress over the floor: the horizontal way of a whole cycle over its time.

    Args:
        ax: Axes to draw into.
        result: A run with ``fps=``.
        robot: Index of a recorded robot.
        name: What the legend calls it; "robot 0" by default.

    Raises:
        ValueError: The robot was not recorded, or in fewer than two frames.
    """
    style.index_of(result, robot)
    way, times = style.centers_of_mass(result, robot), result.times
    if len(times) < 2:
        raise ValueError(f"result: a speed needs two frames, {len(times)} were recorded")
    color, name = _next_color(ax), f"robot {robot}" if name is None else name
    between = (times[1:] + times[:-1]) / 2
    now = np.linalg.norm(np.diff(way, axis=0), axis=1) / np.diff(times)
    body = result.robots[robot]
    cycle = 2 * math.pi / abs(body.omega) if body.omega and body.is_actuated else math.inf
    if cycle < times[-1] - times[0]:
        ax.plot(between, now, color=color, linewidth=0.9, alpha=0.5, label=name)
        mean = _progress(way, times, cycle)
        ax.plot(*mean, color=color, linewidth=2.4, label="progress over a cycle")
        style.legend_above(ax)
    else:
        ax.plot(between, now, color=color, linewidth=1.6, label=name)
    ax.set_ylim(bottom=0.0)
    return style.over_time(ax, result, "speed of the centre of mass [m/s]")


def trajectory(ax: Axes, result: Result, robot: int | Sequence[int] = 0) -> Axes:
    """Draw the way of the centre of mass over the floor, seen from above, in m.

    One robot's way darkens with time, with a dot at the end of every cycle (every second without
    muscles) and the outline of its body at the start and at the end. Several robots have a colour
    each.

    Args:
        ax: Axes to draw into; their scales become equal.
        result: A run with ``fps=``.
        robot: Index of a recorded robot, or several.

    Raises:
        ValueError: A robot was not recorded.
    """
    robots = [robot] if np.ndim(robot) == 0 else list(robot)
    for place, one in enumerate(robots):
        style.index_of(result, one)
        color = style.BLUE if len(robots) == 1 else style.SERIES[place % len(style.SERIES)]
        _draw_way(ax, result, one, color)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    if len(robots) > 1:
        style.legend_above(ax)
    return style.dress(ax, "x [m]", "y [m]")


def _draw_way(ax: Axes, result: Result, robot: int, color: str) -> None:
    """Draw the way of one robot."""
    from matplotlib.patheffects import withStroke

    way, times = style.centers_of_mass(result, robot)[:, :2], result.times
    frames, body = result.frames(robot), result.robots[robot]
    for frame, alpha in ((0, 0.10), (-1, 0.22)):
        outline = _outline(frames[frame, :, :2])
        ax.fill(*outline.T, facecolor=color, alpha=alpha, linewidth=0)
        ax.plot(*np.vstack((outline, outline[:1])).T, color=color, linewidth=0.9, alpha=0.7)
    ax.plot(*way.T, color=color, linewidth=1.8, label=f"robot {robot}", zorder=3)
    pace = 2 * math.pi / abs(body.omega) if body.omega and body.is_actuated else 1.0
    marks = np.arange(times[0], times[-1] + 1e-9, pace)
    if len(marks) <= 200:
        dots = [np.interp(marks, times, way[:, axis]) for axis in (0, 1)]
        ax.plot(*dots, "o", color=color, markersize=3.5, markeredgecolor="white", zorder=4)
    for frame in (0, -1):
        ax.annotate(
            f"{times[frame]:.3g} s",
            way[frame],
            xytext=(0, 9),
            textcoords="offset points",
            ha="center",
            fontsize="small",
            color=style.INK,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=5,
        )


def _progress(
    way: NDArray[np.float64], times: NDArray[np.float64], cycle: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and horizontal speed over a cycle around each of them, (K,) each."""
    middle = times[(times >= times[0] + cycle / 2) & (times <= times[-1] - cycle / 2)]
    ends = [
        np.column_stack([np.interp(middle + half, times, way[:, axis]) for axis in (0, 1)])
        for half in (-cycle / 2, cycle / 2)
    ]
    return middle, np.linalg.norm(ends[1] - ends[0], axis=1) / cycle


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the convex hull of points of a plane, (P, 2) -> (H, 2), counter-clockwise.

    Andrew's monotone chain: points in order of x, one chain below and one above.
    """
    points = np.unique(points, axis=0)
    chains: list[NDArray[np.float64]] = []
    for ordered in (points, points[::-1]):
        chain: list[NDArray[np.float64]] = []
        for p in ordered:
            while len(chain) > 1:
                a, b = chain[-1] - chain[-2], p - chain[-1]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                chain.pop()
            chain.append(p)
        chains += chain[:-1] or chain
    return np.array(chains)


def _next_color(ax: Axes) -> str:
    """The colour of the next robot that is drawn into the same axes."""
    used = {line.get_color() for line in ax.lines}
    free = [color for color in style.SERIES if color not in used]
    return free[0] if free else style.SERIES[len(ax.lines) % len(style.SERIES)]
