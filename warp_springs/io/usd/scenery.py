"""What stands around the robots of a stage: the floor, obstacles, pushes as arrows, and lights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Usd, UsdGeom, UsdLux  # noqa: TID253

from warp_springs.io.usd.geometry import Part, arrow, checker
from warp_springs.io.usd.layout import Track
from warp_springs.io.usd.stage import (
    OBSTACLES,
    PUSHES,
    WORLD,
    Looks,
    add_subsets,
    bind,
    constant_color,
    define_mesh,
)
from warp_springs.scene import Scene
from warp_springs.surfaces import Box, HeightField, Plane, Sphere
from warp_springs.view import appearance
from warp_springs.view.pictures.solids import obstacle_mesh

FloatArray = NDArray[np.float64]

_FLOOR_PER_DISTANCE = 2.8
_MOST_TILES = 80
"""Between the middle of the floor and its edge."""
_ARROW = 0.5
"""Length of the arrow of the largest push, in diagonals of its robot."""
_MOST_ARROWS = 16
"""Arrows of one push: a push on a whole body is shown on some of its masses."""
_HIDDEN = 1e-3
"""Scale of an arrow while its push does not act, for viewers that do not animate visibility."""


def add_ground(
    stage: Usd.Stage, looks: Looks, middle: FloatArray, distance: float, tile: float, ball: float
) -> None:
    """The floor z = 0 as a checker of two materials.

    Args:
        stage: Where to put it.
        looks: The materials of the stage.
        middle: Point around which it lies [m], shape (3,).
        distance: How far from there the camera stands [m]; the floor fills its picture.
        tile: Edge of a tile [m], doubled until the floor has no more than it can have.
        ball: Radius of a ball [m]; the floor is drawn lower by it, so that balls rest on it.
    """
    half = _FLOOR_PER_DISTANCE * distance
    tile *= 2.0 ** max(0, np.ceil(np.log2(half / _MOST_TILES / tile)))
    floor, dark = checker(int(np.ceil(half / tile)), tile)
    floor.points[:] += [*(tile * np.rint(middle[:2] / tile)), -ball]
    ground = define_mesh(stage, WORLD.AppendChild("Ground"), floor)
    Usd.ModelAPI(ground).SetKind("component")
    constant_color(ground, appearance.GROUND_LIGHT)
    light, dark = np.flatnonzero(~dark), np.flatnonzero(dark)
    add_subsets(ground, {"Light": (light, looks.ground_light), "Dark": (dark, looks.ground_dark)})


def add_lights(stage: Usd.Stage, distance: float) -> None:
    """A sun from the camera's upper left and an even sky; white turns out a little below white.

    Args:
        stage: Where to put them.
        distance: How far the camera stands from the robots [m]; the sun is drawn as far.
    """
    lights = WORLD.AppendChild("Lights")
    UsdGeom.Xform.Define(stage, lights)
    key = UsdLux.DistantLight.Define(stage, lights.AppendChild("Key"))
    key.CreateIntensityAttr(1.0)  # Blender takes it for four times as much
    key.CreateAngleAttr(1.5)
    key.CreateNormalizeAttr(True)
    turn = Gf.Rotation(Gf.Vec3d.XAxis(), 38.0) * Gf.Rotation(Gf.Vec3d.YAxis(), -22.0)
    # A sun has no place, but some viewers take its direction from it.
    UsdGeom.Xformable(key).AddTranslateOp().Set(distance * turn.TransformDir(Gf.Vec3d.ZAxis()))
    UsdGeom.Xformable(key).AddOrientOp().Set(Gf.Quatf(turn.GetQuat()))
    sky = UsdLux.DomeLight.Define(stage, lights.AppendChild("Sky"))
    sky.CreateIntensityAttr(0.5)
    sky.CreateColorAttr(Gf.Vec3f(*appearance.SKY))


def add_obstacles(
    stage: Usd.Stage, looks: Looks, scene: Scene, tracks: list[Track], offsets: FloatArray
) -> None:
    """The obstacles around every robot: each has a world of its own.

    Masses are points and the balls around them are not, so obstacles are drawn smaller by the
    radius of a ball, as the floor is drawn lower.

    Args:
        stage: Where to put them.
        looks: The materials of the stage.
        scene: The world of the robots.
        tracks: The robots.
        offsets: Where each was moved [m], shape (R, 3).
    """
    if not scene.obstacles:
        return
    boxes = np.stack([item.box for item in tracks])
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    ball = max(item.ball for item in tracks)
    Usd.ModelAPI(UsdGeom.Xform.Define(stage, OBSTACLES)).SetKind("group")
    for number, obstacle in enumerate(scene.obstacles):
        part = _solid(_smaller(obstacle, ball), box)
        for place, offset in enumerate(np.unique(offsets, axis=0)):
            name = f"{type(obstacle).__name__}_{number}_{place}"
            mesh = define_mesh(stage, OBSTACLES.AppendChild(name), part)
            mesh.AddTranslateOp().Set(Gf.Vec3d(*offset))
            mesh.CreateDoubleSidedAttr(True)
            Usd.ModelAPI(mesh).SetKind("component")
            constant_color(mesh, appearance.OBSTACLE)
            bind(mesh, looks.obstacle)


def _solid(obstacle, box: FloatArray) -> Part:
    """The mesh of an obstacle, flat faces but for a sphere; no vertex shared by flat ones."""
    points, triangles = obstacle_mesh(obstacle, box)
    if isinstance(obstacle, Sphere):
        outward = (points - obstacle.center) / obstacle.radius
        return Part(points, triangles, None, outward, triangles)
    return Part(points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))


def _smaller(obstacle, ball: float):
    """An obstacle whose surface lies lower by the radius of a ball [m]."""
    if isinstance(obstacle, Plane):
        return replace(obstacle, offset=obstacle.offset - ball)
    if isinstance(obstacle, Sphere):
        return replace(obstacle, radius=max(obstacle.radius - ball, 0.5 * obstacle.radius))
    if isinstance(obstacle, Box):
        size = np.array(obstacle.size)
        return replace(obstacle, size=tuple(np.maximum(size - 2.0 * ball, 0.5 * size).tolist()))
    if isinstance(obstacle, HeightField):
        x, y, z = obstacle.origin
        return replace(obstacle, origin=(x, y, z - ball))
    raise TypeError(f"obstacles: got {type(obstacle).__name__}, which cannot be drawn")


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
    if not stage.GetPrimAtPath(PUSHES):
        Usd.ModelAPI(UsdGeom.Xform.Define(stage, PUSHES)).SetKind("group")
    largest = max(np.linalg.norm(push.force) for push in pushes)
    size = float(np.linalg.norm(item.high[0] - item.low[0]))
    for number, push in enumerate(pushes):
        vector = _ARROW * size / largest * np.array(push.force)
        acting = (item.times >= push.start) & (item.times < push.end)
        if not acting.any():  # shorter than a frame, or over before the first
            if not item.times[0] <= push.start <= item.times[-1]:
                continue
            acting[np.abs(item.times - push.start).argmin()] = True
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
    move, scale, seen = mesh.AddTranslateOp(), mesh.AddScaleOp(), mesh.CreateVisibilityAttr()
    tokens = {True: UsdGeom.Tokens.inherited, False: UsdGeom.Tokens.invisible}
    move.Set(Gf.Vec3d(*at[begin]))
    scale.Set(Gf.Vec3f(1.0 if acting[0] else _HIDDEN))
    seen.Set(tokens[bool(acting[0])])
    changes = np.flatnonzero(np.diff(acting))  # the frame before a change, and the one after
    for time in sorted({0, *changes.tolist(), *(changes + 1).tolist()}):
        scale.Set(Gf.Vec3f(1.0 if acting[time] else _HIDDEN), time)
        seen.Set(tokens[bool(acting[time])], time)
    for time in np.flatnonzero(acting).tolist():
        move.Set(Gf.Vec3d(*at[time]), time)
