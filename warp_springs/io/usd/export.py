"""Animations as OpenUSD: `export_usd` writes recorded robots as one stage that opens everywhere."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from warp_springs.checks import check_choice, check_number
from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.io.usd.geometry import COARSE, FINE, Detail
from warp_springs.io.usd.layout import (
    Paint,
    Track,
    chosen_robots,
    frame_rate,
    paints,
    placed,
    surface_springs,
    track,
    unique_names,
    with_springs,
)
from warp_springs.io.usd.notes import facts, provenance, usd_dict
from warp_springs.io.usd.poses import bends
from warp_springs.surfaces import Plane
from warp_springs.view import appearance
from warp_springs.view.pictures.solids import obstacle_mesh

if TYPE_CHECKING:
    from pxr import Tf, Usd, UsdGeom

    from warp_springs.io.usd.body import Body
    from warp_springs.io.usd.stage import Looks
    from warp_springs.result import Result
    from warp_springs.robot import Robot

__all__ = ["export_usd"]

Geometry = Literal["auto", "skel", "points", "mesh"]
Color = Literal["stress", "material"]
Springs = Literal["auto", "all", "surface"]

MOST_JOINTS = 1000
"""Masses of a robot beyond which it is drawn as points and curves, unless asked otherwise."""
_FINE = 4000
"""Masses and springs of a file up to which they are finely meshed; beyond, size counts more."""
_SUFFIXES = (".usdc", ".usda", ".usdz")
_NEAR = 64.0
"""Way from the origin in m up to which single precision places a robot to within 4 um."""
_BLOCK_BYTES = 2_000_000
"""Memory in which frames of a robot are worked out at a time."""
_SAVE_BYTES = 16_000_000
"""Samples held in memory between two saves."""
_SCALE_FRAMES = 64
_SCALE_SPRINGS = 200_000
"""Frames, spread over the animation, that decide what tension takes the full colour and whether a
robot bends: so many, or fewer where they would have more springs than that in all."""


class _Drawn(NamedTuple):
    """A robot to be written."""

    item: Track
    kept: np.ndarray  # the springs that are drawn
    robot: Robot  # with these alone
    geometry: str
    paint: Paint
    offset: np.ndarray
    name: str
    notes: dict[str, Any]


def export_usd(
    result: Result,
    path: str | os.PathLike[str],
    *,
    robots: Iterable[int] | None = None,
    names: Mapping[int, str] | None = None,
    custom_data: Mapping[int, Mapping[str, Any]] | None = None,
    grid: bool = True,
    spacing: float | None = None,
    geometry: Geometry = "auto",
    color: Color = "stress",
    springs: Springs = "auto",
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write recorded robots as an animated OpenUSD stage and return its path.

    The stage is z up, in metres, one time code for each recorded frame. Each robot is an animated
    Xform over its bars, balls at its masses and its exterior faces as a skin. A scene with a ground
    gets a checker floor, drawn below z = 0 by the radius of a ball so that balls rest on it;
    obstacles are drawn where they are, water as a clear surface, pushes as arrows and tethers as
    thin bars while they last. ``/World/Camera`` sees
    every robot in every frame, ``/World/FollowCamera`` goes with them. A robot that was stopped
    stays as it was; its custom data say when and why. The version and the parameters of the
    simulation are in the layer's custom data, under ``warp_springs``.

    Samples go to the disk as they are made, so memory does not grow with the number of frames. The
    file appears whole or not at all: it is written beside its place and then renamed.

    Args:
        result: What `Simulation.run` returned, recorded with ``fps=``, or `Result.load` read.
        path: File to write; ``.usdc`` (binary), ``.usda`` (text) or ``.usdz`` (package).
        robots: Indices of recorded robots; all of them by default.
        names: Name of a robot by its index, made unique and valid; ``robot_0007`` by default.
        custom_data: For a robot by its index, what to keep on its prim: numbers, strings,
            booleans, sequences and nested dicts of them, for example fitness and seed.
        grid: Whether several robots are put on a square grid, each starting in the middle of its
            cell, with its obstacles around it; otherwise all stay where they were simulated.
        spacing: Distance of the cells [m]; by default large enough that no two robots touch in
            any frame.
        geometry: ``"skel"``, a joint for each mass and meshes bound to them: small, and played by
            every viewer; ``"points"``, Points and BasisCurves, for very large bodies, not shown by
            phones, game engines and three.js; ``"mesh"``, meshes with moving vertices, large files
            for whoever knows neither. ``"auto"`` is ``"skel"``, above 1,000 masses ``"points"``.
        color: ``"stress"`` (white neutral, red tension, blue compression; the robot's custom data
            say in ``stressScale`` [N] what the full colour means), or ``"material"`` (what each bar
            is made of, or its class of stiffness where it has no material).
        springs: ``"all"``, or ``"surface"`` for those between corners of the exterior faces;
            ``"auto"`` leaves the inner ones out of bodies above 1,000 masses that have faces.
        progress: Called now and then with the fraction that is done, 0 to 1.

    Raises:
        ValueError: The suffix or a choice is unknown, the result has no frames, a robot was not
            recorded or has no finite frame, a name or custom data belong to a robot that is not
            exported or hold something that USD cannot, or the spacing is not a positive length.
        OSError: The file cannot be written.
    """
    path = checked_output(path, _SUFFIXES)
    check_choice("geometry", geometry, ("auto", "skel", "points", "mesh"))
    check_choice("color", color, ("stress", "material"))
    check_choice("springs", springs, ("auto", "all", "surface"))
    spacing = _checked_spacing(grid, spacing)
    indices = chosen_robots(result, robots)
    names = dict(names or {})
    _check_keys("names", names, indices)
    _check_keys("custom_data", custom_data, indices)
    notes = {
        index: usd_dict(data, f"custom_data[{index}]")
        for index, data in (custom_data or {}).items()
    }
    tracks = [track(result, index) for index in indices]
    kept = [_kept(item.robot, springs) for item in tracks]
    shown = [with_springs(item.robot, some) for item, some in zip(tracks, kept, strict=True)]
    on_grid = grid and len(tracks) > 1
    drawn = [
        _Drawn(*each)
        for each in zip(
            tracks,
            kept,
            shown,
            [_chosen_geometry(item.robot, geometry) for item in tracks],
            paints(shown, color),
            placed(tracks, spacing, _solid_boxes(result))
            if on_grid
            else np.zeros((len(tracks), 3)),
            [str(names.get(index, f"robot_{index:04d}")) for index in indices],
            [notes.get(index, {}) for index in indices],
            strict=True,
        )
    ]
    with _renamed_when_done(path) as draft:
        _write(result, draft, drawn, progress)
    return path


