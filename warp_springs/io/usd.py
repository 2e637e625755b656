"""Animations as OpenUSD: `export_usd` writes recorded robots as one stage that opens everywhere."""

from __future__ import annotations

import dataclasses
import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_springs import __version__
from warp_springs.io.usd_layout import (
    Track,
    chosen_robots,
    frame_rate,
    placed,
    track,
    unique_names,
)
from warp_springs.view import appearance

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

    from warp_springs.io.usd_stage import Looks
    from warp_springs.result import Result

__all__ = ["export_usd"]

_SUFFIXES = (".usdc", ".usda", ".usdz")
_BLOCK_BYTES = 16_000_000
"""Samples held in memory between two saves."""
_SCALE_FRAMES = 64
"""Frames, spread over the animation, that decide what tension takes the full colour."""


def export_usd(
    result: Result,
    path: str | os.PathLike[str],
    *,
    robots: Iterable[int] | None = None,
    names: Mapping[int, str] | None = None,
    custom_data: Mapping[int, Mapping[str, Any]] | None = None,
    grid: bool = True,
    spacing: float | None = None,
) -> Path:
    """Write recorded robots as an animated OpenUSD stage and return its path.

    The stage is z up, in metres, one time code for each recorded frame. Each robot is an animated
    Xform over a UsdSkel body with a joint for each mass: bars coloured by stress (white neutral,
    red tension, blue compression; the robot's custom data say in ``stressScale`` [N] what the full
    colour means), balls at the masses, its exterior faces as a skin. A scene with a ground gets a
    checker floor, drawn below z = 0 by the radius of a ball so that balls rest on it; a camera
    sees every robot in every frame. A robot that was stopped stays as it was; its custom data say
    when and why. The version and the parameters of the simulation are in the layer's custom data,
    under ``warp_springs``.

    The file appears whole or not at all: it is written beside its place and then renamed.

    Args:
        result: What `Simulation.run` returned, recorded with ``fps=``.
        path: File to write; ``.usdc`` (binary), ``.usda`` (text) or ``.usdz`` (package).
        robots: Indices of recorded robots; all of them by default.
        names: Name of a robot by its index, made unique and valid; ``robot_0007`` by default.
        custom_data: For a robot by its index, what to keep on its prim: numbers, strings,
            booleans, sequences and nested dicts of them, for example fitness and seed.
        grid: Whether several robots are put on a square grid, each starting in the middle of its
            cell; otherwise all stay where they were simulated.
        spacing: Distance of the cells [m]; by default large enough that no two robots touch in
            any frame.

    Raises:
        ValueError: The suffix is unknown, the result has no frames, a robot was not recorded or
            has no finite frame, a name or custom data belong to a robot that is not exported or
            hold something that USD cannot, or the spacing is not a positive length.
        OSError: The file cannot be written.
    """
    path = _checked_path(path)
    spacing = _checked_spacing(grid, spacing)
    indices = chosen_robots(result, robots)
    _check_keys("names", names, indices)
    _check_keys("custom_data", custom_data, indices)
    notes = {
        index: _usd_dict(data, f"custom_data[{index}]")
        for index, data in (custom_data or {}).items()
    }
    tracks = [track(result, index) for index in indices]
    offsets = placed(tracks, spacing) if grid and len(tracks) > 1 else np.zeros((len(tracks), 3))
    with _renamed_when_done(path) as draft:
        _write(result, draft, tracks, offsets, dict(names or {}), notes)
    return path


