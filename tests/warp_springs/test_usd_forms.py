"""USD files: the other geometries, colours by material, obstacles, pushes, cameras, progress."""

import dataclasses

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdShade

import warp_springs as ws
from tests.warp_springs.usd_reading import (
    form,
    mass_positions,
    opened,
    robots_of,
    skinned,
    to_world,
    validation_errors,
    world_points,
)
from warp_springs.io.usd import cameras as usd_cameras
from warp_springs.io.usd import layout as usd_layout
from warp_springs.view import appearance

FPS = 30


@pytest.fixture(scope="module")
def result(tumbling_cube, walker):
    """A spinning cube that lands and a breathing pair of cubes, 0.5 s."""
    robots = [tumbling_cube.spinning((0.0, 0.0, 15.0)), walker]
    return ws.Simulation(robots, ws.Scene()).run(0.5, fps=FPS)


@pytest.fixture(scope="module")
def torn():
    """Three masses in a row; the second spring breaks when the last mass has gone far enough."""
    places = [(-0.1, 0.0, 0.1), (0.1, 0.0, 0.1), (0.3, 0.0, 0.1)]
    rods = ws.Robot(masses=1.0, positions=places, springs=[(0, 1), (1, 2)], stiffness=100.0,
                    velocities=[(0, 0, 0), (0, 0, 0), (2.0, 0, 0)])  # fmt: skip
    space = ws.Scene(ground=None, gravity=(0, 0, 0))
    result = ws.Simulation([rods.with_limits(breaks=[1e9, 10.0])], space).run(0.2, fps=100)
    assert np.isnan(result.broken(0)[0]) and 0.05 < result.broken(0)[1] < 0.1
    return result


def assert_extents_hold(stage):
    """Every authored point lies inside the extent of its prim, in every frame."""
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.PointBased) and not prim.GetPath().HasPrefix("/World/Pushes"):
            shape = UsdGeom.PointBased(prim)
            for frame in range(int(stage.GetEndTimeCode()) + 1):
                points = np.array(shape.GetPointsAttr().Get(frame))
                low, high = np.array(shape.GetExtentAttr().Get(frame))
                assert (points >= low - 1e-6).all() and (points <= high + 1e-6).all(), prim


# -- geometries --------------------------------------------------------------------------------


def test_points_and_curves_are_where_they_were_simulated(result, tmp_path):
    path = ws.export_usd(result, tmp_path / "points.usdc", geometry="points", grid=False)
    stage = opened(path)
    assert validation_errors(path) == []
    assert_extents_hold(stage)
    for index, robot in enumerate(robots_of(stage)):
        body, scale = result.robots[index], robot.GetCustomDataByKey("warp_springs:stressScale")
        bars, dots = UsdGeom.BasisCurves(form(robot, "bars")), UsdGeom.Points(form(robot, "masses"))
        ids = np.array(dots.GetIdsAttr().Get())
        colors = UsdGeom.PrimvarsAPI(bars).GetPrimvar("displayColor").GetIndicesAttr()
        tension = body.tension(result.frames(index), result.times)
        for frame, simulated in enumerate(result.frames(index)):
            ends = world_points(bars.GetPrim(), frame).reshape(-1, 2, 3)
            assert np.abs(ends - simulated[body.springs]).max() < 5e-5
            assert np.abs(world_points(dots.GetPrim(), frame) - simulated[ids]).max() < 5e-5
            corners = world_points(form(robot, "skin"), frame)
            faces = np.array(UsdGeom.Mesh(form(robot, "skin")).GetFaceVertexIndicesAttr().Get())
            assert np.abs(corners[faces] - simulated[body.faces.ravel()]).max() < 5e-5
            shown = np.array(colors.Get(frame))
            assert (shown == appearance.stress_index(tension[frame], scale)).all()


