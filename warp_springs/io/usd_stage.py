"""What every stage needs around its robots: metadata, materials, floor, lights and a camera."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt  # noqa: TID253

from warp_springs.io.usd_geometry import checker
from warp_springs.view import appearance
from warp_springs.view.camera import Camera

FloatArray = NDArray[np.float64]

WORLD = Sdf.Path("/World")
ROBOTS = WORLD.AppendChild("Robots")
SCENERY = ("World", "Robots", "Looks", "Ground", "Lights", "Key", "Sky", "Camera")
"""Names of prims that no robot may take."""

_LOOKS = WORLD.AppendChild("Looks")
_STRESS_PRIMVAR = "displayColor"
_FLOOR_PER_DISTANCE = 2.8
_MOST_TILES = 80
"""Between the middle of the floor and its edge."""


class Looks(NamedTuple):
    """The materials of a stage."""

    stress: UsdShade.Material
    mass: UsdShade.Material
    skin: UsdShade.Material
    ground_light: UsdShade.Material
    ground_dark: UsdShade.Material


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


def add_looks(stage: Usd.Stage) -> Looks:
    """Define the materials, all UsdPreviewSurface, in the colours that every view shares."""
    UsdGeom.Scope.Define(stage, _LOOKS)
    looks = Looks(
        stress=_material(stage, "Stress", appearance.NEUTRAL, 0.5),
        mass=_material(stage, "Mass", appearance.MASS, 0.35),
        skin=_material(stage, "Skin", appearance.SKIN, 0.6),
        ground_light=_material(stage, "GroundLight", appearance.GROUND_LIGHT, 0.9),
        ground_dark=_material(stage, "GroundDark", appearance.GROUND_DARK, 0.9),
    )
    _read_color(stage, looks.stress, _STRESS_PRIMVAR, appearance.NEUTRAL)
    return looks


def define_mesh(
    stage: Usd.Stage,
    path: Sdf.Path,
    points: ArrayLike,
    faces: NDArray[np.int32],
    normals: ArrayLike | None = None,
) -> UsdGeom.Mesh:
    """A polygon mesh with its extent: points (V, 3) [m], faces (faces, corners)."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = np.asarray(points, dtype=np.float32)
    mesh.CreatePointsAttr(vec3f(points))
    mesh.CreateFaceVertexCountsAttr(ints(np.full(len(faces), faces.shape[1])))
    mesh.CreateFaceVertexIndicesAttr(ints(faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(vec3f([points.min(axis=0), points.max(axis=0)]))
    if normals is not None:
        mesh.CreateNormalsAttr(vec3f(normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    return mesh


def bind(prim: UsdGeom.Imageable | UsdGeom.Subset, material: UsdShade.Material) -> None:
    """Give a prim its material."""
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def constant_color(mesh: UsdGeom.Mesh, color: ArrayLike) -> None:
    """One display colour, linear RGB (3,), for viewers that ignore materials."""
    mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(vec3f([color]))


def add_ground(
    stage: Usd.Stage, looks: Looks, middle: FloatArray, distance: float, size: float, ball: float
) -> None:
    """The floor z = 0 as a checker of two materials.

    Args:
        stage: Where to put it.
        looks: The materials of the stage.
        middle: Point around which it lies [m], shape (3,).
        distance: How far from there the camera stands [m]; the floor fills its picture.
        size: Length of a body [m]; the tiles are a round length somewhat below it.
        ball: Radius of a ball [m]; the floor is drawn lower by it, so that balls rest on it.
    """
    half = _FLOOR_PER_DISTANCE * distance
    tile = _round_length(max(0.7 * size, half / _MOST_TILES))
    points, quads, dark = checker(int(np.ceil(half / tile)), tile)
    points += [*(tile * np.rint(middle[:2] / tile)), -ball]
    ground = define_mesh(stage, WORLD.AppendChild("Ground"), points, quads)
    Usd.ModelAPI(ground).SetKind("component")
    constant_color(ground, appearance.GROUND_LIGHT)
    halves = (("Light", ~dark, looks.ground_light), ("Dark", dark, looks.ground_dark))
    family = UsdShade.Tokens.materialBind
    for name, tiles, material in halves:
        subset = UsdGeom.Subset.CreateGeomSubset(
            ground, name, UsdGeom.Tokens.face, ints(np.flatnonzero(tiles)), family
        )
        bind(subset, material)
    UsdGeom.Subset.SetFamilyType(ground, family, UsdGeom.Tokens.partition)


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
    view = Camera.framing(corners, (16, 9), margin=1.1)
    focal_length = 40.0
    height = 2.0 * focal_length * float(np.tan(np.radians(view.field_of_view) / 2.0))
    camera = UsdGeom.Camera.Define(stage, WORLD.AppendChild("Camera"))
    camera.CreateFocalLengthAttr(focal_length)
    camera.CreateVerticalApertureAttr(height)
    camera.CreateHorizontalApertureAttr(height * 16.0 / 9.0)
    look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*view.eye), Gf.Vec3d(*view.target), Gf.Vec3d.ZAxis())
    camera.AddTransformOp().Set(look.GetInverse())
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * view.distance, 50.0 * view.distance))
    camera.CreateFocusDistanceAttr(view.distance)
    return view.distance


def vec3f(rows: ArrayLike) -> Vt.Vec3fArray:
    """Rows (n, 3) of any type as USD's array of float vectors."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))


def ints(values: ArrayLike) -> Vt.IntArray:
    """Integers (n,) as USD's array."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))


def _material(
    stage: Usd.Stage, name: str, color: tuple[float, float, float], roughness: float
) -> UsdShade.Material:
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
    fallback: tuple[float, float, float],
) -> None:
    """Let a material take its colour from a primvar of the mesh that wears it."""
    reader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Color"))
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
    reader.CreateInput("fallback", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(*fallback))
    output = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    surface = UsdShade.Shader(stage.GetPrimAtPath(material.GetPath().AppendChild("Surface")))
    surface.GetInput("diffuseColor").ConnectToSource(output)


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))
