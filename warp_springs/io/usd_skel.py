"""A robot as UsdSkel: one joint for each mass, and meshes that follow the joints rigidly.

The smallest form that every viewer plays: a frame costs one point for each mass and one colour
index for each face of a bar, however fine the meshes are. The body as a whole moves with an Xform,
so that the joints only carry the deformation and interpolated frames turn instead of shrinking.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt  # noqa: TID253

from warp_springs.io.usd_geometry import (
    TUBE_SIDES,
    Part,
    balls,
    quaternions,
    rigid_fit,
    skin,
    tubes,
)
from warp_springs.io.usd_stage import Looks, bind, constant_color, define_mesh, ints, vec3f
from warp_springs.robot import Robot
from warp_springs.view import appearance

FloatArray = NDArray[np.float64]


class SkelRobot:
    """Writes one robot: the prims on construction, then frames in any number of calls.

    Args:
        xform: The robot's prim; its transform will be animated.
        robot: The body; its initial positions are the rest pose.
        looks: The materials of the stage.
    """

    def __init__(self, xform: UsdGeom.Xform, robot: Robot, looks: Looks) -> None:
        self._path = xform.GetPath()
        self._stage: Usd.Stage = xform.GetPrim().GetStage()
        self._n_springs = robot.n_springs
        self._rest = robot.positions - robot.positions.mean(axis=0)
        bar, ball = appearance.drawn_radii(robot.lengths)
        self._reach = 1.001 * max(bar, ball)
        self._turned: FloatArray | None = None
        self._shown_stress: NDArray[np.int32] | None = None

        self._translate, self._orient = xform.AddTranslateOp(), xform.AddOrientOp()
        self._root = UsdSkel.Root.Define(self._stage, self._child(xform.GetPath(), "body"))
        self._extent = self._root.CreateExtentAttr(self._extent_of(self._rest))
        self._skeleton, self._motion = self._add_skeleton()

        self._add_part("masses", balls(self._rest, ball), looks.mass, appearance.MASS)
        if len(robot.faces):
            self._add_part("skin", skin(self._rest, robot.faces), looks.skin, appearance.SKIN)
        self._colors: Usd.Attribute | None = None
        if robot.n_springs:
            bars = self._add_part("bars", tubes(self._rest, robot.springs, bar), looks.stress)
            self._colors = _stress_colors(bars, robot.n_springs)

    @property
    def bytes_a_frame(self) -> int:
        """Memory of the samples of one frame."""
        return 12 * len(self._rest) + 4 * TUBE_SIDES * self._n_springs + 100

    def write(self, first: int, positions: FloatArray, stress: NDArray[np.int32]) -> None:
        """Write consecutive frames.

        Args:
            first: Time code of the first frame; the others follow by one.
            positions: Where the masses are in the world [m], shape (F, M, 3).
            stress: Row of `appearance.stress_palette` for each spring, shape (F, S).
        """
        centres, rotations = rigid_fit(self._rest, positions)
        turns = quaternions(rotations, self._turned)
        self._turned = turns[-1]
        joints = (positions - centres[:, None]) @ rotations
        low = joints.min(axis=1) - self._reach
        high = joints.max(axis=1) + self._reach
        extents = np.stack([low, high], axis=1).astype(np.float32)
        joints = joints.astype(np.float32)
        moves = zip(
            Vt.Vec3dArray.FromNumpy(np.ascontiguousarray(centres)),
            Vt.QuatfArray.FromNumpy(turns.astype(np.float32)),
            strict=True,
        )
        if first == 0:
            self._translate.Set(Gf.Vec3d(*centres[0]))
            self._orient.Set(Gf.Quatf(Gf.Quatd(turns[0, 3], *turns[0, :3])))
        translations = self._motion.GetTranslationsAttr()
        for k, (centre, turn) in enumerate(moves):
            time = first + k
            self._translate.Set(centre, time)
            self._orient.Set(turn, time)
            translations.Set(Vt.Vec3fArray.FromNumpy(joints[k]), time)
            self._extent.Set(Vt.Vec3fArray.FromNumpy(extents[k]), time)
        self._write_colors(first, stress)

    def _write_colors(self, first: int, stress: NDArray[np.int32]) -> None:
        """Colour indices hold until the next sample: frames without a change need none."""
        if self._colors is None:
            return
        before = stress[:1] - 1 if self._shown_stress is None else self._shown_stress
        changed = (np.diff(stress, axis=0, prepend=before) != 0).any(axis=1)
        faces = np.repeat(stress, TUBE_SIDES, axis=1)
        for k in np.flatnonzero(changed).tolist():
            self._colors.Set(Vt.IntArray.FromNumpy(faces[k]), first + k)
        self._shown_stress = stress[-1:]

    def _add_skeleton(self) -> tuple[UsdSkel.Skeleton, UsdSkel.Animation]:
        """A joint for each mass, all of them roots, at rest where the body's masses are."""
        n = len(self._rest)
        joints = Vt.TokenArray([f"{self._path.name}_m{mass}" for mass in range(n)])
        pose = np.tile(np.eye(4), (n, 1, 1))
        pose[:, 3, :3] = self._rest
        transforms = Vt.Matrix4dArray.FromNumpy(pose)

        path = self._child(self._root.GetPath(), "skeleton")
        skeleton = UsdSkel.Skeleton.Define(self._stage, path)
        skeleton.CreateJointsAttr(joints)
        skeleton.CreateBindTransformsAttr(transforms)
        skeleton.CreateRestTransformsAttr(transforms)
        skeleton.CreatePurposeAttr(UsdGeom.Tokens.guide)
        skeleton.CreateExtentAttr(self._extent_of(self._rest))

        motion = UsdSkel.Animation.Define(self._stage, self._child(path, "motion"))
        motion.CreateJointsAttr(joints)
        motion.CreateTranslationsAttr(vec3f(self._rest))
        motion.CreateRotationsAttr(Vt.QuatfArray(n, Gf.Quatf(1.0)))
        motion.CreateScalesAttr(Vt.Vec3hArray(n, Gf.Vec3h(1.0)))
        binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
        binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
        root = UsdSkel.BindingAPI.Apply(self._root.GetPrim())
        root.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
        return skeleton, motion

    def _add_part(
        self,
        name: str,
        part: Part,
        material: UsdShade.Material,
        color: tuple[float, float, float] | None = None,
    ) -> UsdGeom.Mesh:
        """A mesh under the skeleton, each vertex on one joint with the weight 1."""
        path = self._child(self._root.GetPath(), name)
        mesh = define_mesh(self._stage, path, part.points, part.faces, part.normals)
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateJointIndicesPrimvar(False, 1).Set(ints(part.masses))
        binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray(len(part.masses), 1.0))
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
        binding.CreateSkeletonRel().SetTargets([self._skeleton.GetPath()])
        bind(mesh, material)
        if color is not None:
            constant_color(mesh, color)
        return mesh

    def _child(self, parent: Sdf.Path, name: str) -> Sdf.Path:
        """A path whose last name is unique in the file: some viewers animate by name alone."""
        return parent.AppendChild(f"{self._path.name}_{name}")

    def _extent_of(self, positions: FloatArray) -> Vt.Vec3fArray:
        low, high = positions.min(axis=0) - self._reach, positions.max(axis=0) + self._reach
        return vec3f([low, high])


def _stress_colors(bars: UsdGeom.Mesh, n_springs: int) -> Usd.Attribute:
    """The stress table on the faces of the bars; returns the indices that will be animated."""
    primvar = bars.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    primvar.Set(vec3f(appearance.stress_palette()))
    primvar.SetIndices(Vt.IntArray(n_springs * TUBE_SIDES, 0))
    return primvar.GetIndicesAttr()
