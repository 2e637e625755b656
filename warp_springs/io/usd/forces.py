"""Forces from outside, in a stage: pushes as arrows, tethers as thin bars, while they act."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom  # noqa: TID253

from warp_springs.io.usd.geometry import FINE, arrow, balls, tubes
from warp_springs.io.usd.layout import Track
from warp_springs.io.usd.stage import PUSHES, TETHERS, Looks, bind, constant_color, define_mesh
from warp_springs.view import appearance

FloatArray = NDArray[np.float64]

_ARROW = 0.5
"""Length of the arrow of the largest push, in diagonals of its robot."""
_MOST_ARROWS = 16
"""Arrows of one push: a push on a whole body is shown on some of its masses."""
_HIDDEN = 1e-3
"""Scale of what does not act now, for viewers that do not animate visibility."""
_ROPE, _PEG = 0.35, 0.6
"""Radii of a tether and of the point that it holds to, in radii of a bar and of a ball."""


def add_pushes(
    stage: Usd.Stage, looks: Looks, item: Track, frames: FloatArray, offset: FloatArray, name: str
) -> None:
    """An arrow at each mass that is pushed, while it is.

    Args:
        stage: Where to put them.
        looks: The materials of the stage.
        item: The robot.
        frames: Its positions in the frames of the result [m], shape (F, M, 3).
        offset: Where it was moved [m], shape (3,).
        name: Its name in the stage.
    """
    pushes = [push for push in item.robot.elements.pushes if any(push.force)]
    if not pushes:
        return
    _define_group(stage, PUSHES)
    largest = max(np.linalg.norm(push.force) for push in pushes)
    size = float(np.linalg.norm(item.high[0] - item.low[0]))
    for number, push in enumerate(pushes):
        vector = _ARROW * size / largest * np.array(push.force)
        acting = _acting(item, push.start, push.end)
        if not acting.any():
            continue
        part = arrow(vector, item.bar)
        chosen = np.unique(np.linspace(0, len(push.masses) - 1, _MOST_ARROWS).round().astype(int))
        for mass in np.array(push.masses)[chosen].tolist():
            mesh = define_mesh(stage, PUSHES.AppendChild(f"{name}_push{number}_m{mass}"), part)
            constant_color(mesh, appearance.PUSH)
            bind(mesh, looks.push)
            _animate_arrow(mesh, item, frames, acting, mass, vector, offset)


def _animate_arrow(
    mesh: UsdGeom.Mesh,
    item: Track,
    frames: FloatArray,
    acting: NDArray[np.bool_],
    mass: int,
    vector: FloatArray,
    offset: FloatArray,
) -> None:
    """Let an arrow go with its mass, and be seen while its push acts."""
    at = np.asarray(frames[:, mass], np.float64)[item.source]
    begin = int(acting.argmax())
    # What pulls starts at the mass, what pushes ends there: the arrow lies outside the body.
    middle = 0.5 * (item.low[begin] + item.high[begin])
    at = at + offset - (vector if vector @ (at[begin] - middle) < 0.0 else 0.0)
    move, scale = mesh.AddTranslateOp(), mesh.AddScaleOp()
    move.Set(Gf.Vec3d(*at[begin]))
    scale.Set(Gf.Vec3f(1.0 if acting[0] else _HIDDEN))
    for time in _show_while(mesh, acting):
        scale.Set(Gf.Vec3f(1.0 if acting[time] else _HIDDEN), time)
    for time in np.flatnonzero(acting).tolist():
        move.Set(Gf.Vec3d(*at[time]), time)


def add_tethers(
    stage: Usd.Stage, looks: Looks, item: Track, frames: FloatArray, offset: FloatArray, name: str
) -> None:
    """A thin bar from a mass to the point that it is held to, and a ball there, while it is.

    Arguments as in `add_pushes`.
    """
    for number, tether in enumerate(item.robot.elements.tethers):
        acting = _acting(item, tether.start, tether.end)
        if not acting.any():
            continue
        _define_group(stage, TETHERS)
        point = np.add(tether.point, offset)
        at = np.asarray(frames[:, tether.mass], np.float64)[item.source] + offset
        unit = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
        bar = tubes(unit, np.array([[0, 1]]), _ROPE * item.bar, FINE.sides)
        rope = define_mesh(stage, TETHERS.AppendChild(f"{name}_tether{number}"), bar)
        _animate_rope(rope, at, point - at, acting)
        ball = balls(point[None], _PEG * item.ball, FINE.cuts)
        peg = define_mesh(stage, TETHERS.AppendChild(f"{name}_tether{number}_point"), ball)
        _show_while(peg, acting)
        for mesh in (rope, peg):
            constant_color(mesh, appearance.PUSH)
            bind(mesh, looks.push)


def _animate_rope(
    mesh: UsdGeom.Mesh, at: FloatArray, way: FloatArray, acting: NDArray[np.bool_]
) -> None:
    """Stretch a bar of length one along +z from a place along a way, (F, 3) each, while it acts."""
    _show_while(mesh, acting)
    move, turn, scale = mesh.AddTranslateOp(), mesh.AddOrientOp(), mesh.AddScaleOp()
    shown = np.flatnonzero(acting).tolist()
    for time in [None, *shown]:
        moment = [] if time is None else [time]
        here = shown[0] if time is None else time
        length = float(np.linalg.norm(way[here]))
        upright = Gf.Rotation(Gf.Vec3d.ZAxis(), Gf.Vec3d(*way[here]))
        move.Set(Gf.Vec3d(*at[here]), *moment)
        turn.Set(Gf.Quatf(upright.GetQuat()), *moment)
        scale.Set(Gf.Vec3f(1.0, 1.0, max(length, _HIDDEN * _HIDDEN)), *moment)


def _define_group(stage: Usd.Stage, path: Sdf.Path) -> None:
    if not stage.GetPrimAtPath(path):
        Usd.ModelAPI(UsdGeom.Xform.Define(stage, path)).SetKind("group")


def _acting(item: Track, start: float, end: float) -> NDArray[np.bool_]:
    """In which frames something acts (F,); what is shorter than a frame acts in the nearest."""
    acting = (item.times >= start) & (item.times < end)
    if not acting.any() and item.times[0] <= start <= item.times[-1]:
        acting[np.abs(item.times - start).argmin()] = True
    return acting


def _show_while(mesh: UsdGeom.Mesh, acting: NDArray[np.bool_]) -> list[int]:
    """Let a mesh be seen in the frames in which it acts; returns the frames around a change."""
    seen = mesh.CreateVisibilityAttr()
    tokens = {True: UsdGeom.Tokens.inherited, False: UsdGeom.Tokens.invisible}
    seen.Set(tokens[bool(acting[0])])
    changes = np.flatnonzero(np.diff(acting))  # the frame before a change, and the one after
    times = sorted({0, *changes.tolist(), *(changes + 1).tolist()})
    for time in times:
        seen.Set(tokens[bool(acting[time])], time)
    return times