def test_moving_meshes_are_the_skinned_ones(result, tmp_path):
    path = ws.export_usd(result, tmp_path / "mesh.usdc", geometry="mesh")
    stage, skel = opened(path), opened(ws.export_usd(result, tmp_path / "skel.usdc"))
    assert validation_errors(path) == []
    assert_extents_hold(stage)
    for robot, same in zip(robots_of(stage), robots_of(skel), strict=True):
        for frame in (0, 7, 15):
            for name, (points, _) in skinned(skel, same, frame).items():
                assert np.abs(world_points(form(robot, name), frame) - points).max() < 5e-5


def test_large_bodies_become_points_and_their_surface(tmp_path):
    body = ws.shapes.lattice(10, 9, 9)
    assert body.n_masses == 1100
    result = ws.Simulation(body, ws.Scene()).run(0.1, fps=FPS)
    stage = opened(ws.export_usd(result, tmp_path / "large.usdc"))
    (robot,) = robots_of(stage)
    assert form(robot, "masses").GetTypeName() == "Points"
    bars = UsdGeom.BasisCurves(form(robot, "bars"))
    outer = np.zeros(1100, bool)
    outer[body.faces] = True
    count = outer[body.springs].all(axis=1).sum()
    assert len(bars.GetCurveVertexCountsAttr().Get()) == count < body.n_springs
    assert len(UsdGeom.Points(form(robot, "masses")).GetPointsAttr().Get(0)) == outer.sum()
    assert robot.GetCustomDataByKey("warp_springs:springs") == body.n_springs
    path = ws.export_usd(result, tmp_path / "all.usdc", springs="all", geometry="skel")
    stage = opened(path)
    points, _ = skinned(stage, robots_of(stage)[0], 0)["bars"]
    assert len(points) % (2 * body.n_springs) == 0


def test_a_surface_keeps_what_its_springs_are(cube, tmp_path):
    inner = ws.shapes.lattice(3, 3, 3)
    body = inner.replace(stiffness=np.arange(1000.0, inner.n_springs + 1000.0))
    body = body.made_of(ws.materials.BONE, where=np.arange(100)).with_cables(np.arange(50))
    body = body.with_winch([0.0, 1.0], [0.0, 0.01], springs=np.arange(20))
    kept = usd_layout.surface_springs(body)
    outside = np.isin(np.arange(body.n_masses), body.faces)
    assert kept.tolist() == [i for i, ends in enumerate(body.springs) if outside[ends].all()]
    assert 0 < len(kept) < body.n_springs
    result = ws.Simulation(body, ws.Scene()).run(0.1, fps=FPS)
    stage = opened(ws.export_usd(result, tmp_path / "surface.usdc", springs="surface"))
    (robot,) = robots_of(stage)
    primvar = UsdGeom.PrimvarsAPI(form(robot, "bars")).GetPrimvar("displayColor")
    scale = robot.GetCustomDataByKey("warp_springs:stressScale")
    shown = np.array(primvar.GetIndicesAttr().Get(3)).reshape(-1, len(kept))[0]
    expected = appearance.stress_index(result.tension_frames(0)[3, kept], scale)
    np.testing.assert_array_equal(shown, expected)
    assert len(np.unique(shown)) > 5
    for whole in (cube, inner.replace(faces=None)):  # nothing is inside a cube
        assert len(usd_layout.surface_springs(whole)) == whole.n_springs


@pytest.mark.parametrize("geometry", ["points", "mesh"])
def test_bodies_without_springs_or_faces(geometry, tmp_path):
    robots = [
        ws.Robot(masses=1.0, positions=[(0, 0, 1)], springs=[], stiffness=[]),
        ws.shapes.cube().replace(faces=None),
    ]
    result = ws.Simulation(robots, ws.Scene()).run(0.1, fps=FPS)
    path = ws.export_usd(result, tmp_path / "odd.usdc", geometry=geometry)
    assert validation_errors(path) == []
    assert len(robots_of(opened(path))) == 2


