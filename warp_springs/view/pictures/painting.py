"""The colours of a robot's bars at any moment of its motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.io.usd.layout import track
from warp_springs.robot import Robot
from warp_springs.view import appearance

if TYPE_CHECKING:
    from warp_springs.result import Result

__all__ = ["Actuation", "Motion", "Paint", "Stress", "motion_at_end", "recorded_motion"]

FloatArray = NDArray[np.float64]
Colors = NDArray[np.float32]

_FRAMES_FOR_SCALE = 64


@dataclass(frozen=True)
class Motion:
    """Where a robot is in each of F frames, and what its springs are told there.

    Attributes:
        times: Times of the frames [s], (F,).
        clock: The same, but standing still from when the robot was stopped [s], (F,).
        frames: Positions [m], (F, M, 3).
        asked: What controllers add to rest lengths [m], (F, S), or None.
        change: The same with what yielded, (F, S), or None.
    """

    times: FloatArray
    clock: FloatArray
    frames: FloatArray
    asked: FloatArray | None
    change: FloatArray | None

    def part(self, which: slice) -> Motion:
        """Some of the frames."""
        all_of_it = (self.times, self.clock, self.frames, self.asked, self.change)
        return Motion(*(None if values is None else values[which] for values in all_of_it))

    def clock_at(self, time: float) -> float:
        """The time that muscles go by at a time between frames [s]."""
        return float(np.interp(time, self.times, self.clock))

    def between(self, values: FloatArray | None, time: float) -> FloatArray | None:
        """Values of frames at a time [s] between them, on a straight line."""
        if values is None:
            return None
        last = len(self.times) - 1
        i = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, max(last - 1, 0)))
        j = min(i + 1, last)
        span = self.times[j] - self.times[i]
        share = float(np.clip((time - self.times[i]) / span, 0.0, 1.0)) if span > 0.0 else 0.0
        return (1.0 - share) * values[i] + share * values[j]


def recorded_motion(result: Result, robot: int) -> Motion:
    """All frames of a recorded robot."""
    shown = track(result, robot)
    source = shown.source
    return Motion(
        np.asarray(result.times),
        shown.times,
        np.asarray(result.frames(robot))[source],
        result.rest_length_change(robot, source, yielded=False),
        result.rest_length_change(robot, source),
    )


def motion_at_end(result: Result, robot: int) -> Motion:
    """The end of a run as the only frame."""
    body, clock = result.robots[robot], np.array([result.end_clock(robot)])
    change = result.rest_lengths(robot) - body.rest_length_at(clock)
    asked = change - result.yielded(robot)
    times = np.array([result.end_time])
    return Motion(times, clock, result.positions(robot)[None], asked, change)


class Paint:
    """Colours of bars that stay as they are, (S, 3) linear RGB.

    Attributes:
        scale: What is shown in full colour: a force [N] or a strain; None: colours have no scale.
    """

    scale: float | None = None

    def __init__(self, colors: Colors) -> None:
        self._colors = colors

    def __call__(self, positions: FloatArray, time: float) -> Colors:
        """The colours for positions (M, 3) [m] at a time [s], (S, 3) linear RGB."""
        return self._colors


@dataclass
class Stress(Paint):
    """Colours by the forces in the springs; the scale follows from all frames that are known."""

    body: Robot
    motion: Motion
    known: Motion

    @cached_property
    def scale(self) -> float:
        """The force in full colour [N]."""
        some = self.known.part(_some(self.known))
        return appearance.stress_scale(self.body.tension(some.frames, some.clock, some.change))

    def __call__(self, positions: FloatArray, time: float) -> Colors:
        """As in `Paint`."""
        motion = self.motion
        change = motion.between(motion.change, time)
        force = self.body.tension(positions, motion.clock_at(time), change)
        return appearance.stress_color(force, self.scale)


@dataclass
class Actuation(Paint):
    """Colours by what muscles are told to do."""

    body: Robot
    motion: Motion
    known: Motion

    @cached_property
    def scale(self) -> float | None:
        """The strain in full colour; None where nothing is told."""
        some = self.known.part(_some(self.known))
        largest = float(np.abs(_strain(self.body, some.clock, some.asked)).max(initial=0.0))
        return largest if largest > 1e-9 else None

    def __call__(self, positions: FloatArray, time: float) -> Colors:
        """As in `Paint`."""
        motion = self.motion
        asked = motion.between(motion.asked, time)
        strain = _strain(self.body, motion.clock_at(time), asked)
        return appearance.actuation_color(strain, self.scale or 1.0)


def _some(motion: Motion) -> slice:
    """Frames that are enough to find a scale."""
    return slice(None, None, max(1, len(motion.times) // _FRAMES_FOR_SCALE))


def _strain(body: Robot, time: float | FloatArray, asked: FloatArray | None) -> FloatArray:
    """By which share of it muscles change their rest length, (S,) or (F, S)."""
    told = body.rest_length_at(time)
    told = told if asked is None else told + asked
    return told / np.maximum(body.rest_length, 1e-12) - 1.0