def _write(
    result: Result,
    draft: Path,
    tracks: list[Track],
    offsets: np.ndarray,
    names: dict[int, str],
    notes: dict[int, dict[str, Any]],
) -> None:
    """Write the whole stage into a new binary file."""
    from pxr import Usd, UsdGeom

    from warp_springs.io import usd_stage

    stage = usd_stage.new_stage(str(draft), frame_rate(result.times, result.dt), len(result.times))
    stage.GetRootLayer().customLayerData = {"warp_springs": _provenance(result)}
    looks = usd_stage.add_looks(stage)
    boxes = np.stack([item.box for item in tracks]) + offsets[:, None]
    distance = usd_stage.add_camera(stage, boxes)
    if result.scene.ground is not None:
        size = float(np.median([np.linalg.norm(item.high[0] - item.low[0]) for item in tracks]))
        middle = 0.5 * (boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0))
        ball = max(item.ball for item in tracks)
        usd_stage.add_ground(stage, looks, middle, distance, size, ball)
    usd_stage.add_lights(stage)
    prims = unique_names([item.index for item in tracks], names, usd_stage.SCENERY)
    saver = _Saver(stage)
    for item, offset, prim in zip(tracks, offsets, prims, strict=True):
        xform = UsdGeom.Xform.Define(stage, usd_stage.ROBOTS.AppendChild(prim))
        xform.GetPrim().SetDisplayName(names.get(item.index, prim))
        scale = _write_motion(xform, looks, result, item, offset, saver)
        data = {"warp_springs": _facts(result, item, scale)} | notes.get(item.index, {})
        xform.GetPrim().SetCustomData(data)
        Usd.ModelAPI(xform).SetKind("component")
    stage.Save()