@pytest.fixture(scope="module")
def swinging():
    """A rope that is held at one end and falls, and a cube that does not bend."""
    rope = ws.shapes.chain(links=8, length=1.0, stiffness=2000.0).moved((0.0, 0.0, 1.5)).fixed([0])
    scene = ws.Scene(ground=None, damping=0.5)
    return ws.Simulation([rope, ws.shapes.cube()], scene).run(1.0, fps=FPS)


def roundness(points, masses, springs, positions):
    """The least radius of the bars seen along them, in units of their radius.

    Args:
        points: Of the mesh of bars [m], shape (S * 2 * sides, 3).
        masses: Which each follows, the same number of rows.
        springs: Shape (S, 2).
        positions: Of the masses [m], shape (M, 3).
    """
    arms = (points - positions[masses]).reshape(len(springs), -1, 3)
    along = positions[springs[:, 1]] - positions[springs[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = arms - np.einsum("ski,si->sk", arms, along)[..., None] * along[:, None]
    return (np.linalg.norm(across, axis=2) / np.linalg.norm(arms, axis=2)).min()


@pytest.mark.parametrize("geometry", ["skel", "mesh"])
def test_bars_stay_round_where_a_body_bends(swinging, geometry, tmp_path):
    path = ws.export_usd(swinging, tmp_path / "rope.usdc", geometry=geometry, grid=False)
    assert validation_errors(path) == []
    stage = opened(path)
    springs = swinging.robots[0].springs
    masses = np.repeat(springs.ravel(), 9)
    for frame in range(0, len(swinging.times), 3):
        if geometry == "skel":
            points, joints = skinned(stage, robots_of(stage)[0], frame)["bars"]
            np.testing.assert_array_equal(joints, masses)
        else:
            points = world_points(form(robots_of(stage)[0], "bars"), frame)
        positions = swinging.frames(0)[frame]
        assert roundness(points, masses, springs, positions) > 0.6, frame
    if geometry == "skel":  # and who does not bend does not pay for it
        motions = [p for p in stage.Traverse() if p.GetTypeName() == "SkelAnimation"]
        turning = [p.GetAttribute("rotations").GetNumTimeSamples() for p in motions]
        assert turning == [len(swinging.times), 0]


# -- colours by material -----------------------------------------------------------------------


@pytest.mark.parametrize("geometry", ["skel", "points"])
def test_bars_are_coloured_by_their_materials(cube, geometry, tmp_path):
    body = cube.made_of(ws.materials.BONE).made_of(ws.materials.MUSCLE, where=np.arange(10))
    plain = cube.replace(stiffness=np.repeat([100.0, 900.0], 14))
    result = ws.Simulation([body, plain], ws.Scene()).run(0.1, fps=FPS)
    path = ws.export_usd(result, tmp_path / "m.usdc", color="material", geometry=geometry)
    assert validation_errors(path) == []
    stage = opened(path)
    robot, other = robots_of(stage)
    primvar = UsdGeom.PrimvarsAPI(form(robot, "bars")).GetPrimvar("displayColor")
    assert primvar.GetIndicesAttr().GetNumTimeSamples() == 0
    colors = np.array(primvar.ComputeFlattened()).reshape(-1, 28, 3)
    assert np.abs(colors[:, :10] - ws.materials.MUSCLE.rgb).max() < 1e-6
    assert np.abs(colors[:, 10:] - ws.materials.BONE.rgb).max() < 1e-6
    primvar = UsdGeom.PrimvarsAPI(form(other, "bars")).GetPrimvar("displayColor")
    soft, hard = np.array(primvar.ComputeFlattened()).reshape(-1, 28, 3)[0, [0, -1]]
    assert (soft != hard).any()
    if geometry == "skel":  # materials of their own, for viewers that know no indexed colours
        subsets = UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(form(robot, "bars")))
        assert {subset.GetPrim().GetName() for subset in subsets} == {"bone", "muscle"}
        assert sum(len(subset.GetIndicesAttr().Get()) for subset in subsets) == colors[..., 0].size
        for subset in subsets:
            bound, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
            kind = ws.materials.BUILT_IN[subset.GetPrim().GetName()]
            surface = UsdShade.Shader(bound.GetPrim().GetChild("Surface"))
            color = surface.GetInput("diffuseColor").Get()
            np.testing.assert_allclose(color, kind.rgb, rtol=1e-6)


@pytest.mark.parametrize("geometry", ["skel", "points", "mesh"])
@pytest.mark.parametrize("masses", [[2, 5], range(8)])
def test_masses_that_are_held_are_grey(cube, geometry, masses, tmp_path):
    result = ws.Simulation(cube.fixed(masses), ws.Scene(ground=None)).run(0.05, fps=FPS)
    path = ws.export_usd(result, tmp_path / "h.usdc", geometry=geometry)
    assert validation_errors(path) == []
    stage = opened(path)
    balls = form(robots_of(stage)[0], "masses")
    colors = np.array(UsdGeom.PrimvarsAPI(balls).GetPrimvar("displayColor").ComputeFlattened())
    grey = np.abs(colors.reshape(8, -1, 3) - appearance.HELD).max(axis=(1, 2)) < 1e-6
    assert np.flatnonzero(grey).tolist() == list(masses)
    for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(balls)):
        bound, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
        assert bound.GetPath().name == {"Held": "Held", "Free": "Mass"}[subset.GetPrim().GetName()]
        faces = np.array(subset.GetIndicesAttr().Get()) // (len(colors) // 8)
        of = list(masses) if subset.GetPrim().GetName() == "Held" else np.flatnonzero(~grey)
        assert sorted(set(faces.tolist())) == list(of)


