"""The footfall diagram: which masses stand on the floor, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.view.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warp_springs.result import Result

_MOST_NAMED = 24


def footfall(ax: Axes, result: Result, robot: int = 0, *, clearance: float | None = None) -> Axes:
    """Draw a bar for the time that each foot stands on the floor z = 0.

    A foot is a mass that is down in any frame. Feet stand in order along the way that the robot
    went, the front at the top; at the right, the share of the time that each is down.

    Args:
        ax: Axes to draw into.
        result: A run with ``fps=``.
        robot: Index of a recorded robot.
        clearance: Height [m] up to which a mass counts as down; a thousandth of the robot's
            diameter when left out.

    Raises:
        ValueError: The robot was not recorded, the scene has no ground, or the clearance is
            negative.
    """
    style.index_of(result, robot)
    if result.scene.ground is None:
        raise ValueError("result: its scene has no ground, so no foot can stand on it")
    body = result.robots[robot]
    clearance = 1e-3 * body.diameter if clearance is None else clearance
    if not clearance >= 0.0:
        raise ValueError(f"clearance: got {clearance!r}, expected a height >= 0 in m")
    down = result.frames(robot)[:, :, 2] <= clearance
    feet = _from_rear_to_front(result, robot)
    feet = feet[down[:, feet].any(axis=0)]
    for row, foot in enumerate(feet):
        bars = _intervals(down[:, foot], result.times)
        ax.broken_barh(bars, (row - 0.36, 0.72), color=style.BLUE, linewidth=0)
    style.over_time(ax, result, "mass, from rear to front")
    ax.grid(False, axis="y")
    _name_rows(ax, feet, down[:, feet].mean(axis=0))
    return ax


def _from_rear_to_front(result: Result, robot: int) -> NDArray[np.intp]:
    """Return the masses in their order at the start along the way that the robot went."""
    way = style.centers_of_mass(result, robot)
    direction = (way[-1] - way[0])[:2]
    if np.linalg.norm(direction) < 1e-3 * result.robots[robot].diameter:
        direction = np.array([1.0, 0.0])
    return np.argsort(result.frames(robot)[0, :, :2] @ direction, kind="stable")


def _intervals(down: NDArray[np.bool_], times: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return start and length of each stretch of frames that are down, half a frame around each."""
    edges = np.concatenate((times[:1], (times[1:] + times[:-1]) / 2, times[-1:]))
    change = np.diff(np.concatenate(([0], down.astype(np.int8), [0])))
    starts, ends = edges[np.flatnonzero(change == 1)], edges[np.flatnonzero(change == -1)]
    return list(zip(starts.tolist(), (ends - starts).tolist(), strict=True))


def _name_rows(ax: Axes, feet: NDArray[np.intp], share: NDArray[np.float64]) -> None:
    """Write the mass at the left of each row, and the share of time that it is down at the right.

    Of very many rows only some are named.
    """
    count = max(len(feet), 1)
    ax.set_ylim(-0.7, count - 0.3)
    rows = np.arange(0, len(feet), -(-count // _MOST_NAMED))
    ax.set_yticks(rows, [str(feet[row]) for row in rows], fontsize="small")
    ax.tick_params(axis="y", length=0)
    for row in rows:
        ax.text(
            1.01,
            row,
            f"{share[row]:.0%}" if share[row] >= 0.01 else "<1%",
            transform=ax.get_yaxis_transform(),
            va="center",
            fontsize="small",
            color=style.GREY,
        )
    if len(feet) == 0:
        ax.text(0.5, 0.5, "never on the floor", transform=ax.transAxes, ha="center", va="center")
