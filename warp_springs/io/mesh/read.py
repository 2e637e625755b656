"""Mesh files as robots: any format that meshio reads."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_springs.body.fields import require_positive
from warp_springs.geometry import FloatArray
from warp_springs.io.mesh.cells import (
    CellBlock,
    IndexArray,
    cell_volumes,
    exterior_triangles,
    springs_of_cells,
)
from warp_springs.materials import BUILT_IN, Material
from warp_springs.robot import Robot

if TYPE_CHECKING:
    import meshio

__all__ = ["read_mesh"]

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Metres in a unit of length."""
LABELS = (
    "material",
    "gmsh:physical",
    "medit:ref",
    "avsucd:material",
    "nastran:ref",
    "flac3d:group",
    "su2:tag",
    "cell_tags",
    "MaterialIDs",
)
"""Names under which formats keep the material of a cell."""
SPRING_DATA = ("stiffness", "rest_length", "amplitude", "phase")
"""Data of lines that `write_mesh` writes and `read_mesh` takes over."""
_LENGTHS = ("rest_length", "amplitude")
_PALETTE = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")


def read_mesh(
    path: str | os.PathLike[str],
    *,
    scale: float | str = 1.0,
    diagonals: bool = True,
    materials: Mapping[Any, Material] | None = None,
    label: str | None = None,
    mass: float = 1.0,
    density: float | None = None,
    stiffness: float = 1000.0,
) -> Robot:
    """Read a robot from a mesh file of any format that meshio knows.

    Every edge of a line, triangle, quad, polygon, tetrahedron, hexahedron, wedge or pyramid is a
    spring, once. Nodes in the middle of edges and sides of cells of higher order are left out, as
    are nodes that no cell uses; nodes at the same place become one mass. The faces are the sides
    that only one solid cell has, outward, and the surface cells that are no solid's side.

    Cells may carry the label of a material: as cell data, or as named sets of cells. A label is
    looked up in ``materials``, by its number or by the name that the file gives it, then among
    ``ws.materials.BUILT_IN``; other labels become materials of the given stiffness, so that
    regions stay apart. A spring between cells of several materials has that of the first.

    What `write_mesh` wrote, mass and velocity of points, stiffness, rest_length, amplitude and
    phase of lines, is taken over; edges of surface cells of stiffness 0, its skin, are no springs.

    Args:
        path: The file.
        scale: Length of one unit of the file [m], or ``"mm"``, ``"cm"``, ``"in"``, ...
        diagonals: Whether all corners of a cell are joined instead of its edges alone. Without,
            quads and hexahedra have nothing that resists shear.
        materials: Label -> material.
        label: Name of the cell data that holds the labels; looked for when left out.
        mass: Of the whole body [kg], the same for each of its masses.
        density: Of the solid cells [kg/m^3] instead: each shares its mass among its corners.
        stiffness: Of springs without a material [N/m].

    Returns:
        The body where the file has it.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is broken or of an unknown format, it holds no cells that can be
            springs, or a label or an argument is wrong. The message names the file.
    """
    path = Path(path)
    factor = _metres(scale)
    mass, stiffness = require_positive("mass", mass), require_positive("stiffness", stiffness)
    mesh = _read(path)
    try:
        points, blocks, used, kept = _body(mesh)
        points = points * factor
        springs, owner, cell = springs_of_cells(blocks, diagonals)
        carrying = ~_of_skin(mesh, kept, owner, cell)
        springs, owner, cell = springs[carrying], owner[carrying], cell[carrying]
        if len(springs) == 0:
            raise ValueError("it holds no lines, triangles, tetrahedra or other cells with edges")
        data = _line_data(mesh, kept, owner, cell, factor)
        robot = Robot(
            masses=_masses(mesh, points, blocks, used, mass, density),
            positions=points,
            springs=springs,
            stiffness=stiffness,
            velocities=_point_data(mesh, "velocity", used),
            faces=exterior_triangles(blocks, points),
        )
        labels = _labels(mesh, label, kept)
        if labels is not None:
            labels = np.concatenate(labels)[_places(mesh, kept, owner, cell)]
        robot = _labelled(robot, labels, materials or {})
        return robot.replace(**_merged(robot, data))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except (TypeError, IndexError, KeyError) as error:  # arrays of shapes that no mesh has
        raise ValueError(f"{path}: its data do not fit together ({error})") from error


