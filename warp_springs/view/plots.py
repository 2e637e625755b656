"""Plots of a run. Each function draws into the axes it is given and returns them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warp_springs.result import Result

__all__ = ["energies", "height"]

_ENERGIES = {
    "kinetic": "#d9822b",
    "gravity": "#6f9bc8",
    "spring": "#b5495b",
    "ground": "#8a8d91",
}
"""The parts of the energy, from the bottom of the stack up, and their colours."""
_INK = "#1f2328"


def energies(ax: Axes, result: Result, robot: int = 0) -> Axes:
    """Draw the energies [J] of a robot over time as a stack, and their total as a line.

    Only differences of gravity's energy mean anything: where it falls below zero it is counted
    from its lowest value, so that the stack stands on zero.

    Args:
        ax: Axes to draw into.
        result: A run with ``energy=True``.
        robot: Index of the robot.

    Raises:
        ValueError: The result holds no energies, or there is no such robot.
    """
    energy = result.energy
    if energy is None:
        raise ValueError("result: it holds no energies; simulate with sim.run(..., energy=True)")
    if not 0 <= robot < len(energy.total):
        raise ValueError(f"robot: got {robot}, expected 0 to {len(energy.total) - 1}")
    layers = {name: getattr(energy, name)[robot] for name in _ENERGIES}
    labels = {name: name for name in layers}
    if layers["gravity"].min() < 0.0:
        layers["gravity"] = layers["gravity"] - layers["gravity"].min()
        labels["gravity"] = "gravity (from its lowest)"
    total = np.sum(list(layers.values()), axis=0)
    ax.stackplot(
        result.times,
        *layers.values(),
        labels=list(labels.values()),
        colors=list(_ENERGIES.values()),
        linewidth=0,
    )
    ax.plot(result.times, total, color=_INK, linewidth=1.4, label="total")
    ax.set_ylabel("energy [J]")
    ax.set_ylim(0.0, 1.08 * float(total.max()) or 1.0)
    ax.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False, handlelength=1.2
    )
    return _over_time(ax, result)


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
    frames = result.frames(robot)
    masses = result.robots[robot].masses
    ax.plot(result.times, frames[:, :, 2] @ masses / masses.sum(), label=f"robot {robot}")
    ax.set_ylabel("height of the centre of mass [m]")
    if result.scene.ground is not None:
        ax.axhline(0.0, color=_ENERGIES["ground"], linewidth=3.0, zorder=1.0)
    return _over_time(ax, result)


def _over_time(ax: Axes, result: Result) -> Axes:
    """Finish axes whose abscissa is the time of the run."""
    ax.set_xlabel("time [s]")
    if len(result.times) > 1:
        ax.set_xlim(result.times[0], result.times[-1])
    ax.spines[["top", "right"]].set_visible(False)
    return ax