# -- obstacles, pushes, cameras ----------------------------------------------------------------


def test_obstacles_stand_around_every_robot(result, tmp_path):
    obstacles = (
        ws.Sphere((1.0, 0.0, 0.1), 0.3),
        ws.Box((0.0, 1.0, 0.1), (0.2, 0.4, 0.6), axis=(0, 0, 1), angle=0.5),
        ws.HeightField(np.array([[0.0, 0.1], [0.2, 0.3]]), 0.5, (2.0, 0.0, 0.0)),
        ws.Plane((1.0, 0.0, 1.0), -2.0),
    )
    scene = ws.Scene(obstacles=obstacles)
    path = ws.export_usd(dataclasses.replace(result, scene=scene), tmp_path / "o.usdc")
    assert validation_errors(path) == []
    stage = opened(path)
    prims = stage.GetPrimAtPath("/World/Obstacles").GetChildren()
    assert len(prims) == 2 * len(obstacles)
    ball = max(appearance.drawn_radii(robot.lengths)[1] for robot in result.robots)
    shifts = [
        mass_positions(stage, robot, 0)[0] - result.frames(index)[0, 0]
        for index, robot in enumerate(robots_of(stage))
    ]
    spheres = [world_points(prim, 0) for prim in prims if "Sphere" in prim.GetName()]
    distances = [
        sorted(np.linalg.norm(points - (1.0, 0.0, 0.1) - shift, axis=1).max() for points in spheres)
        for shift in shifts
    ]
    assert [d[0] for d in distances] == pytest.approx([0.3 - ball] * 2, abs=1e-4)
    fields = [world_points(prim, 0) for prim in prims if "HeightField" in prim.GetName()]
    assert fields[0][:, 2].max() == pytest.approx(0.3 - ball)
    # Neither robots nor obstacles of one world reach into another.
    apart = np.abs(shifts[0] - shifts[1])[:2].max()
    assert apart > 2.5 + 0.1