def _write(
    result: Result, draft: Path, drawn: list[_Drawn], progress: Callable[[float], None] | None
) -> None:
    """Write the whole stage into a new binary file."""
    from pxr import Usd, UsdGeom

    from warp_springs.io.usd import stage as usd_stage

    stage = usd_stage.new_stage(str(draft), frame_rate(result.times, result.dt), len(result.times))
    stage.GetRootLayer().customLayerData = {"warp_springs": provenance(result)}
    looks = usd_stage.add_looks(stage, drawn[0].paint.kinds)
    _add_surroundings(stage, looks, result, drawn)
    prims = unique_names([each.name for each in drawn], usd_stage.SCENERY)
    saver = _Saver(stage, len(drawn), progress)
    few = sum(each.robot.n_masses + each.robot.n_springs for each in drawn) <= _FINE
    detail = FINE if few else COARSE
    for each, prim in zip(drawn, prims, strict=True):
        xform = UsdGeom.Xform.Define(stage, usd_stage.ROBOTS.AppendChild(prim))
        xform.GetPrim().SetDisplayName(each.name)
        Usd.ModelAPI(xform).SetKind("component")
        scale = _write_motion(xform, looks, detail, result, each, saver)
        data = {"warp_springs": facts(result, each.item, scale)} | each.notes
        xform.GetPrim().SetCustomData(data)
    stage.Save()
    saver.done()


