"""What every form of a robot in a stage has in common: how it moves as a whole, its space, colours.

The body as a whole moves with an Xform, the best rigid fit, and the form only carries what is left:
interpolated frames then turn instead of shrinking, numbers stay small far from the origin, and a
viewer that cannot animate the form still moves it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Sdf, Usd, UsdGeom, Vt  # noqa: TID253

from warp_springs.io.usd.geometry import Detail
from warp_springs.io.usd.layout import Paint
from warp_springs.io.usd.poses import quaternions, rigid_fit
from warp_springs.io.usd.stage import Looks, constant_color, indexed_color, vec3f
from warp_springs.robot import Robot
from warp_springs.view import appearance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

_TURN_BYTES = 300
"""Memory in which the turn of a mass is computed, for each mass and each spring."""
_EXTENT_FRAMES = 8
"""Frames between two samples of an extent; each sample holds for all frames around it."""


class Body(ABC):
    """Writes one robot: the prims on construction, then frames in any number of calls.

    Args:
        xform: The robot's prim; its transform will be animated.
        robot: What is drawn of the body; its initial positions are the rest pose.
        paint: The colours of its bars.
        looks: The materials of the stage.
        radii: Of the bars and of the balls [m].
        detail: How finely they are meshed.
        bent: Whether its masses turn on their own, so that bars stay round where it bends.
        far: Whether it goes so far that its place needs double precision.
        gone: The frame from which each bar is hidden because its spring broke, shape (S,).
    """

    def __init__(
        self,
        xform: UsdGeom.Xform,
        robot: Robot,
        paint: Paint,
        looks: Looks,
        radii: tuple[float, float],
        detail: Detail,
        bent: bool,
        far: bool,
        gone: FloatArray,
    ) -> None:
        self._path = xform.GetPath()
        self._stage: Usd.Stage = xform.GetPrim().GetStage()
        self._robot, self._paint, self._looks = robot, paint, looks
        self._rest = robot.positions - robot.positions.mean(axis=0)
        self._bar, self._ball = radii
        self._detail, self._bent, self._gone = detail, bent, gone
        self._reach = 1.001 * max(self._bar, self._ball)
        self._turned: FloatArray | None = None
        self._boxes: list[FloatArray] = []
        self._shown: IntArray | None = None
        precision = UsdGeom.XformOp.PrecisionDouble if far else UsdGeom.XformOp.PrecisionFloat
        self._points = Vt.Vec3dArray if far else Vt.Vec3fArray
        self._translate, self._orient = xform.AddTranslateOp(precision), xform.AddOrientOp()
        self._colors: Usd.Attribute | None = None
        self._build()

    @property
    def bytes_a_frame(self) -> int:
        """Memory that one frame takes while it is written."""
        work = _TURN_BYTES * (len(self._rest) + self._robot.n_springs) if self._bent else 0
        return self._sample_bytes + work

    @property
    @abstractmethod
    def _sample_bytes(self) -> int:
        """Memory of the samples of one frame."""

    @abstractmethod
    def _build(self) -> None:
        """Define the prims in the rest pose; set ``_colors`` to the indices of colours, if any."""

    @abstractmethod
    def _write_shape(self, first: int, local: FloatArray) -> None:
        """Write frames of masses in the robot's own frame [m], shape (F, M, 3)."""

    @abstractmethod
    def _hide(self, gone: NDArray[np.bool_], time: int) -> None:
        """Hide the bars of broken springs (S,) in a frame, and show the others."""

    @abstractmethod
    def _extents(self) -> list[Usd.Attribute]:
        """The attributes that say what space the whole robot takes."""

    def _spread(self, colors: IntArray) -> IntArray:
        """Colours of springs (S,) or (F, S) as colours of what is drawn."""
        return colors

    def write(self, first: int, positions: FloatArray, colors: IntArray | None) -> None:
        """Write consecutive frames.

        Args:
            first: Time code of the first frame; the others follow by one.
            positions: Where the masses are in the world [m], shape (F, M, 3).
            colors: Row of the palette for each spring, shape (F, S), or ``None`` to leave them.
        """
        centres, rotations = rigid_fit(self._rest, positions)
        turns = quaternions(rotations, self._turned)
        self._turned = turns[-1]
        local = (positions - centres[:, None]) @ rotations
        low, high = local.min(axis=1) - self._reach, local.max(axis=1) + self._reach
        self._boxes.append(np.stack([low, high], axis=1))
        self._write_moves(first, centres, turns)
        self._write_shape(first, local)
        self._write_breaks(first, first + len(positions))
        if colors is not None and self._colors is not None:
            self._write_colors(first, colors)

    def finish(self) -> None:
        """Write what is known only after the last frame: the extents."""
        boxes = np.concatenate(self._boxes)
        last = len(boxes) - 1
        times = sorted({*range(0, last, _EXTENT_FRAMES), last})
        for time in times:
            around = boxes[max(time - _EXTENT_FRAMES, 0) : time + _EXTENT_FRAMES + 1]
            value = vec3f([around[:, 0].min(axis=0), around[:, 1].max(axis=0)])
            for extent in self._extents():
                extent.Set(value, time)

    def _write_moves(self, first: int, centres: FloatArray, turns: FloatArray) -> None:
        moves = zip(
            self._points.FromNumpy(np.ascontiguousarray(centres)),
            Vt.QuatfArray.FromNumpy(turns.astype(np.float32)),
            strict=True,
        )
        for time, (centre, turn) in enumerate(moves, start=first):
            if time == 0:
                self._translate.Set(centre)
                self._orient.Set(turn)
            self._translate.Set(centre, time)
            self._orient.Set(turn, time)

    def _write_breaks(self, first: int, end: int) -> None:
        """Bars vanish in the frame of their break; in the one before they are still whole."""
        frames = self._gone[np.isfinite(self._gone)].astype(int).tolist()
        changes = {time for frame in frames for time in (0, frame - 1, frame)}
        for time in sorted(changes.intersection(range(first, end))):
            self._hide(self._gone <= time, time)

    def _write_colors(self, first: int, colors: IntArray) -> None:
        """Colour indices hold until the next sample: frames without a change need none."""
        before = colors[:1] - 1 if self._shown is None else self._shown
        changed = (np.diff(colors, axis=0, prepend=before) != 0).any(axis=1)
        spread = self._spread(colors)
        for k in np.flatnonzero(changed).tolist():
            self._colors.Set(Vt.IntArray.FromNumpy(spread[k]), first + k)
        self._shown = colors[-1:]

    def _paint_on(self, prim: UsdGeom.Gprim) -> None:
        """Give bars their colours, one for each face or curve."""
        rows = self._spread(self._paint.rest)
        primvar = indexed_color(prim, UsdGeom.Tokens.uniform, self._paint.palette, rows)
        self._colors = primvar.GetIndicesAttr()

    def _paint_masses(
        self, prim: UsdGeom.Gprim, interpolation: str, masses: IntArray
    ) -> NDArray[np.bool_]:
        """Give elements that stand for masses their colours; returns which stand for held ones."""
        held = np.isin(masses, self._robot.elements.bonds.masses)
        if held.any():
            indexed_color(prim, interpolation, [appearance.MASS, appearance.HELD], held)
        else:
            constant_color(prim, appearance.MASS)
        return held

    def _child(self, parent: Sdf.Path, name: str) -> Sdf.Path:
        """A path whose last name is unique in the file: some viewers animate by name alone."""
        return parent.AppendChild(f"{self._path.name}_{name}")

    def _rest_extent(self) -> Vt.Vec3fArray:
        return vec3f([self._rest.min(axis=0) - self._reach, self._rest.max(axis=0) + self._reach])
