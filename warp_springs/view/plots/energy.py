"""Plots of the energies: what a robot holds, as a stack, and what its ledger cannot explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_springs.view.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warp_springs.energy import Energy
    from warp_springs.result import Result

_HELD = {
    "kinetic": style.ORANGE,
    "gravity": style.SKY,
    "spring": style.GREEN,
    "ground": style.PINK,
}
"""The parts of the energy, from the bottom of the stack up, and their colours."""
_STRIP = (0.0, -0.36, 1.0, 0.26)
"""Where the residual stands below the stack, in units of the axes: left, bottom, width, height."""


def energies(ax: Axes, result: Result, robot: int = 0, *, strip: bool = True) -> Axes:
    """Draw the energies [J] of a robot over time as a stack, and the residual in a strip below.

    Only differences of gravity's energy mean anything: where it falls below zero it is counted
    from its lowest value, so that the stack stands on zero. What was given to the robot and lost
    by it since the start is the dashed line: start + work - losses, where the total belongs.

    Args:
        ax: Axes to draw into. The strip hangs below them, so give them room: a figure with
            ``layout="constrained"``, as that of `figure`, does so by itself.
        result: A run with ``energy=True``.
        robot: Index of the robot.
        strip: Whether to draw the residual, as by `residual`, below the stack.

    Raises:
        ValueError: The result holds no energies, or there is no such robot.
    """
    energy, robot = _energy(result, robot)
    layers = {name: getattr(energy, name)[robot] for name in _HELD}
    labels = {name: name for name in layers}
    lowest = min(0.0, float(layers["gravity"].min()))
    if lowest < 0.0:
        layers["gravity"] = layers["gravity"] - lowest
        labels["gravity"] = "gravity (from its lowest)"
    total = energy.total[robot] - lowest
    ax.stackplot(
        result.times,
        *layers.values(),
        labels=list(labels.values()),
        colors=list(_HELD.values()),
        linewidth=0,
    )
    ax.plot(result.times, total, color=style.INK, linewidth=1.4, label="total")
    owed = total - energy.residual[robot]
    words = "start + work \u2212 losses"
    ax.plot(result.times, owed, color=style.RED, linewidth=1.0, dashes=(3, 3), label=words)
    ax.set_ylim(0.0, 1.08 * float(total.max()) or 1.0)
    style.over_time(ax, result, "energy [J]")
    style.legend_above(ax)
    if strip:
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
        residual(ax.inset_axes(_STRIP), result, robot)
    return ax


def residual(ax: Axes, result: Result, robot: int = 0) -> Axes:
    """Draw what the ledger of a robot's energies cannot account for, over time.

    It is the error of the integrator: change of the total since the start, less work, plus losses.
    Its largest value is written as a part of the largest total.

    Args:
        ax: Axes to draw into.
        result: A run with ``energy=True``.
        robot: Index of the robot.

    Raises:
        ValueError: The result holds no energies, or there is no such robot.
    """
    energy, robot = _energy(result, robot)
    values = energy.residual[robot]
    factor, unit = style.with_prefix(values, "J")
    ax.fill_between(result.times, factor * values, color=style.RED, alpha=0.25, linewidth=0)
    ax.plot(result.times, factor * values, color=style.RED, linewidth=1.1)
    ax.axhline(0.0, color=style.GREY, linewidth=0.8)
    ax.margins(y=0.15)
    ax.locator_params(axis="y", nbins=3)
    style.over_time(ax, result, f"residual\n[{unit}]")
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    whole = float(np.nanmax(np.abs(energy.total[robot]), initial=0.0))
    if whole > 0.0:
        words = f"at most {_percent(100 * largest / whole)} of the largest total"
        ax.text(1.0, 1.02, words, transform=ax.transAxes, ha="right", va="bottom", fontsize="small")
    return ax


def _energy(result: Result, robot: int) -> tuple[Energy, int]:
    """Return the energies of a result and the index of a robot, or refuse."""
    if result.energy is None:
        raise ValueError("result: it holds no energies; simulate with sim.run(..., energy=True)")
    return result.energy, style.index_of(result, robot)


def _percent(share: float) -> str:
    """A share in percent, two digits, never in powers of ten where a person reads it."""
    if share == 0.0:
        return "0 %"
    return f"{share:.2g} %" if share >= 1e-3 else f"{share * 1e4:.2g} ppm"