def _add_surroundings(stage: Usd.Stage, looks: Looks, result: Result, drawn: list[_Drawn]) -> None:
    """Cameras, floor, obstacles and lights around the space that the robots take."""
    from warp_springs.io.usd import cameras as usd_cameras
    from warp_springs.io.usd import scenery as usd_scenery

    tracks, offsets = [each.item for each in drawn], np.stack([each.offset for each in drawn])
    low = np.stack([item.low for item in tracks]) + offsets[:, None]
    high = np.stack([item.high for item in tracks]) + offsets[:, None]
    boxes = np.stack([low.min(axis=1), high.max(axis=1)], axis=1)
    distance = usd_cameras.add_camera(stage, boxes)
    usd_cameras.add_follow_camera(stage, low, high, result.times)
    if result.scene.ground is not None:
        tile = appearance.tile_size(np.linalg.norm(high[:, 0] - low[:, 0], axis=1))
        middle = 0.5 * (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0))
        ball = max(item.ball for item in tracks)
        usd_scenery.add_ground(stage, looks, middle, distance, tile, ball)
    if result.scene.water is not None:
        middle = 0.5 * (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0))
        usd_scenery.add_water(stage, looks, result.scene.water.level, middle, distance)
    usd_scenery.add_obstacles(stage, looks, result.scene, tracks, offsets)
    usd_scenery.add_lights(stage, distance)


