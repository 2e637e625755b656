"""Robots and results as mesh files: for ParaView and for everything that reads surfaces."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple
from xml.etree import ElementTree

import numpy as np

from warp_springs.geometry import FloatArray, spring_lengths
from warp_springs.io.outputs import written_beside
from warp_springs.result import Result
from warp_springs.robot import Robot

if TYPE_CHECKING:
    import meshio

__all__ = ["write_mesh"]

SKIN_ONLY = (".stl", ".ply", ".obj", ".off")
"""Formats that hold a surface and no lines."""
SERIES = (".pvd", ".xdmf", ".xmf")
"""Formats that hold several frames with their times."""
_OPTIONS: dict[str, dict] = {".stl": {"binary": True}, ".msh": {"file_format": "gmsh22"}}
"""What is told to the writers of formats that have a choice."""


def write_mesh(
    source: Robot | Result,
    path: str | os.PathLike[str],
    *,
    robot: int = 0,
    frame: int | Literal["all"] | None = None,
) -> list[Path]:
    """Write a robot, or a robot of a result, as a mesh file of the format of its name.

    ``.vtu``, ``.vtk``, ``.xdmf``, ``.msh`` and other formats of cells hold springs as lines and
    faces as triangles; ``.stl``, ``.ply``, ``.obj`` and ``.off`` hold the faces. All frames of a
    result go into one ``.xdmf``, into a ``.pvd`` with a ``.vtu`` for each frame beside it (both
    play in ParaView), or into numbered files of any other format.

    Data of lines where the format has any: ``tension`` [N], positive where stretched;
    ``stretch``, the length over the rest length at that time; ``stress`` [Pa], the tension over
    the section, if all springs are bars with a section; ``material``, the row of the robot's
    materials counted from 1, 0 for none; and stiffness [N/m], rest_length [m], amplitude [m],
    phase [rad]. Data of points: ``mass`` [kg], ``velocity`` [m/s] where known, and ``tension`` [N],
    the mean over the springs of a mass; of triangles: the mean tension of the corners. `read_mesh`
    makes the same body of a ``.vtu``, ``.vtk`` or ``.xdmf``; only `Robot.save` keeps everything.

    Args:
        source: A robot as it starts, or a result.
        path: The file; a file that is there is replaced.
        robot: Which robot of the result.
        frame: Which recorded frame, ``"all"`` of them, or ``None``: all for a ``.pvd``, else the
            end of the run.

    Returns:
        The files written, first the one to open.

    Raises:
        ValueError: The format is unknown or cannot hold this robot, or there is no such frame.
        OSError: The file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    frames = _Frames(source, robot, "all" if suffix == ".pvd" and frame is None else frame)
    _check(path, suffix, frames)
    if suffix in (".xdmf", ".xmf"):
        from warp_springs.io.mesh.xdmf import write_xdmf

        with written_beside(path) as draft:
            write_xdmf(draft, frames.times, map(_mesh, frames))
        return [path]
    if suffix == ".pvd":
        return _write_pvd(path, frames)
    names = _names(path, frames, numbered=frame == "all")
    return [_write_one(name, _mesh(one)) for name, one in zip(names, frames, strict=True)]


class _Frame(NamedTuple):
    """A robot at one time: its state, and its springs' rest lengths [m] and tensions [N]."""

    body: Robot
    positions: FloatArray
    velocities: FloatArray | None
    rest: FloatArray
    tension: FloatArray


class _Frames:
    """The frames to write, with their times."""

    def __init__(self, source: Robot | Result, robot: int, frame: int | str | None) -> None:
        self._source, self._robot, self._index = source, robot, None
        if isinstance(source, Robot):
            if frame not in (None, "all", 0):
                raise ValueError(f"frame: got {frame!r}, but a robot has no frames, a result has")
            self.body, self.times = source, np.zeros(1)
        elif not isinstance(source, Result):
            raise TypeError(f"source: got {type(source).__name__}, expected a Robot or a Result")
        elif frame is None:
            self.body, self.times = source.robots[robot], np.array([source.end_time])
        else:
            count = len(source.frames(robot))
            if frame != "all" and not -count <= frame < count:
                raise ValueError(f"frame: got {frame!r}, the result has {count} frames")
            self._index = range(count) if frame == "all" else [frame % count]
            self.body, self.times = source.robots[robot], source.times[list(self._index)]

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[_Frame]:
        body, result, i = self.body, self._source, self._robot
        if isinstance(result, Robot):
            rest, tension = body.rest_length_at(0.0), body.tension(body.positions, 0.0)
            yield _Frame(body, body.positions, body.velocities, rest, tension)
        elif self._index is None:
            springs = result.rest_lengths(i), result.tension(i)
            yield _Frame(body, result.positions(i), result.velocities(i), *springs)
        else:
            for k in self._index:
                rest, tension = result.rest_length_frames(i, [k]), result.tension_frames(i, [k])
                positions = np.asarray(result.frames(i)[k], np.float64)
                yield _Frame(body, positions, None, rest[0], tension[0])


