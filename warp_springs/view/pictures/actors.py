"""The robots of a picture or a film: where their masses are, and what colour their bars have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.robot import Robot
from warp_springs.view import appearance
from warp_springs.view.look import Look, checked_frame
from warp_springs.view.palette import material_palette
from warp_springs.view.pictures.painting import (
    Actuation,
    Motion,
    Paint,
    Stress,
    motion_at_end,
    recorded_motion,
)

if TYPE_CHECKING:
    from warp_springs.result import Result

FloatArray = NDArray[np.float64]
_CALM = 0.5
"""Longest time in s over which the way of a robot is smoothed."""


@dataclass
class Actor:
    """One robot that is shown, and its motion.

    Attributes:
        body: The robot.
        times: Times of the frames [s], (F,).
        frames: Positions [m], (F, M, 3), all finite.
        paint: Colours of its bars.
        bar: Radius of its bars [m].
        ball: Radius of its spheres [m].
        broken: When each of its springs broke [s], (S,); NaN for those that hold.
        calm: Longest time over which its way is smoothed [s]; 0 where nothing shakes it.
        offset: How far it is moved to its place in the picture [m], (3,).
    """

    body: Robot
    times: FloatArray
    frames: FloatArray
    paint: Paint
    bar: float
    ball: float
    broken: FloatArray
    calm: float
    offset: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def scale(self) -> float | None:
        """What is shown in full colour: a force [N] or a strain; None: colours have no scale."""
        return self.paint.scale

    @property
    def low(self) -> FloatArray:
        """Lowest corner of its box in each frame, before it is moved [m], (F, 3)."""
        return self.frames.min(axis=1) - self.ball

    @property
    def high(self) -> FloatArray:
        """Highest corner of its box in each frame, before it is moved [m], (F, 3)."""
        return self.frames.max(axis=1) + self.ball

    @property
    def cycle(self) -> float:
        """Time in which its muscles repeat themselves [s]; infinite without muscles."""
        muscles = self.body.is_actuated and self.body.omega != 0.0
        return 2 * math.pi / abs(self.body.omega) if muscles else math.inf

    @cached_property
    def calm_way(self) -> FloatArray:
        """Way of its centre of mass, smoothed over a cycle, before it is moved [m], (F, 3)."""
        masses = self.body.masses
        way = np.einsum("m,fmx->fx", masses / masses.sum(), self.frames)
        return _calm_way(self.times, way, min(self.cycle / 2, self.calm))

    def way(self, time: float) -> FloatArray:
        """The smoothed way at any time, at its place in the picture [m], (3,)."""
        at = [np.interp(time, self.times, self.calm_way[:, axis]) for axis in range(3)]
        return np.array(at) + self.offset

    def positions(self, time: float) -> FloatArray:
        """Positions at any time, at its place in the picture [m], (M, 3)."""
        return between(self.times, self.frames, time) + self.offset

    def holding(self, time: float) -> NDArray[np.bool_]:
        """Which of its springs are not broken at a time, (S,)."""
        return ~(self.broken <= time)

    def colors(self, time: float) -> NDArray[np.float32]:
        """Colours of its bars at any time, (S, 3) linear RGB."""
        return self.paint(between(self.times, self.frames, time), time)


def _calm_way(times: FloatArray, way: FloatArray, width: float) -> FloatArray:
    """Return a way, (F, 3) m, smoothed by a bell curve of a width [s]."""
    count, span = len(way), float(times[-1] - times[0])
    if count < 3 or width == 0.0:
        return way
    sigma = min(width, span / 4) * (count - 1) / span
    reach = min(math.ceil(3 * sigma), count - 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-9)) ** 2)
    # mirrored through its ends, so that a steady walk stays steady there
    before, after = 2 * way[0] - way[reach:0:-1], 2 * way[-1] - way[-2 : -reach - 2 : -1]
    long = np.concatenate((before, way, after))
    smooth = [np.convolve(long[:, axis], weights / weights.sum(), "valid") for axis in range(3)]
    return np.column_stack(smooth)


def between(times: FloatArray, frames: FloatArray, time: float) -> FloatArray:
    """Positions at a time between frames: a cubic through four of them (Catmull and Rom's).

    Args:
        times: Increasing, (F,) s.
        frames: (F, M, 3) m.
        time: s; before the first and after the last frame nothing moves.
    """
    i = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
    if i == len(times) - 1 or time <= times[i]:
        return frames[i]
    step = times[i + 1] - times[i]
    u = (time - times[i]) / step
    a, b = max(i - 1, 0), min(i + 2, len(times) - 1)
    start = (frames[i + 1] - frames[a]) * (step / (times[i + 1] - times[a]))
    end = (frames[b] - frames[i]) * (step / (times[b] - times[i]))
    rise = frames[i + 1] - frames[i]
    bent = u * (1 - u) * ((1 - u) * (start - rise) - u * (end - rise))
    return frames[i] + u * rise + bent


def actors_of(
    result: Result, robots: Sequence[int], look: Look, frame: int | None, *, film: bool
) -> list[Actor]:
    """Return the robots that are shown: at one frame, at the end, or in all frames.

    Args:
        result: What `Simulation.run` returned.
        robots: Their indices.
        look: How they are drawn.
        frame: For a picture: which recorded frame; None: the end of the run.
        film: Whether all frames are wanted.
    """
    rows, labels = (
        material_palette([result.robots[i] for i in robots])
        if look.color == "material"
        else ([], [None] * len(robots))
    )
    palette = np.float32([color for _, color in rows])
    return [
        _actor(result, index, look, frame, film, None if label is None else palette[label])
        for index, label in zip(robots, labels, strict=True)
    ]


def _actor(
    result: Result,
    index: int,
    look: Look,
    frame: int | None,
    film: bool,
    fixed: NDArray[np.float32] | None,
) -> Actor:
    body = result.robots[index]
    recorded = index in result.recorded and len(result.times)
    known = recorded_motion(result, index) if recorded else None
    if film:
        motion = known
    elif frame is None:
        motion = motion_at_end(result, index)
    else:
        chosen = checked_frame(frame, len(result.times))
        motion = known.part(slice(chosen, chosen + 1))
    if not np.isfinite(motion.frames).all():
        raise ValueError(f"robot {index}: its positions are not finite, so it cannot be shown")
    bar, ball = (look.thickness * radius for radius in appearance.drawn_radii(body.lengths))
    paint = _paint(body, look.color, motion, known or motion, fixed)
    touching = result.scene.ground is not None or bool(result.scene.obstacles)
    calm = _CALM if touching else 0.0
    return Actor(body, motion.times, motion.frames, paint, bar, ball, result.broken(index), calm)


def _paint(
    body: Robot, color: str, motion: Motion, known: Motion, fixed: NDArray[np.float32] | None
) -> Paint:
    """The colours of a robot's bars; their scale follows from all its frames."""
    if color == "stress":
        return Stress(body, motion, known)
    if color == "actuation":
        return Actuation(body, motion, known)
    plain = np.tile(np.float32(appearance.NEUTRAL), (body.n_springs, 1))
    return Paint(plain if fixed is None else fixed)