def _write_motion(
    xform: UsdGeom.Xform,
    looks: Looks,
    detail: Detail,
    result: Result,
    each: _Drawn,
    saver: _Saver,
) -> float:
    """Write one robot in blocks of frames; returns the tension of the full stress colour [N]."""
    from warp_springs.io.usd.forces import add_pushes, add_tethers

    item, frames = each.item, np.asarray(result.frames(each.item.index))
    radii = (item.bar, item.ball)
    most = max(1, min(_SCALE_FRAMES, _SCALE_SPRINGS // max(each.robot.n_springs, 1)))
    sample = _spread(len(frames), most)
    scale = appearance.stress_scale(_tension(result, each, sample))
    bent = each.geometry != "points" and _bends(each.robot, frames[item.source[sample]])
    far = bool(np.abs(item.box + each.offset).max() > _NEAR)
    gone = item.gone[each.kept]
    body = _body(each.geometry)(
        xform, each.robot, each.paint, looks, radii, detail, bent, far, gone
    )
    for add in (add_pushes, add_tethers):
        add(xform.GetPrim().GetStage(), looks, item, frames, each.offset, xform.GetPrim().GetName())
    step = max(1, _BLOCK_BYTES // body.bytes_a_frame)
    for first in range(0, len(frames), step):
        block = np.arange(first, min(first + step, len(frames)))
        positions = frames[item.source[block]].astype(np.float64) + each.offset
        colors = None
        if each.paint.shows_stress:
            colors = appearance.stress_index(_tension(result, each, block), scale)
        body.write(first, positions, colors)
        saver.wrote(len(block) * body.bytes_a_frame, len(block) / len(frames))
    body.finish()
    return scale


def _body(geometry: str) -> type[Body]:
    """The class that writes a geometry."""
    from warp_springs.io.usd.mesh import MeshBody
    from warp_springs.io.usd.points import PointsBody
    from warp_springs.io.usd.skel import SkelBody

    return {"skel": SkelBody, "points": PointsBody, "mesh": MeshBody}[geometry]


def _tension(result: Result, each: _Drawn, shown: np.ndarray) -> np.ndarray:
    """Tensions [N] in the frames shown, (len(shown), S); an absurd stiffness may overflow."""
    with np.errstate(over="ignore"):
        return result.tension_frames(each.item.index, each.item.source[shown])[:, each.kept]


class _Saver:
    """Saves a stage now and then, which hands the written samples from memory to the file."""

    def __init__(
        self, stage: Usd.Stage, robots: int, progress: Callable[[float], None] | None
    ) -> None:
        self._stage, self._unsaved = stage, 0
        self._robots, self._progress, self._finished = robots, progress, 0.0

    def wrote(self, n_bytes: int, share: float) -> None:
        """Note that samples of so many bytes, such a share of a robot's, were written."""
        self._unsaved += n_bytes
        if self._unsaved >= _SAVE_BYTES:
            self._stage.Save()
            self._unsaved = 0
        self._finished += share / self._robots
        if self._progress is not None:
            self._progress(min(self._finished, 1.0) * 0.999)  # the file is not there yet

    def done(self) -> None:
        """All is written."""
        if self._progress is not None:
            self._progress(1.0)


@contextmanager
def _renamed_when_done(path: Path) -> Iterator[Path]:
    """A binary draft beside ``path``; turned into the file wanted and moved there."""
    from pxr import Sdf, Tf, UsdUtils

    with written_beside(path) as finished:
        kind = path.suffix.lower()
        draft = finished if kind == ".usdc" else finished.with_name("robots.usdc")
        try:
            yield draft
            if kind == ".usda":
                Sdf.Layer.FindOrOpen(str(draft)).Export(str(finished))
            elif kind == ".usdz":
                UsdUtils.CreateNewUsdzPackage(str(draft), str(finished))
        except Tf.ErrorException as error:
            raise OSError(f"path: USD could not write {path}: {_first(error)}") from error
    # A stage that is open on the old file in this process shows the new one.
    if layer := Sdf.Layer.Find(str(path)):
        layer.Reload(force=True)


def _first(error: Tf.ErrorException) -> str:
    """The first complaint of USD, which complains once for every block that it could not write."""
    return str(error.args[0].commentary) if error.args else str(error)


def _solid_boxes(result: Result) -> list[np.ndarray]:
    """Lowest and highest corner of each obstacle that has an end [m], (2, 3)."""
    bounded = [each for each in result.scene.obstacles if not isinstance(each, Plane)]
    meshes = (obstacle_mesh(each, np.zeros((2, 3)))[0] for each in bounded)
    return [np.stack([points.min(axis=0), points.max(axis=0)]) for points in meshes]


def _kept(robot: Robot, springs: Springs) -> np.ndarray:
    """The springs that are drawn."""
    if springs == "surface" or (springs == "auto" and robot.n_masses > MOST_JOINTS):
        return surface_springs(robot)
    return np.arange(robot.n_springs)


def _chosen_geometry(robot: Robot, geometry: Geometry) -> str:
    if geometry != "auto":
        return geometry
    return "points" if robot.n_masses > MOST_JOINTS else "skel"


def _checked_spacing(grid: bool, spacing: float | None) -> float | None:
    if spacing is None:
        return None
    if not grid:
        raise ValueError(f"spacing: got {spacing!r} m with grid=False, which has no cells")
    check_number("spacing", spacing, above=0.0)
    return float(spacing)


def _check_keys(name: str, given: Mapping[int, Any] | None, indices: list[int]) -> None:
    for index in given or ():
        if index not in indices:
            raise ValueError(f"{name}: got robot {index!r}, which is not among those exported")


def _bends(robot: Robot, frames: np.ndarray) -> bool:
    """Whether a robot bends so far that its bars would not stay round by themselves."""
    rest = robot.positions - robot.positions.mean(axis=0)
    return bends(rest, robot.springs, frames)


def _spread(count: int, most: int) -> np.ndarray:
    """At most so many indices below ``count``, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
