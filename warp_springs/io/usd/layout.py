"""What an export shows: which robots, under which names, in which frames, and where they stand."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_springs.body.elements import Elements
from warp_springs.body.fields import FIELDS
from warp_springs.robot import Robot
from warp_springs.view import appearance
from warp_springs.view.palette import material_palette

if TYPE_CHECKING:
    from warp_springs.result import Result

FloatArray = NDArray[np.float64]

FARTHEST = 1e6
"""Distance from the origin [m] beyond which a frame shows an explosion and not a robot."""
_BLOCK_VALUES = 2_000_000
_GAP = 0.35
"""Free space between neighbours on the grid, in sides of the largest footprint."""


@dataclass(frozen=True)
class Track:
    """One robot of an export and its motion.

    Attributes:
        index: Its index in the result.
        robot: The body.
        times: Time [s] that each frame shows, shape (F,).
        source: The frame of the result that each frame shows, shape (F,); a frame without finite
            positions repeats the last good one.
        low: Lowest corner of its box in each frame [m], shape (F, 3).
        high: Highest corner of its box in each frame [m], shape (F, 3).
        ball: Radius of the balls at its masses [m].
        bar: Radius of its bars [m].
        gone: The first frame that shows each spring broken, shape (S,); infinite where it holds.
    """

    index: int
    robot: Robot
    times: FloatArray
    source: NDArray[np.int64]
    low: FloatArray
    high: FloatArray
    ball: float
    bar: float
    gone: FloatArray

    @property
    def held_frames(self) -> int:
        """Number of frames that repeat an earlier one for want of finite positions."""
        return int((self.source != np.arange(len(self.source))).sum())

    @property
    def box(self) -> FloatArray:
        """Lowest and highest corner over all frames [m], shape (2, 3)."""
        return np.stack([self.low.min(axis=0), self.high.max(axis=0)])


@dataclass(frozen=True)
class Paint:
    """The colours of a robot's bars.

    Attributes:
        palette: Linear RGB, shape (K, 3); row 0 is what viewers show that know one colour only.
        rest: Row of the palette for each spring where nothing is animated, shape (S,).
        kinds: Name and colour of each row if the rows are what bars are made of; else empty, and
            the colours are those of the stress, in every frame.
    """

    palette: FloatArray
    rest: NDArray[np.int32]
    kinds: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def shows_stress(self) -> bool:
        """Whether the colours follow the stress."""
        return not self.kinds


def chosen_robots(result: Result, robots: Iterable[int] | None) -> list[int]:
    """The indices of the robots to export, all recorded ones by default.

    Raises:
        ValueError: The result holds no frames, a robot was not recorded or is named twice, or
            the choice is empty.
    """
    recorded = [int(i) for i in result.recorded]
    if not recorded or len(result.times) == 0:
        raise ValueError(
            "result: it holds no frames to export; simulate with sim.run(duration, fps=30) and "
            "without record=[]"
        )
    if robots is None:
        return recorded
    chosen = [operator.index(i) for i in robots]
    if not chosen:
        raise ValueError("robots: got an empty choice, expected indices of recorded robots")
    for position, index in enumerate(chosen):
        if index not in recorded:
            raise ValueError(
                f"robots[{position}]: robot {index} was not recorded; recorded are "
                f"{_shortened(recorded)}"
            )
    if len(set(chosen)) < len(chosen):
        raise ValueError(f"robots: got an index twice in {_shortened(chosen)}")
    return chosen


def track(result: Result, index: int) -> Track:
    """Which frames of a recorded robot can be shown, and the space that they take.

    Raises:
        ValueError: No frame has finite positions.
    """
    robot = result.robots[index]
    frames = np.asarray(result.frames(index))
    low, high = _bounds(frames)
    good = ((low >= -FARTHEST) & (high <= FARTHEST)).all(axis=1)  # False for NaN
    if not good.any():
        raise ValueError(
            f"robot {index}: no frame has finite positions within {FARTHEST:g} m of the origin; "
            "leave it out with robots="
        )
    source = np.maximum.accumulate(np.where(good, np.arange(len(good)), 0))
    source = np.maximum(source, good.argmax())
    bar, ball = appearance.drawn_radii(robot.lengths)
    reach = max(bar, ball)
    times = result.clock(index)[source]
    low, high = low[source] - reach, high[source] + reach
    gone = np.searchsorted(times, result.broken(index)).astype(float)  # NaN comes after all times
    gone[gone == len(times)] = np.inf
    return Track(index, robot, times, source, low, high, ball, bar, gone)


def placed(
    tracks: Sequence[Track], spacing: float | None, solids: Sequence[FloatArray] = ()
) -> FloatArray:
    """How far to move each robot to its place on a square grid [m], shape (R, 3); heights stay.

    Each robot starts in the middle of its cell. Without a spacing [m], the cells are as large as
    it takes that no two robots come near each other in any frame: robots that walk side by side
    stand closer than robots that walk towards each other. Solid boxes (2, 3) [m], in the world of
    each robot, do not come near another's robot or solids either.
    """
    start = np.stack([[t.low[0], t.high[0]] for t in tracks])
    footprint = float((start[:, 1, :2] - start[:, 0, :2]).max())
    if spacing is None:
        spacing = _room(tracks, start, solids) + _GAP * footprint
    return appearance.grid_offsets(start, spacing=spacing / footprint)


def frame_rate(times: FloatArray, dt: float) -> float:
    """Frames per second of evenly spaced times [s]; 24, USD's own default, for a single frame.

    Frames sit on steps of dt [s], so their spacing tells the rate to within a step over the whole
    span: a whole number within that is taken to be meant.
    """
    if len(times) < 2:
        return 24.0
    span = float(times[-1] - times[0])
    rate = (len(times) - 1) / span
    return float(round(rate)) if abs(rate - round(rate)) <= rate * dt / span else rate


def unique_names(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """A valid prim name for each name, different from each other and from those taken.

    Characters that USD does not allow become underscores.
    """
    used = {name.lower() for name in taken}
    unique = []
    for wanted in names:
        name = re.sub(r"[^A-Za-z0-9_]", "_", wanted)
        name = name if re.match("[A-Za-z]", name) else f"robot_{name}"
        candidate, count = name, 1
        while candidate.lower() in used:
            count += 1
            candidate = f"{name}_{count}"
        used.add(candidate.lower())
        unique.append(candidate)
    return unique


def paints(robots: Sequence[Robot], color: str) -> list[Paint]:
    """The colours of the bars of robots, by ``"stress"`` or by ``"material"``."""
    if color == "stress":
        palette = appearance.stress_palette().astype(np.float64)
        return [Paint(palette, np.zeros(robot.n_springs, np.int32)) for robot in robots]
    rows, labels = material_palette(robots)
    names = unique_names([name for name, _ in rows])
    kinds = {name: rgb for name, (_, rgb) in zip(names, rows, strict=True)}
    palette = np.array(list(kinds.values()), np.float64).reshape(-1, 3)
    return [Paint(palette, label.astype(np.int32), kinds) for label in labels]


def surface_springs(robot: Robot) -> NDArray[np.intp]:
    """The springs that do not end inside the robot; all of them if it has no faces."""
    outside = np.zeros(robot.n_masses, bool)
    outside[robot.faces] = True
    if not len(robot.faces):
        outside[:] = True
    return np.flatnonzero(outside[robot.springs].all(axis=1))


def with_springs(robot: Robot, kept: NDArray[np.intp]) -> Robot:
    """The robot with some of its springs, as it looks: special springs are not kept as such."""
    if len(kept) == robot.n_springs:
        return robot
    fields = {name: getattr(robot, name)[kept] for name, f in FIELDS.items() if f.per == "spring"}
    return robot.replace(**fields, elements=Elements(bonds=robot.elements.bonds))


def _bounds(frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner in each frame, (F, 3); a piece of a long recording at a time."""
    step = max(1, _BLOCK_VALUES // max(frames[:1].size, 1))
    pieces = [frames[first : first + step] for first in range(0, len(frames), step)]
    low = np.concatenate([piece.min(axis=1) for piece in pieces])
    return low, np.concatenate([piece.max(axis=1) for piece in pieces])


def _room(tracks: Sequence[Track], start: FloatArray, solids: Sequence[FloatArray]) -> float:
    """The least distance of cells [m] at which no two boxes ever overlap.

    In each frame the cells have to be as far apart as the highest reach of any robot beyond its
    starting place lies above the lowest, along x or y.
    """
    middle = start.mean(axis=1)
    low = np.min([t.low - m for t, m in zip(tracks, middle, strict=True)], axis=0)
    high = np.max([t.high - m for t, m in zip(tracks, middle, strict=True)], axis=0)
    for solid in solids:
        low = np.minimum(low, solid[0] - middle.max(axis=0))
        high = np.maximum(high, solid[1] - middle.min(axis=0))
    return float((high - low)[:, :2].max())


def _shortened(indices: Sequence[int]) -> str:
    shown = ", ".join(str(i) for i in indices[:10])
    return f"{shown}, ... ({len(indices)} in all)" if len(indices) > 10 else shown