def test_pushes_are_arrows_while_they_last(result, tmp_path):
    cube = result.robots[0].pushed([2, 5], (0.0, 3.0, 0.0), start=0.1, duration=0.19)
    cube = cube.pushed([0], (0.0, 0.0, 6.0), start=0.401, duration=0.001)  # between two frames
    cube = cube.pushed([0], (0.0, 0.0, 6.0), start=9.0)  # after the end
    pushed = dataclasses.replace(result, robots=(cube, result.robots[1]))
    path = ws.export_usd(pushed, tmp_path / "p.usdc", grid=False)
    assert validation_errors(path) == []
    stage = opened(path)
    arrows = stage.GetPrimAtPath("/World/Pushes").GetChildren()
    assert [arrow.GetName() for arrow in arrows] == [
        "robot_0000_push0_m2", "robot_0000_push0_m5", "robot_0000_push1_m0",
    ]  # fmt: skip
    lengths = []
    for arrow, mass, force in zip(
        arrows, (2, 5, 0), ((0, 1, 0), (0, 1, 0), (0, 0, 1)), strict=True
    ):
        seen = []
        for frame, simulated in enumerate(result.frames(0)):
            if UsdGeom.Imageable(arrow).ComputeVisibility(frame) == "invisible":
                continue
            seen.append(frame)
            points = world_points(arrow, frame)
            along = (points - simulated[mass]) @ force
            lengths.append(np.ptp(along))
            assert min(abs(along.min()), abs(along.max())) < 1e-5  # it begins or ends at its mass
            middle = simulated.mean(axis=0)
            if seen == [frame]:  # outside the body
                assert abs((points.mean(axis=0) - middle) @ force) > abs(
                    (simulated[mass] - middle) @ force
                )
        assert seen == ([12] if mass == 0 else [3, 4, 5, 6, 7, 8])
    assert np.ptp(lengths[-1:]) == 0 and lengths[-1] == pytest.approx(2 * lengths[0], rel=1e-5)


def test_tethers_hold_mass_and_point_and_water_has_a_surface(result, tmp_path):
    cube = result.robots[0].tethered([3], 50.0, point=(0.1, 0.2, 0.9), start=0.1, end=0.29)
    scene = dataclasses.replace(result.scene, water=ws.Water(level=0.15))
    held = dataclasses.replace(result, robots=(cube, result.robots[1]), scene=scene)
    path = ws.export_usd(held, tmp_path / "t.usdc", grid=False)
    assert validation_errors(path) == []
    stage = opened(path)
    rope, peg = stage.GetPrimAtPath("/World/Tethers").GetChildren()
    for frame, simulated in enumerate(result.frames(0)):
        shown = UsdGeom.Imageable(rope).ComputeVisibility(frame) != "invisible"
        assert shown == (3 <= frame <= 8), frame
        if shown:
            points, sides = world_points(rope, frame), 9
            ends = points[:sides].mean(axis=0), points[sides:].mean(axis=0)
            np.testing.assert_allclose(ends, [simulated[3], (0.1, 0.2, 0.9)], atol=1e-5)
    np.testing.assert_allclose(world_points(peg, 5).mean(axis=0), (0.1, 0.2, 0.9), atol=1e-5)
    water = world_points(stage.GetPrimAtPath("/World/Water"), 0)
    np.testing.assert_allclose(water[:, 2], 0.15, atol=1e-6)
    assert np.ptp(water[:, 0]) > 1.0 and np.ptp(water[:, 1]) > 1.0


def test_far_away_robots_are_still_where_they_were(result, tmp_path):
    far = [robot.moved((5e4, 0.0, 0.0)) for robot in result.robots]
    gone = ws.Simulation(far, result.scene).run(0.1, fps=FPS)
    stage = opened(ws.export_usd(gone, tmp_path / "far.usdc", grid=False))
    for index, robot in enumerate(robots_of(stage)):
        np.testing.assert_allclose(
            mass_positions(stage, robot, 2), gone.frames(index)[2], atol=5e-5
        )


def camera_sees(stage, path, points, frame):
    frustum = UsdGeom.Camera(stage.GetPrimAtPath(path)).GetCamera(frame).frustum
    return all(frustum.Intersects(Gf.Vec3d(*point)) for point in points)