def _metres(scale: float | str) -> float:
    if isinstance(scale, str):
        if scale not in UNITS:
            raise ValueError(f"scale: got {scale!r}, expected a number or {', '.join(UNITS)}")
        return UNITS[scale]
    return require_positive("scale", scale)


def _read(path: Path) -> meshio.Mesh:
    """The mesh of a file; whatever meshio makes of a broken one becomes one clear error."""
    import meshio
    from meshio._helpers import _filetypes_from_path, reader_map

    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    try:
        formats = _filetypes_from_path(path)
    except meshio.ReadError:
        known = ", ".join(sorted(meshio.extension_to_filetypes))
        raise ValueError(
            f"{path}: no mesh format ends in {path.suffix!r}; known: {known}"
        ) from None
    reasons = []
    for name in formats:
        mesh = _read_as(name, reader_map[name], path)
        if not isinstance(mesh, str):
            return mesh
        reasons.append(mesh)
    raise ValueError(f"{path}: {'; '.join(reasons)}")


def _read_as(name: str, reader: Callable, path: Path) -> meshio.Mesh | str:
    """The mesh of a file in one format, or why there is none."""
    # Readers print their warnings, and parse damaged numbers until they fail somewhere.
    silence = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(silence),
            contextlib.redirect_stderr(silence),
            np.errstate(all="ignore"),
        ):
            return reader(str(path))
    except ImportError as error:
        return f"{name} needs the package {error.name or error}"
    except (Exception, SystemExit) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        return f"not readable as {name} ({words})"