def _check(path: Path, suffix: str, frames: _Frames) -> None:
    import meshio

    if not path.parent.is_dir():
        raise NotADirectoryError(f"{path}: there is no folder {path.parent} to write into")
    known = sorted({*meshio.extension_to_filetypes, *SERIES})
    if suffix not in known:
        raise ValueError(f"{path}: no mesh format ends in {suffix!r}; known: {', '.join(known)}")
    if suffix in SKIN_ONLY and len(frames.body.faces) == 0:
        raise ValueError(
            f"{path}: a {suffix} file holds faces, of which this robot has none; write a .vtu"
        )
    if suffix not in SKIN_ONLY and frames.body.n_springs == len(frames.body.faces) == 0:
        raise ValueError(f"{path}: this robot has neither springs nor faces to write")


def _mesh(frame: _Frame) -> meshio.Mesh:
    """A frame as points, lines and triangles with all their data."""
    import meshio

    body = frame.body
    tension, rest = frame.tension, frame.rest
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = np.where(rest > 0.0, spring_lengths(frame.positions, body.springs) / rest, 1.0)
    lines = {
        "tension": tension,
        "stretch": stretch,
        "material": body.material + 1,
        **{n: getattr(body, n) for n in ("stiffness", "rest_length", "amplitude", "phase")},
    }
    sections = [body.materials[i].section if i >= 0 else None for i in np.unique(body.material)]
    if sections and None not in sections:
        section = np.array([m.section or np.nan for m in body.materials])[body.material]
        lines["stress"] = tension / section
    ends = body.springs.ravel()
    degree = np.bincount(ends, minlength=body.n_masses)
    mean = np.bincount(ends, np.repeat(tension, 2), minlength=body.n_masses) / np.maximum(degree, 1)
    points = {"mass": body.masses, "tension": mean}
    if frame.velocities is not None:
        points["velocity"] = frame.velocities
    corners = mean[body.faces].mean(axis=1) if len(body.faces) else np.zeros(0)
    kinds = {"line": body.springs, "triangle": body.faces}
    data = {
        "line": lines,
        "triangle": {n: 0 * v[:1].repeat(len(body.faces)) for n, v in lines.items()}
        | {"tension": corners},
    }
    present = [kind for kind, cells in kinds.items() if len(cells)]
    return meshio.Mesh(
        frame.positions,
        [(kind, kinds[kind].astype(np.int64)) for kind in present],
        point_data=points,
        cell_data={name: [data[kind][name] for kind in present] for name in lines},
    )


def _names(path: Path, frames: _Frames, numbered: bool) -> list[Path]:
    """The path itself, or one for each frame."""
    if not numbered:
        return [path]
    digits = max(4, len(str(len(frames) - 1)))
    return [path.with_name(f"{path.stem}_{i:0{digits}d}{path.suffix}") for i in range(len(frames))]


def _write_one(path: Path, mesh: meshio.Mesh) -> Path:
    """Write a mesh; formats of surfaces get the triangles, formats without data no data."""
    import meshio

    if path.suffix.lower() in SKIN_ONLY:
        mesh = _skin(mesh, with_data=path.suffix.lower() == ".ply")
    if path.suffix.lower() == ".msh":
        # Gmsh calls materials physical groups. Other data of cells meshio writes, but cannot read.
        groups = mesh.cell_data["material"]
        mesh.cell_data = {"gmsh:physical": groups, "gmsh:geometrical": groups}
    with written_beside(path) as draft, contextlib.redirect_stderr(io.StringIO()):
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                meshio.write(draft, mesh, **_OPTIONS.get(path.suffix.lower(), {}))
        except OSError:
            raise
        except ImportError as error:
            raise ValueError(f"{path}: this format needs the package {error.name}") from None
        except (Exception, SystemExit) as error:
            words = " ".join(str(error).split()) or type(error).__name__
            raise ValueError(f"{path}: this format cannot hold the robot ({words})") from None
    return path


def _skin(mesh: meshio.Mesh, with_data: bool) -> meshio.Mesh:
    """The triangles of a mesh with the points they use."""
    import meshio

    triangles = mesh.get_cells_type("triangle")
    used, corners = np.unique(triangles, return_inverse=True)
    data = {n: v[used] for n, v in mesh.point_data.items() if v.ndim == 1} if with_data else {}
    cells = [("triangle", corners.reshape(-1, 3))]
    return meshio.Mesh(mesh.points[used], cells, point_data=data)


def _write_pvd(path: Path, frames: _Frames) -> list[Path]:
    """A collection for ParaView: a small index with the times, and a .vtu for each frame."""
    parts = _names(path.with_suffix(".vtu"), frames, numbered=True)
    for part, frame in zip(parts, frames, strict=True):
        _write_one(part, _mesh(frame))
    index = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(index, "Collection")
    for part, time in zip(parts, frames.times, strict=True):
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(time)), file=part.name)
    ElementTree.indent(index)
    with written_beside(path) as draft:
        ElementTree.ElementTree(index).write(draft, xml_declaration=True, encoding="utf-8")
    return [path, *parts]
