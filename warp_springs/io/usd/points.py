"""A robot as points, curves and a moving skin: for bodies of very many masses.

Nothing is meshed but the skin, so a frame costs a point for each mass, two for each bar and one
for each corner of the skin. Game engines, phones and three.js show no points and no curves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Usd, UsdGeom, Vt  # noqa: TID253

from warp_springs.io.usd.body import Body, FloatArray
from warp_springs.io.usd.geometry import Part
from warp_springs.io.usd.stage import bind, constant_color, define_mesh, ints, vec3f
from warp_springs.view import appearance


class PointsBody(Body):
    """A robot as Points for its masses, BasisCurves for its bars and a Mesh for its skin."""

    def _build(self) -> None:
        robot, looks = self._robot, self._looks
        self._corners = np.unique(robot.faces)
        # What is drawn, and the mass that each of its points follows.
        self._forms: list[tuple[UsdGeom.PointBased, NDArray[np.int32]]] = []
        if robot.n_springs:
            self._bars = self._add_bars()
            self._forms.append((self._bars, robot.springs.ravel()))
        if len(robot.faces):
            self._forms.append((self._add_skin(), self._corners))
        # Balls inside a body of this size would only hide each other.
        masses = self._corners if len(robot.faces) else np.arange(robot.n_masses)
        dots = UsdGeom.Points.Define(self._stage, self._child(self._path, "masses"))
        self._forms.append((dots, masses))
        dots.CreatePointsAttr(vec3f(self._rest[masses]))
        dots.CreateIdsAttr(Vt.Int64Array.FromNumpy(masses.astype(np.int64)))
        dots.CreateWidthsAttr(Vt.FloatArray([2.0 * self._ball]))
        dots.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        dots.CreateExtentAttr(self._rest_extent())
        self._paint_masses(dots, UsdGeom.Tokens.vertex, masses)
        bind(dots, looks.mass)

    @property
    def _sample_bytes(self) -> int:
        return 12 * sum(len(of) for _, of in self._forms) + 4 * self._robot.n_springs + 100

    def _write_shape(self, first: int, local: FloatArray) -> None:
        local = local.astype(np.float32)
        for form, masses in self._forms:
            points = form.GetPointsAttr()
            for time, frame in enumerate(local, start=first):
                points.Set(Vt.Vec3fArray.FromNumpy(frame[masses]), time)

    def _hide(self, gone: NDArray[np.bool_], time: int) -> None:
        self._bars.SetWidthsInterpolation(UsdGeom.Tokens.uniform)
        widths = np.where(gone, 0.0, 2.0 * self._bar).astype(np.float32)
        if time == 0:
            self._bars.GetWidthsAttr().Set(Vt.FloatArray.FromNumpy(widths))
        self._bars.GetWidthsAttr().Set(Vt.FloatArray.FromNumpy(widths), time)

    def _extents(self) -> list[Usd.Attribute]:
        return [form.GetExtentAttr() for form, _ in self._forms]

    def _add_bars(self) -> UsdGeom.BasisCurves:
        """One straight curve for each spring."""
        springs = self._robot.springs
        curves = UsdGeom.BasisCurves.Define(self._stage, self._child(self._path, "bars"))
        curves.CreateTypeAttr(UsdGeom.Tokens.linear)
        curves.CreateCurveVertexCountsAttr(ints(np.full(len(springs), 2)))
        curves.CreatePointsAttr(vec3f(self._rest[springs.ravel()]))
        curves.CreateWidthsAttr(Vt.FloatArray([2.0 * self._bar]))
        curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        curves.CreateExtentAttr(self._rest_extent())
        self._paint_on(curves)
        bind(curves, self._looks.bars)
        return curves

    def _add_skin(self) -> UsdGeom.Mesh:
        """The exterior triangles over the masses at their corners."""
        faces = np.searchsorted(self._corners, self._robot.faces).astype(np.int32)
        part = Part(self._rest[self._corners], faces, self._corners)
        mesh = define_mesh(self._stage, self._child(self._path, "skin"), part)
        constant_color(mesh, appearance.SKIN)
        bind(mesh, self._looks.skin)
        return mesh