def _body(mesh: meshio.Mesh) -> tuple[FloatArray, list[CellBlock], IndexArray, list[int]]:
    """Points, cells, the point of the file that each mass is, and the blocks that are used."""
    points = np.asarray(mesh.points, np.float64)
    if points.ndim != 2 or points.shape[1] not in (1, 2, 3):
        raise ValueError(f"its points have shape {points.shape}, (N, 3) expected")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    blocks, kept = [], []
    for number, cells in enumerate(mesh.cells):
        if cells.type.startswith("vertex") or len(cells.data) == 0:
            continue
        block = CellBlock(cells.type, cells.data)
        outside = (block.corners < 0) | (block.corners >= len(points))
        if outside.any():
            row = int(np.argmax(outside.any(axis=1)))
            raise ValueError(
                f"{cells.type} {row} names node {int(block.corners[row][outside[row]][0])}, but "
                f"there are {len(points)} nodes"
            )
        blocks.append(block)
        kept.append(number)
    if not blocks:
        raise ValueError("it holds no lines, triangles, tetrahedra or other cells with edges")
    nodes = np.unique(np.concatenate([block.corners.ravel() for block in blocks]))
    wrong = ~np.isfinite(points[nodes]).all(axis=1)
    if wrong.any():
        raise ValueError(f"node {int(nodes[np.argmax(wrong)])} is not at a finite place")
    # Nodes at one place become one mass, in the order of the file.
    _, first, same = np.unique(points[nodes], axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    number = np.zeros(len(points), np.intp)
    number[nodes] = rank[same.reshape(-1)]
    used = nodes[np.sort(first)]
    for block in blocks:
        block.corners = number[block.corners]
    return points[used], blocks, used, kept


def _masses(
    mesh: meshio.Mesh,
    points: FloatArray,
    blocks: Sequence[CellBlock],
    used: IndexArray,
    mass: float,
    density: float | None,
) -> FloatArray:
    if density is None:
        given = _point_data(mesh, "mass", used)
        return np.full(len(points), mass / len(points)) if given is None else given
    density = require_positive("density", density)
    masses = np.zeros(len(points))
    for block in blocks:
        if block.is_solid:
            share = density * cell_volumes(block, points) / block.corners.shape[1]
            np.add.at(masses, block.corners, share[:, None])
    if not (masses > 0.0).all():
        node = int(np.argmin(masses))
        raise ValueError(
            f"density: mass {node} belongs to no cell with a volume; give the mass of the body"
        )
    return masses


def _point_data(mesh: meshio.Mesh, name: str, used: IndexArray) -> np.ndarray | None:
    values = mesh.point_data.get(name)
    return None if values is None else np.asarray(values, np.float64)[used]


def _line_data(
    mesh: meshio.Mesh, kept: Sequence[int], owner: IndexArray, cell: IndexArray, factor: float
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Which springs are lines with data of their own, and the data, by the field of a robot."""
    of_lines = np.array([mesh.cells[number].type == "line" for number in kept])
    rows = np.flatnonzero(of_lines[owner])
    place = _places(mesh, kept, owner, cell)[rows]
    data = {}
    for name in (name for name in SPRING_DATA if name in mesh.cell_data):
        arrays = [np.asarray(mesh.cell_data[name][number], np.float64).ravel() for number in kept]
        values = np.concatenate(arrays)[place]
        data[name] = (rows, values * factor if name in _LENGTHS else values)
    return data


def _of_skin(
    mesh: meshio.Mesh, kept: Sequence[int], owner: IndexArray, cell: IndexArray
) -> np.ndarray:
    """Which springs are only edges of surface cells that are said to have no stiffness, (S,)."""
    given = mesh.cell_data.get("stiffness")
    if given is None:
        return np.zeros(len(owner), bool)
    surface = np.array([mesh.cells[number].dim == 2 for number in kept])
    values = np.concatenate([np.asarray(given[number], np.float64).ravel() for number in kept])
    return surface[owner] & (values[_places(mesh, kept, owner, cell)] == 0.0)


def _places(
    mesh: meshio.Mesh, kept: Sequence[int], owner: IndexArray, cell: IndexArray
) -> IndexArray:
    """Where the cell of each spring is when the used blocks are laid end to end."""
    start = np.cumsum([0, *(len(mesh.cells[number].data) for number in kept)])
    return start[owner] + cell


def _merged(robot: Robot, data: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, Any]:
    """The fields of a robot with the data of its lines put in."""
    fields = {}
    for name, (rows, values) in data.items():
        fields[name] = getattr(robot, name).copy()
        fields[name][rows] = values
    return fields


def _labels(mesh: meshio.Mesh, label: str | None, kept: Sequence[int]) -> list[np.ndarray] | None:
    """For each block that is used the labels of its cells, texts where the file names them."""
    if label is not None and label not in mesh.cell_data:
        known = ", ".join(mesh.cell_data) or "none"
        raise ValueError(f"label: there is no cell data {label!r}; there is: {known}")
    found = label or next((name for name in LABELS if name in mesh.cell_data), None)
    if found is None:
        return _labels_of_sets(mesh, kept)
    numbers = [np.asarray(mesh.cell_data[found][number]).ravel() for number in kept]
    names = {}
    if found == "gmsh:physical":  # its field data are the names of the groups
        names = {int(np.ravel(given)[0]): name for name, given in mesh.field_data.items()}
    return [_named(labels, names) for labels in numbers]


def _named(numbers: np.ndarray, names: Mapping[int, str]) -> np.ndarray:
    """Numbers (C,) as the names that stand for them; those without a name stay numbers."""
    values, place = np.unique(numbers, return_inverse=True)
    plain = [int(v) if float(v).is_integer() else float(v) for v in values]
    return np.array([names.get(v, v) for v in plain], object)[place]


def _labels_of_sets(mesh: meshio.Mesh, kept: Sequence[int]) -> list[np.ndarray] | None:
    """Labels from named sets of cells; of several sets that hold a cell the first counts."""
    if not mesh.cell_sets:
        return None
    labels = [np.full(len(mesh.cells[number].data), None, object) for number in kept]
    for name in reversed(mesh.cell_sets):
        for place, number in enumerate(kept):
            members = mesh.cell_sets[name][number]
            if members is not None and len(members):
                labels[place][np.asarray(members, np.intp)] = name
    return labels


def _labelled(robot: Robot, labels: np.ndarray | None, materials: Mapping[Any, Material]) -> Robot:
    """The robot with the springs of each label (S,) made of the label's material."""
    if labels is None:
        if materials:
            raise ValueError("materials: given, but the file labels no cells")
        return robot
    # 0 is "no material" in most formats, unless somebody asks for it.
    nothing = {None} | ({0} if 0 not in materials else set())
    present = [label for label in dict.fromkeys(labels.tolist()) if label not in nothing]
    if unknown := [label for label in materials if label not in present]:
        raise ValueError(f"materials: no cell is labelled {unknown[0]!r}; labels: {present}")
    k = float(robot.stiffness[0])
    for number, label in enumerate(sorted(present, key=str)):
        material = materials.get(label) or BUILT_IN.get(str(label).lower())
        if material is None:
            color = _PALETTE[number % len(_PALETTE)]
            material = Material(str(label), stiffness=k, color=color)
        robot = robot.made_of(material, where=labels == label)
    return robot
