"""What every stage needs around its robots: metadata, materials, floor, lights and a camera."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt  # noqa: TID253

from warp_springs.io.usd_geometry import Part, checker
from warp_springs.view import appearance
from warp_springs.view.camera import Camera

FloatArray = NDArray[np.float64]
Rgb = tuple[float, float, float]

WORLD = Sdf.Path("/World")
ROBOTS = WORLD.AppendChild("Robots")
SCENERY = ("World", "Robots", "Looks", "Ground", "Lights", "Key", "Sky", "Camera", "FollowCamera")
"""Names of prims that no robot may take."""

_LOOKS = WORLD.AppendChild("Looks")
_COLOR_PRIMVAR = "displayColor"
_PICTURE = (16, 9)
_CALM = 0.4
"""Seconds over which a camera that follows takes the average, as a standard deviation."""
_FLOOR_PER_DISTANCE = 2.8
_MOST_TILES = 80
"""Between the middle of the floor and its edge."""


class Looks(NamedTuple):
    """The materials of a stage; ``kinds`` are those of bars coloured by what they are made of."""

    bars: UsdShade.Material
    mass: UsdShade.Material
    skin: UsdShade.Material
    ground_light: UsdShade.Material
    ground_dark: UsdShade.Material
    kinds: Mapping[str, UsdShade.Material]


def new_stage(path: str, fps: float, n_frames: int) -> Usd.Stage:
    """An empty stage in a new file: z up, metres, frames 0 to ``n_frames - 1`` at ``fps``."""
    stage = Usd.Stage.CreateNew(path)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(n_frames - 1)
    world = UsdGeom.Xform.Define(stage, WORLD)
    stage.SetDefaultPrim(world.GetPrim())
    Usd.ModelAPI(world).SetKind("assembly")
    Usd.ModelAPI(UsdGeom.Xform.Define(stage, ROBOTS)).SetKind("group")
    return stage


def add_looks(stage: Usd.Stage, kinds: Mapping[str, Rgb]) -> Looks:
    """Define the materials, all UsdPreviewSurface, in the colours that every view shares.

    Args:
        stage: Where to put them.
        kinds: Name and colour of what bars are made of, if that is to be seen.
    """
    UsdGeom.Scope.Define(stage, _LOOKS)
    looks = Looks(
        bars=_material(stage, "Bars", appearance.NEUTRAL, 0.5),
        mass=_material(stage, "Mass", appearance.MASS, 0.35),
        skin=_material(stage, "Skin", appearance.SKIN, 0.6),
        ground_light=_material(stage, "GroundLight", appearance.GROUND_LIGHT, 0.9),
        ground_dark=_material(stage, "GroundDark", appearance.GROUND_DARK, 0.9),
        kinds={name: _material(stage, f"Bars_{name}", rgb, 0.5) for name, rgb in kinds.items()},
    )
    _read_color(stage, looks.bars, _COLOR_PRIMVAR, appearance.NEUTRAL)
    return looks


def define_mesh(stage: Usd.Stage, path: Sdf.Path, part: Part) -> UsdGeom.Mesh:
    """A polygon mesh with its extent."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = np.asarray(part.points, dtype=np.float32)
    mesh.CreatePointsAttr(vec3f(points))
    mesh.CreateFaceVertexCountsAttr(ints(np.full(len(part.faces), part.faces.shape[1])))
    mesh.CreateFaceVertexIndicesAttr(ints(part.faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(vec3f([points.min(axis=0), points.max(axis=0)]))
    if part.normals is not None:
        normals = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "normals", Sdf.ValueTypeNames.Normal3fArray, UsdGeom.Tokens.faceVarying
        )
        normals.Set(vec3f(part.normals))
        normals.SetIndices(ints(part.corner_normals.ravel()))
    return mesh


def add_subsets(
    mesh: UsdGeom.Mesh, subsets: Mapping[str, tuple[ArrayLike, UsdShade.Material]]
) -> None:
    """Give parts of a mesh materials of their own: name -> its faces and their material."""
    family = UsdShade.Tokens.materialBind
    for name, (faces, material) in subsets.items():
        subset = UsdGeom.Subset.CreateGeomSubset(
            mesh, name, UsdGeom.Tokens.face, ints(faces), family
        )
        bind(subset, material)
    if subsets:
        UsdGeom.Subset.SetFamilyType(mesh, family, UsdGeom.Tokens.partition)


def bind(prim: UsdGeom.Imageable | UsdGeom.Subset, material: UsdShade.Material) -> None:
    """Give a prim its material."""
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def constant_color(prim: UsdGeom.Gprim, color: ArrayLike) -> None:
    """One display colour, linear RGB (3,), for viewers that ignore materials."""
    prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(vec3f([color]))


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


def add_lights(stage: Usd.Stage) -> None:
    """A sun from the camera's upper left and an even sky; white turns out a little below white."""
    lights = WORLD.AppendChild("Lights")
    UsdGeom.Xform.Define(stage, lights)
    key = UsdLux.DistantLight.Define(stage, lights.AppendChild("Key"))
    key.CreateIntensityAttr(2.0)
    key.CreateAngleAttr(1.5)
    key.CreateNormalizeAttr(True)
    UsdGeom.Xformable(key).AddRotateXYZOp().Set(Gf.Vec3f(38.0, -22.0, 0.0))
    sky = UsdLux.DomeLight.Define(stage, lights.AppendChild("Sky"))
    sky.CreateIntensityAttr(0.4)
    sky.CreateColorAttr(Gf.Vec3f(*appearance.SKY))


def add_camera(stage: Usd.Stage, boxes: FloatArray) -> float:
    """A camera that sees all of every box, (R, 2, 3) [m]; returns how far it stands from them."""
    corners = np.concatenate([boxes[:, pick, range(3)] for pick in np.ndindex(2, 2, 2)])
    view = Camera.framing(corners, _PICTURE, margin=1.1)
    _define_camera(stage, "Camera", view)
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
    move = _define_camera(stage, "FollowCamera", view)
    move.Set(Gf.Vec3d(*view.eye))
    for time, step in enumerate(way):
        move.Set(Gf.Vec3d(*(np.add(view.eye, step))), time)


def _define_camera(stage: Usd.Stage, name: str, view: Camera) -> Usd.Attribute:
    """A camera of the stage; returns where it stands, which may be animated."""
    focal_length = 40.0
    height = 2.0 * focal_length * float(np.tan(np.radians(view.field_of_view) / 2.0))
    camera = UsdGeom.Camera.Define(stage, WORLD.AppendChild(name))
    camera.CreateFocalLengthAttr(focal_length)
    camera.CreateVerticalApertureAttr(height)
    camera.CreateHorizontalApertureAttr(height * _PICTURE[0] / _PICTURE[1])
    look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*view.eye), Gf.Vec3d(*view.target), Gf.Vec3d.ZAxis())
    move = camera.AddTranslateOp()
    move.Set(Gf.Vec3d(*view.eye))
    camera.AddOrientOp().Set(Gf.Quatf(look.GetInverse().ExtractRotationQuat()))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * view.distance, 50.0 * view.distance))
    camera.CreateFocusDistanceAttr(view.distance)
    return move.GetAttr()


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


def vec3f(rows: ArrayLike) -> Vt.Vec3fArray:
    """Rows (n, 3) of any type as USD's array of float vectors."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))


def ints(values: ArrayLike) -> Vt.IntArray:
    """Integers (n,) as USD's array."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))


def _material(stage: Usd.Stage, name: str, color: Rgb, roughness: float) -> UsdShade.Material:
    """A UsdPreviewSurface of one linear RGB colour."""
    material = UsdShade.Material.Define(stage, _LOOKS.AppendChild(name))
    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def _read_color(
    stage: Usd.Stage,
    material: UsdShade.Material,
    primvar: str,
    fallback: Rgb,
) -> None:
    """Let a material take its colour from a primvar of the mesh that wears it."""
    reader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Color"))
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
    reader.CreateInput("fallback", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(*fallback))
    output = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    surface = UsdShade.Shader(stage.GetPrimAtPath(material.GetPath().AppendChild("Surface")))
    surface.GetInput("diffuseColor").ConnectToSource(output)
