"""A robot as UsdSkel: one joint for each mass, and meshes that follow the joints rigidly.

The smallest form that every viewer plays: a frame costs one point for each mass and one colour
index for each face of a bar, however fine the meshes are.
"""

from __future__ import annotations

import numpy as np

# Only the exporter imports this module, when it has something to write.
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt  # noqa: TID253

from warp_springs.io.usd.body import FloatArray
from warp_springs.io.usd.mesh import Meshes
from warp_springs.io.usd.poses import mass_turns, quaternions
from warp_springs.io.usd.stage import ints, vec3f


class SkelBody(Meshes):
    """A robot as a skeleton and meshes bound to it."""

    def _build(self) -> None:
        self._joints_turned: FloatArray | None = None
        self._root = UsdSkel.Root.Define(self._stage, self._child(self._path, "body"))
        self._root.CreateExtentAttr(self._rest_extent())
        skeleton, self._motion = self._add_skeleton()
        for mesh, part in self._add_meshes(self._root.GetPath()):
            # Each vertex on one joint with the weight 1.
            binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
            binding.CreateJointIndicesPrimvar(False, 1).Set(ints(part.masses))
            binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray(len(part.masses), 1.0))
            binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
            binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])

    @property
    def _sample_bytes(self) -> int:
        joint = 28 if self._bent else 12
        return joint * len(self._rest) + 4 * self._detail.sides * self._robot.n_springs + 100

    def _write_shape(self, first: int, local: FloatArray) -> None:
        translations = self._motion.GetTranslationsAttr()
        for time, joints in enumerate(local.astype(np.float32), start=first):
            translations.Set(Vt.Vec3fArray.FromNumpy(joints), time)
        if not self._bent:
            return
        turns = mass_turns(self._rest, self._robot.springs, local)
        turns = quaternions(turns, self._joints_turned)
        self._joints_turned = turns[-1]
        rotations = self._motion.GetRotationsAttr()
        for time, joints in enumerate(turns.astype(np.float32), start=first):
            rotations.Set(Vt.QuatfArray.FromNumpy(joints), time)

    def _extents(self) -> list[Usd.Attribute]:
        return [self._root.GetExtentAttr()]

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
        skeleton.CreateExtentAttr(self._rest_extent())

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
