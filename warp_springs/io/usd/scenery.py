"""What stands around the robots of a stage: the floor, water, obstacles, and lights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Usd, UsdGeom, UsdLux  # noqa: TID253

from warp_springs.io.usd.geometry import Part, checker
from warp_springs.io.usd.layout import Track
from warp_springs.io.usd.stage import (
    OBSTACLES,
    WATER_OPACITY,
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


def add_water(
    stage: Usd.Stage, looks: Looks, level: float, middle: FloatArray, distance: float
) -> None:
    """The surface of water, as wide as the floor, seen from both sides.

    Args:
        stage: Where to put it.
        looks: The materials of the stage.
        level: Its height [m].
        middle: Point around which it lies [m], shape (3,).
        distance: How far from there the camera stands [m].
    """
    half = _FLOOR_PER_DISTANCE * distance
    corners = half * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    part = Part(corners + np.array([*middle[:2], level]), np.array([[0, 1, 2, 3]]))
    water = define_mesh(stage, WORLD.AppendChild("Water"), part)
    water.CreateDoubleSidedAttr(True)
    Usd.ModelAPI(water).SetKind("component")
    constant_color(water, appearance.WATER)
    water.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([WATER_OPACITY])
    bind(water, looks.water)


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
