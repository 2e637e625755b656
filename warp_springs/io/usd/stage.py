"""What every stage is made of: its metadata, its materials, and meshes that wear them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt  # noqa: TID253

from warp_springs.io.usd.geometry import Part
from warp_springs.view import appearance

FloatArray = NDArray[np.float64]
Rgb = tuple[float, float, float]

WORLD = Sdf.Path("/World")
ROBOTS = WORLD.AppendChild("Robots")
OBSTACLES = WORLD.AppendChild("Obstacles")
PUSHES = WORLD.AppendChild("Pushes")
TETHERS = WORLD.AppendChild("Tethers")
SCENERY = (
    "World",
    "Robots",
    "Looks",
    "Ground",
    "Obstacles",
    "Pushes",
    "Tethers",
    "Water",
    "Lights",
    "Key",
    "Sky",
    "Camera",
    "Follow",
    "FollowCamera",
)
"""Names of prims that no robot may take."""

WATER_OPACITY = 0.45
"""Of the surface of water."""
_LOOKS = WORLD.AppendChild("Looks")
_COLOR_PRIMVAR = "displayColor"


class Looks(NamedTuple):
    """The materials of a stage; ``kinds`` are those of bars coloured by what they are made of."""

    bars: UsdShade.Material
    mass: UsdShade.Material
    held: UsdShade.Material
    skin: UsdShade.Material
    ground_light: UsdShade.Material
    ground_dark: UsdShade.Material
    obstacle: UsdShade.Material
    push: UsdShade.Material
    water: UsdShade.Material
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
        held=_material(stage, "Held", appearance.HELD, 0.35),
        skin=_material(stage, "Skin", appearance.SKIN, 0.6),
        ground_light=_material(stage, "GroundLight", appearance.GROUND_LIGHT, 0.9),
        ground_dark=_material(stage, "GroundDark", appearance.GROUND_DARK, 0.9),
        obstacle=_material(stage, "Obstacle", appearance.OBSTACLE, 0.9),
        push=_material(stage, "Push", appearance.PUSH, 0.5),
        water=_material(stage, "Water", appearance.WATER, 0.1, WATER_OPACITY),
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


def indexed_color(
    prim: UsdGeom.Gprim, interpolation: str, palette: ArrayLike, rows: ArrayLike
) -> UsdGeom.Primvar:
    """Display colours from a table, linear RGB (K, 3): one of its rows for each element."""
    primvar = prim.CreateDisplayColorPrimvar(interpolation)
    primvar.Set(vec3f(palette))
    primvar.SetIndices(ints(rows))
    return primvar


def vec3f(rows: ArrayLike) -> Vt.Vec3fArray:
    """Rows (n, 3) of any type as USD's array of float vectors."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))


def ints(values: ArrayLike) -> Vt.IntArray:
    """Integers (n,) as USD's array."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, dtype=np.int32))


def _material(
    stage: Usd.Stage, name: str, color: Rgb, roughness: float, opacity: float = 1.0
) -> UsdShade.Material:
    """A UsdPreviewSurface of one linear RGB colour."""
    material = UsdShade.Material.Define(stage, _LOOKS.AppendChild(name))
    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    if opacity < 1.0:
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(opacity)
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
