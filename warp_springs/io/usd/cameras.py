"""Cameras of a stage: one that sees everything, and one that goes with the robots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom  # noqa: TID253

from warp_springs.io.usd.stage import WORLD
from warp_springs.view.pictures.camera import Camera

FloatArray = NDArray[np.float64]

_PICTURE = (16, 9)
_CALM = 0.4
"""Seconds over which a camera that follows takes the average, as a standard deviation."""


def add_camera(stage: Usd.Stage, boxes: FloatArray) -> float:
    """A camera that sees all of every box, (R, 2, 3) [m]; returns how far it stands from them."""
    corners = np.concatenate([boxes[:, pick, range(3)] for pick in np.ndindex(2, 2, 2)])
    view = Camera.framing(corners, _PICTURE, margin=1.1)
    _define_camera(stage, WORLD.AppendChild("Camera"), view)
    return view.distance


def add_follow_camera(
    stage: Usd.Stage, low: FloatArray, high: FloatArray, times: FloatArray
) -> None:
    """A camera that goes with the robots and sees all of them in every frame.

    Args:
        stage: Where to put it.
        low: Lowest corner of each robot's box in each frame [m], shape (R, F, 3).
        high: Highest corner, shape (R, F, 3).
        times: Times of the frames [s], shape (F,).
    """
    way = _smoothed(0.5 * (low + high).mean(axis=0), times)
    way -= way[0]
    boxes = np.stack([(low - way).min(axis=1), (high - way).max(axis=1)], axis=1)
    corners = np.concatenate([boxes[:, pick, range(3)] for pick in np.ndindex(2, 2, 2)])
    view = Camera.framing(corners, _PICTURE, margin=1.1)
    # Some viewers animate transforms but no cameras: it rides on one.
    carrier = UsdGeom.Xform.Define(stage, WORLD.AppendChild("Follow"))
    move = carrier.AddTranslateOp()
    move.Set(Gf.Vec3d(0.0))
    for time, step in enumerate(way):
        move.Set(Gf.Vec3d(*step), time)
    _define_camera(stage, carrier.GetPath().AppendChild("FollowCamera"), view)


def _define_camera(stage: Usd.Stage, path: Sdf.Path, view: Camera) -> None:
    """A camera of the stage."""
    focal_length = 40.0
    height = 2.0 * focal_length * float(np.tan(np.radians(view.field_of_view) / 2.0))
    camera = UsdGeom.Camera.Define(stage, path)
    camera.CreateFocalLengthAttr(focal_length)
    camera.CreateVerticalApertureAttr(height)
    camera.CreateHorizontalApertureAttr(height * _PICTURE[0] / _PICTURE[1])
    look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*view.eye), Gf.Vec3d(*view.target), Gf.Vec3d.ZAxis())
    camera.AddTranslateOp().Set(Gf.Vec3d(*view.eye))
    camera.AddOrientOp().Set(Gf.Quatf(look.GetInverse().ExtractRotationQuat()))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * view.distance, 50.0 * view.distance))
    camera.CreateFocusDistanceAttr(view.distance)


def _smoothed(way: FloatArray, times: FloatArray) -> FloatArray:
    """A way (F, 3) without what is quicker than `_CALM` seconds: bounces do not shake a camera."""
    if len(way) < 2 or not times[-1] > times[0]:
        return way.copy()
    step = (times[-1] - times[0]) / (len(times) - 1)
    reach = int(np.ceil(3.0 * _CALM / step))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / _CALM) ** 2)
    weights /= weights.sum()
    # Beyond its ends the way goes on as it came: the reflection through its last point.
    index = np.arange(-reach, len(way) + reach)
    last = len(way) - 1
    before, after = np.clip(-index, 0, last), np.clip(2 * last - index, 0, last)
    longer = np.where(
        (index < 0)[:, None],
        2.0 * way[0] - way[before],
        np.where((index > last)[:, None], 2.0 * way[last] - way[after], way[index.clip(0, last)]),
    )
    return np.stack([np.convolve(column, weights, "valid") for column in longer.T], axis=1)