def _write_motion(
    xform: UsdGeom.Xform,
    looks: Looks,
    result: Result,
    item: Track,
    offset: np.ndarray,
    saver: _Saver,
) -> float:
    """Write one robot in blocks of frames; returns the tension of the full colour [N]."""
    from warp_springs.io.usd_skel import SkelRobot

    frames = np.asarray(result.frames(item.index))
    sample = _spread(len(frames), _SCALE_FRAMES)
    scale = appearance.stress_scale(_tension(item, frames, sample))
    writer = SkelRobot(xform, item.robot, looks)
    step = max(1, _BLOCK_BYTES // writer.bytes_a_frame)
    for first in range(0, len(frames), step):
        block = np.arange(first, min(first + step, len(frames)))
        positions = frames[item.source[block]].astype(np.float64) + offset
        stress = appearance.stress_index(_tension(item, frames, block), scale)
        writer.write(first, positions, stress)
        saver.wrote(len(block) * writer.bytes_a_frame)
    return scale


def _tension(item: Track, frames: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Tensions [N] in the frames shown, (len(shown), S); an absurd stiffness may overflow."""
    with np.errstate(over="ignore"):
        return item.robot.tension(frames[item.source[shown]], item.times[shown])


def _provenance(result: Result) -> dict[str, Any]:
    """The version and every parameter of the simulation."""
    parameters = {
        "version": __version__,
        "dt": result.dt,
        "integrator": result.integrator,
        "precision": result.precision,
        "device": result.device,
        "startTime": float(result.times[0]),
        "endTime": float(result.times[-1]),
        "scene": dataclasses.asdict(result.scene),
    }
    return _usd_dict(parameters, "result")


def _facts(result: Result, item: Track, scale: float) -> dict[str, Any]:
    """What the file itself says of a robot."""
    from warp_springs.stability import Status

    status = Status(int(result.status[item.index]))
    facts = {
        "index": item.index,
        "status": status.name,
        "stressScale": scale,
        "masses": item.robot.n_masses,
        "springs": item.robot.n_springs,
    }
    if status:
        facts["statusTime"] = float(result.status_time[item.index])
    if item.held_frames:
        facts["heldFrames"] = item.held_frames
    return facts


class _Saver:
    """Saves a stage now and then, which hands the written samples from memory to the file."""

    def __init__(self, stage: Usd.Stage) -> None:
        self._stage, self._unsaved = stage, 0

    def wrote(self, n_bytes: int) -> None:
        """Note that samples of so many bytes were written."""
        self._unsaved += n_bytes
        if self._unsaved >= _BLOCK_BYTES:
            self._stage.Save()
            self._unsaved = 0


@contextmanager
def _renamed_when_done(path: Path) -> Iterator[Path]:
    """A binary draft in a folder beside ``path``; turned into the file wanted and moved there."""
    from pxr import Sdf, Tf, UsdUtils

    with tempfile.TemporaryDirectory(prefix=".usd-", dir=path.parent) as folder:
        draft = Path(folder, "robots.usdc")
        finished = draft.with_suffix(path.suffix.lower())
        try:
            yield draft
            if finished.suffix == ".usda":
                Sdf.Layer.FindOrOpen(str(draft)).Export(str(finished))
            elif finished.suffix == ".usdz":
                UsdUtils.CreateNewUsdzPackage(str(draft), str(finished))
        except Tf.ErrorException as error:
            raise OSError(f"path: USD could not write {path}: {error}") from error
        finished.replace(path)
    # A stage that is open on the old file in this process shows the new one.
    if layer := Sdf.Layer.Find(str(path)):
        layer.Reload(force=True)


def _checked_path(path: str | os.PathLike[str]) -> Path:
    """Refuse what cannot become a file before any work is done."""
    path = Path(path)
    if path.suffix.lower() not in _SUFFIXES:
        raise ValueError(f"path: got {str(path)!r}, expected a name in {', '.join(_SUFFIXES)}")
    if path.is_dir():
        raise IsADirectoryError(f"path: {path} is a folder, expected a file")
    if not path.parent.is_dir():
        raise NotADirectoryError(f"path: there is no folder {path.parent} to write into")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"path: no permission to write into the folder {path.parent}")
    return path


def _checked_spacing(grid: bool, spacing: float | None) -> float | None:
    if spacing is None:
        return None
    if not grid:
        raise ValueError(f"spacing: got {spacing!r} m with grid=False, which has no cells")
    if not (math.isfinite(spacing) and spacing > 0.0):
        raise ValueError(f"spacing: got {spacing!r}, expected a positive length [m]")
    return float(spacing)


def _check_keys(name: str, given: Mapping[int, Any] | None, indices: list[int]) -> None:
    for index in given or ():
        if index not in indices:
            raise ValueError(f"{name}: got robot {index!r}, which is not among those exported")


def _usd_dict(data: Mapping[str, Any], where: str) -> dict[str, Any]:
    """A dict of what USD can hold; None is left out.

    Raises:
        ValueError: A key is no string, or a value is not finite or of a type that USD has not.
    """
    converted = {}
    for key, value in data.items():
        if not isinstance(key, str) or not key:
            raise ValueError(f"{where}: got the key {key!r}, expected a name")
        if value is not None:
            converted[key] = _usd_value(value, f"{where}[{key!r}]")
    return converted


def _usd_value(value: Any, where: str) -> Any:
    if isinstance(value, Mapping):
        return _usd_dict(value, where)
    if isinstance(value, str):
        return str(value)
    array = np.asarray(value)
    if array.ndim > 1 or array.dtype.kind not in "biufU":
        raise ValueError(
            f"{where}: got {value!r}, expected a number, a string, a boolean, a flat sequence of "
            "one of these, or a dict"
        )
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"{where}: got {value!r}, expected finite numbers")
    if array.dtype.kind in "iu" and (np.abs(array.astype(np.float64)) >= 2.0**63).any():
        raise ValueError(f"{where}: got {value!r}, expected integers of at most 63 bits")
    return array.item() if array.ndim == 0 else _vt_array(array)


def _vt_array(array: np.ndarray) -> Any:
    """A flat array as USD's own type: metadata of a layer take no lists."""
    from pxr import Vt

    kinds = {"f": Vt.DoubleArray, "i": Vt.Int64Array, "u": Vt.Int64Array, "b": Vt.BoolArray}
    return kinds.get(array.dtype.kind, Vt.StringArray)(array.tolist())


def _spread(count: int, most: int) -> np.ndarray:
    """At most so many indices below ``count``, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
