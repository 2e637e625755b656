"""A robot as meshes: bars, balls and skin of which every vertex follows one mass.

`MeshBody` moves the vertices themselves, frame by frame: large files, for programs that know
neither skeletons nor curves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Sdf, Usd, UsdGeom, UsdShade  # noqa: TID253

from warp_springs.io.usd.body import Body, FloatArray, IntArray
from warp_springs.io.usd.geometry import Part, balls, skin, tubes
from warp_springs.io.usd.poses import mass_turns
from warp_springs.io.usd.stage import add_subsets, bind, constant_color, define_mesh, ints, vec3f
from warp_springs.view import appearance

_POINT_BYTES = 12


class _Piece(NamedTuple):
    """A mesh of a robot and how it looks; without a colour where its parts have their own."""

    name: str
    part: Part
    material: UsdShade.Material
    color: tuple[float, float, float] | None


class Meshes(Body):
    """What skinned and moved meshes share: which there are, and their colours."""

    def _pieces(self) -> Iterator[_Piece]:
        robot, rest, looks = self._robot, self._rest, self._looks
        yield _Piece("masses", balls(rest, self._ball, self._detail.cuts), looks.mass, None)
        if len(robot.faces):
            yield _Piece("skin", skin(rest, robot.faces), looks.skin, appearance.SKIN)
        if robot.n_springs:
            yield _Piece(
                "bars", tubes(rest, robot.springs, self._bar, self._detail.sides), looks.bars, None
            )

    def _add_meshes(self, parent: Sdf.Path) -> Iterator[tuple[UsdGeom.Mesh, Part]]:
        """Define the meshes in the rest pose."""
        for name, part, material, color in self._pieces():
            mesh = define_mesh(self._stage, self._child(parent, name), part)
            bind(mesh, material)
            if color is not None:
                constant_color(mesh, color)
            elif name == "masses":
                self._paint_balls(mesh, part)
            else:
                self._bars = (mesh.GetFaceVertexIndicesAttr(), part.faces)
                self._paint_on(mesh)
                add_subsets(mesh, self._subsets())
            yield mesh, part

    def _hide(self, gone: NDArray[np.bool_], time: int) -> None:
        """The faces of a bar that is gone shrink to a point: their number and colours remain."""
        indices, faces = self._bars
        shown = np.where(self._spread(gone)[:, None], faces[:, :1], faces)
        indices.Set(ints(shown.ravel()), time)

    def _paint_balls(self, mesh: UsdGeom.Mesh, part: Part) -> None:
        """Balls of held masses differ, in colour and in material."""
        masses = part.masses[part.faces[:, 0]]
        held = self._paint_masses(mesh, UsdGeom.Tokens.uniform, masses)
        if held.any():
            kinds = {"Free": (~held, self._looks.mass), "Held": (held, self._looks.held)}
            add_subsets(mesh, {n: (np.flatnonzero(w), m) for n, (w, m) in kinds.items() if w.any()})

    def _subsets(self) -> dict[str, tuple[IntArray, UsdShade.Material]]:
        """The faces of the bars of each kind, which viewers that know no indexed colours need."""
        faces = self._spread(self._paint.rest)
        return {
            kind: (np.flatnonzero(faces == row), self._looks.kinds[kind])
            for row, kind in enumerate(self._paint.kinds)
            if (faces == row).any()
        }

    def _spread(self, colors: IntArray) -> IntArray:
        return np.tile(colors, self._detail.sides)


class MeshBody(Meshes):
    """A robot as meshes with moving vertices."""

    def _build(self) -> None:
        self._meshes = list(self._add_meshes(self._path))
        for mesh, _ in self._meshes if self._bent else ():
            mesh.GetPrim().RemoveProperty("primvars:normals")  # they hold for what does not turn
            mesh.GetPrim().RemoveProperty("primvars:normals:indices")

    @property
    def _sample_bytes(self) -> int:
        points = sum(len(part.points) for _, part in self._meshes)
        return _POINT_BYTES * points + 4 * self._detail.sides * self._robot.n_springs + 100

    def _write_shape(self, first: int, local: FloatArray) -> None:
        turns = mass_turns(self._rest, self._robot.springs, local) if self._bent else None
        for mesh, part in self._meshes:
            offsets = part.points - self._rest[part.masses]
            points = mesh.GetPointsAttr()
            for frame, masses in enumerate(local):
                turned = offsets
                if turns is not None:
                    turned = np.einsum("vij,vj->vi", turns[frame][part.masses], offsets)
                points.Set(vec3f(masses[part.masses] + turned), first + frame)

    def _extents(self) -> list[Usd.Attribute]:
        return [mesh.GetExtentAttr() for mesh, _ in self._meshes]
