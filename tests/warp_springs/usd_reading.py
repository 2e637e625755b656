"""What tests read from a USD file, with USD's own code."""

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, UsdValidation, Vt


def opened(path):
    return Usd.Stage.Open(str(path))


def robots_of(stage):
    return list(stage.GetPrimAtPath("/World/Robots").GetChildren())


def validation_errors(path):
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    return [error.GetMessage() for error in context.Validate(opened(path))]


def to_world(prim, points, time):
    """Points (n, 3) in a prim's own frame as points in the world."""
    matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim))
    return np.array(points, np.float64) @ matrix[:3, :3] + matrix[3, :3]


def form(robot, name):
    """A robot's form of that name: its bars, masses or skin."""
    return next(p for p in Usd.PrimRange(robot) if p.GetName() == f"{robot.GetName()}_{name}")


def world_points(prim, time):
    """The authored points of a prim, in the world."""
    return to_world(prim, UsdGeom.PointBased(prim).GetPointsAttr().Get(time), time)


def skinned(stage, robot, time):
    """World points of each skinned mesh by name, and the mass that each point follows."""
    root = next(UsdSkel.Root(p) for p in Usd.PrimRange(robot) if p.IsA(UsdSkel.Root))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    found = {}
    for prim in Usd.PrimRange(root.GetPrim()):
        if not prim.IsA(UsdGeom.Mesh):
            continue
        query = cache.GetSkinningQuery(prim)
        skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
        transforms = cache.GetSkelQuery(skeleton).ComputeSkinningTransforms(time)
        points = Vt.Vec3fArray(UsdGeom.Mesh(prim).GetPointsAttr().Get())
        assert query.ComputeSkinnedPoints(transforms, points, time)
        masses = np.array(UsdSkel.BindingAPI(prim).GetJointIndicesPrimvar().Get())
        found[prim.GetName().rsplit("_", 1)[1]] = to_world(skeleton.GetPrim(), points, time), masses
    return found


def world_extent(robot, time):
    """The corners of a robot's authored extent, in the world."""
    root = next(UsdSkel.Root(p) for p in Usd.PrimRange(robot) if p.IsA(UsdSkel.Root))
    box = Gf.Range3d(*(Gf.Vec3d(v) for v in root.GetExtentAttr().Get(time)))
    return Gf.BBox3d(box, UsdGeom.XformCache(time).GetLocalToWorldTransform(root.GetPrim()))


def mass_positions(stage, robot, time):
    points, masses = skinned(stage, robot, time)["masses"]
    count = np.bincount(masses)
    return np.stack([np.bincount(masses, points[:, axis]) / count for axis in range(3)], axis=1)