def test_the_camera_that_follows_sees_every_robot_large(cube, tmp_path):
    runners = [cube.moving((3.0, 0.0, 0.0)), cube.moving((3.2, 0.0, 0.0)).moved((0, 1, 0))]
    result = ws.Simulation(runners, ws.Scene(ground=None, gravity=(0, 0, 0))).run(1.0, fps=FPS)
    stage = opened(ws.export_usd(result, tmp_path / "run.usdc"))
    path = "/World/Follow/FollowCamera"
    for frame in (0, 10, 20, 30):
        for robot in robots_of(stage):
            points = skinned(stage, robot, frame)["masses"][0]
            assert camera_sees(stage, path, points, frame)
    near = [
        np.linalg.norm(
            to_world(stage.GetPrimAtPath(camera), np.zeros((1, 3)), 0)
            - mass_positions(stage, robots_of(stage)[0], 0).mean(axis=0)
        )
        for camera in (path, "/World/Camera")
    ]
    assert near[0] < 0.5 * near[1]


def test_a_calm_way_keeps_a_steady_pace_and_loses_the_bounce():
    times = np.arange(120) / FPS
    steady = np.stack([0.7 * times, -0.2 * times, 0.1 + 0 * times], axis=1)
    np.testing.assert_allclose(usd_cameras._smoothed(steady, times), steady, atol=1e-12)
    bouncing = steady + np.outer(np.sin(20.0 * times), [0, 0, 0.05])
    assert np.abs(usd_cameras._smoothed(bouncing, times) - steady)[40:-40].max() < 1e-3
    np.testing.assert_array_equal(usd_cameras._smoothed(steady[:1], times[:1]), steady[:1])


@pytest.mark.parametrize("geometry", ["skel", "mesh", "points"])
def test_bars_of_broken_springs_vanish_when_they_break(torn, tmp_path, geometry):
    path = ws.export_usd(torn, tmp_path / "torn.usdc", geometry=geometry)
    assert validation_errors(path) == []
    stage = opened(path)
    bars = form(robots_of(stage)[0], "bars")
    for frame, time in enumerate(torn.times):
        if geometry == "points":
            shown = np.array(UsdGeom.BasisCurves(bars).GetWidthsAttr().Get(frame)) > 0.0
        else:
            faces = np.array(UsdGeom.Mesh(bars).GetFaceVertexIndicesAttr().Get(frame))
            has_area = np.ptp(faces.reshape(-1, 4), axis=1) > 0
            shown = has_area.reshape(-1, 2).all(axis=0)
            assert (has_area.reshape(-1, 2) == shown).all()
        assert shown.tolist() == [True, not time >= torn.broken(0)[1]], frame


# -- progress and choices ----------------------------------------------------------------------


def test_progress_rises_to_one(result, tmp_path, monkeypatch):
    monkeypatch.setattr("warp_springs.io.usd.export._BLOCK_BYTES", 1)
    seen = []
    ws.export_usd(result, tmp_path / "a.usdc", progress=seen.append)
    assert len(seen) == 2 * len(result.times) + 1
    assert seen == sorted(seen) and seen[0] > 0.0 and seen[-2] < 1.0 == seen[-1]


@pytest.mark.parametrize("option", ["geometry", "color", "springs"])
def test_unknown_choices_are_named(result, tmp_path, option):
    with pytest.raises(ValueError, match=rf"{option}: got 'best', expected 'auto'|'stress'"):
        ws.export_usd(result, tmp_path / "a.usdc", **{option: "best"})


def test_rest_values_stand_beside_all_samples(result, tmp_path):
    for geometry in ("points", "mesh"):
        stage = opened(ws.export_usd(result, tmp_path / "a.usdc", geometry=geometry))
        for prim in stage.Traverse():
            for attribute in prim.GetAttributes():
                if attribute.GetNumTimeSamples():
                    assert attribute.Get(Usd.TimeCode.Default()) is not None, attribute
