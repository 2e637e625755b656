"""Rest lengths and tensions of a robot's springs in NumPy, for views and for users."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.geometry import FloatArray

if TYPE_CHECKING:
    from warp_springs.robot import Robot

__all__ = ["controlled", "rest_length_at", "tension"]


def rest_length_at(robot: Robot, t: ArrayLike) -> FloatArray:
    """`Robot.rest_length_at`: the sine, its harmonics and the winch."""
    elements, t = robot.elements, np.asarray(t, np.float64)
    omega = robot.omega
    if elements.omegas is not None:
        omega = np.where(np.isnan(elements.omegas), omega, elements.omegas)
    turn = t[..., None] * omega
    rest = robot.rest_length + robot.amplitude * np.sin(turn + robot.phase)
    if elements.harmonics is not None:
        order = np.arange(2, elements.harmonics.shape[1] + 2)
        angle = np.broadcast_to(turn, rest.shape)[..., None] * order + elements.harmonics[..., 1]
        rest = rest + (elements.harmonics[..., 0] * np.sin(angle)).sum(axis=-1)
    if elements.timetable is not None:
        rest = rest + elements.timetable.at(t)[1]
    return rest


def controlled(robot: Robot, signals: FloatArray) -> FloatArray:
    """By how much controllers change rest lengths [m], (..., S), for their outputs (..., n)."""
    change = np.zeros((*signals.shape[:-1], robot.n_springs))
    first = 0
    for controller in robot.elements.controllers:
        muscles = np.array(controller.muscles)
        asked = signals[..., first + np.array(controller.outputs)]
        if np.ndim(controller.outputs) == 2:  # the mean of two
            asked = asked.mean(axis=-1)
        change[..., muscles] = np.array(controller.reach) * robot.rest_length[muscles] * asked
        first += controller.n_outputs
    return change


def tension(
    robot: Robot, lengths: FloatArray, t: ArrayLike, change: FloatArray | None = None
) -> FloatArray:
    """`Robot.tension` for given lengths [m], (S,) or (F, S)."""
    elements = robot.elements
    stretch = lengths - rest_length_at(robot, t)
    if change is not None:
        stretch = stretch - change
    force = stretch if elements.slope is None else elements.slope * stretch
    if elements.hinges is not None:
        at, part = np.moveaxis(elements.hinges, -1, 0)
        beyond = np.maximum(stretch[..., None] - at, 0.0) - np.maximum(-at, 0.0)
        force = force + (part * beyond).sum(axis=-1)
    force = robot.stiffness * force
    if elements.cubic is not None:
        force = force + elements.cubic * stretch**3
    return force if elements.timetable is None else elements.timetable.at(t)[0] * force
