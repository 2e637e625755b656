"""USD files: valid, true to the simulation, complete or absent."""

import dataclasses
import math
from itertools import combinations

import numpy as np
import pytest
from pxr import Gf, Tf, Usd, UsdGeom, UsdLux, UsdSkel, UsdUtils

import warp_springs as ws
from tests.warp_springs.usd_reading import (
    mass_positions,
    robots_of,
    skinned,
    validation_errors,
    world_extent,
)
from warp_springs.io.usd import geometry as usd_geometry
from warp_springs.io.usd import layout as usd_layout
from warp_springs.io.usd import poses as usd_poses
from warp_springs.view import appearance

FPS = 30
SIDES = usd_geometry.FINE.sides


@pytest.fixture(scope="module")
def result(tumbling_cube, walker):
    """A spinning cube that lands and a breathing pair of cubes, 0.5 s."""
    robots = [tumbling_cube.spinning((0.0, 0.0, 15.0)), walker]
    return ws.Simulation(robots, ws.Scene()).run(0.5, fps=FPS)


@pytest.fixture(scope="module")
def exported(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("usd") / "two.usdc"
    return ws.export_usd(result, path, names={1: "walker"}), result


@pytest.fixture
def stage(exported):
    return Usd.Stage.Open(str(exported[0]))


def one_frame_of(robot, scene=None):
    """A run of two frames, a step apart."""
    dt = 1e-4
    return ws.Simulation([robot], scene or ws.Scene(ground=None), dt).run(dt, fps=1.0 / dt)


def assert_all_finite(stage):
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            for time in [Usd.TimeCode.Default(), *attribute.GetTimeSamples()]:
                value = attribute.Get(time)
                try:
                    number = np.array(value, dtype=np.float64)
                except (TypeError, ValueError):
                    continue  # tokens and quaternions; the latter are read as extents below
                assert value is None or np.isfinite(number).all(), attribute.GetPath()
    for robot in robots_of(stage):
        for frame in range(int(stage.GetEndTimeCode()) + 1):
            assert np.isfinite(np.array(world_extent(robot, frame).ComputeAlignedRange().min)).all()


# -- a well-formed stage -----------------------------------------------------------------------


@pytest.mark.parametrize("geometry", ["skel", "points", "mesh"])
@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usdz", ".USDA"])
def test_every_format_passes_all_validators(result, tmp_path, suffix, geometry):
    path = ws.export_usd(result, tmp_path / f"robots{suffix}", geometry=geometry)
    assert path == tmp_path / f"robots{suffix}"
    assert validation_errors(path) == []
    assert len(robots_of(Usd.Stage.Open(str(path)))) == 2
    head = path.read_bytes()[:8]
    assert head.startswith({"c": b"PXR-USDC", "a": b"#usda", "z": b"PK"}[path.suffix.lower()[-1]])


def test_stage_metadata(stage, exported):
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetRootLayer().HasTimeCodesPerSecond()
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == FPS
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, len(exported[1].times) - 1)
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == "assembly"
    assert [Usd.ModelAPI(robot).GetKind() for robot in robots_of(stage)] == ["component"] * 2
    assert all(robot.IsModel() for robot in robots_of(stage))


def test_layer_says_how_it_was_simulated(stage, exported):
    said = stage.GetRootLayer().customLayerData["warp_springs"]
    assert said["version"] == ws.__version__
    assert said["dt"] == exported[1].dt
    assert said["integrator"] == exported[1].integrator
    assert list(said["scene"]["gravity"]) == [0.0, 0.0, -9.81]
    assert said["scene"]["ground"]["stiffness"] == 1e5
    assert said["endTime"] == pytest.approx(0.5, abs=1e-4)


def test_what_is_animated_also_has_a_rest_value_and_a_unique_name(stage):
    animated = [
        attribute
        for prim in stage.Traverse()
        for attribute in prim.GetAttributes()
        if attribute.GetNumTimeSamples()
    ]
    assert len(animated) == 2 * 5 + 1  # translation, turn, joints, extent, colours; a camera
    assert all(a.Get(Usd.TimeCode.Default()) is not None for a in animated)
    prims = {a.GetPrim().GetPath() for a in animated}
    assert len({path.name for path in prims}) == len(prims)
    joints = [
        joint
        for prim in stage.Traverse()
        if prim.IsA(UsdSkel.Skeleton)
        for joint in UsdSkel.Skeleton(prim).GetJointsAttr().Get()
    ]
    assert len(set(joints)) == len(joints) == 8 + 12


def test_ground_lights_and_camera(stage, exported):
    ground = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ground"))
    tiles = UsdGeom.Subset.GetAllGeomSubsets(ground)
    counts = [len(tile.GetIndicesAttr().Get()) for tile in tiles]
    assert len(tiles) == 2 and counts[0] == counts[1]
    assert np.ptp(np.array(ground.GetPointsAttr().Get())[:, 2]) == 0.0
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Lights/Key"))
    assert sun.GetNormalizeAttr().Get() is True
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(0).frustum
    for robot in robots_of(stage):
        for frame in range(len(exported[1].times)):
            points = skinned(stage, robot, frame)["masses"][0]
            assert all(frustum.Intersects(Gf.Vec3d(*point)) for point in points)


def test_no_ground_in_the_scene_none_in_the_file(cube, tmp_path):
    path = ws.export_usd(one_frame_of(cube), tmp_path / "space.usda")
    assert not Usd.Stage.Open(str(path)).GetPrimAtPath("/World/Ground")


@pytest.mark.parametrize("fps", [30, 24, 1000 / 3, 7])
def test_frame_rate_is_the_one_asked_for(fps):
    dt = 1e-4
    times = np.rint(np.arange(40) / fps / dt) * dt
    assert usd_layout.frame_rate(times, dt) == pytest.approx(fps, rel=1e-3)
    if fps == int(fps):
        assert usd_layout.frame_rate(times, dt) == fps
    assert usd_layout.frame_rate(times[:1], dt) == 24.0


# -- true to the simulation --------------------------------------------------------------------


def test_skinned_masses_are_where_they_were_simulated(tumbling_cube, tmp_path):
    result = ws.Simulation([tumbling_cube], ws.Scene()).run(0.5, fps=FPS)
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "cube.usdc")))
    (robot,) = robots_of(stage)
    for frame, simulated in enumerate(result.frames(0)):
        assert np.abs(mass_positions(stage, robot, frame) - simulated).max() < 5e-5


def test_robots_on_the_grid_are_only_shifted_sideways(stage, exported):
    for index, robot in enumerate(robots_of(stage)):
        shifts = [
            mass_positions(stage, robot, frame) - simulated
            for frame, simulated in enumerate(exported[1].frames(index))
        ]
        assert np.ptp(np.concatenate(shifts), axis=0).max() < 5e-5
        assert np.abs(np.concatenate(shifts)[:, 2]).max() < 5e-5


def test_bars_end_at_their_masses(stage, exported):
    _, walker = robots_of(stage)
    springs = exported[1].robots[1].springs
    for frame in (0, 9):
        masses = mass_positions(stage, walker, frame)
        points, joints = skinned(stage, walker, frame)["bars"]
        ends = points.reshape(len(springs), 2, SIDES, 3).mean(axis=2)
        assert np.abs(ends - masses[springs]).max() < 5e-5
        assert np.array_equal(joints.reshape(len(springs), 2, -1)[:, :, 0], springs)


def test_extents_contain_every_point_of_every_frame(stage, exported):
    for robot in robots_of(stage):
        for frame in range(len(exported[1].times)):
            box = world_extent(robot, frame)
            inverse = box.matrix.GetInverse()
            for points, _ in skinned(stage, robot, frame).values():
                inside = np.array([inverse.Transform(Gf.Vec3d(*point)) for point in points])
                assert (inside >= np.array(box.box.min) - 1e-7).all()
                assert (inside <= np.array(box.box.max) + 1e-7).all()


def test_turns_go_the_short_way(stage):
    spinning = UsdGeom.Xformable(robots_of(stage)[0])
    orient = spinning.GetOrderedXformOps()[1].GetAttr()
    turns = [orient.Get(time) for time in orient.GetTimeSamples()]
    q = np.array([[turn.GetReal(), *turn.GetImaginary()] for turn in turns])
    assert np.allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-6)
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.5).all()
    assert q[:, 0].min() < -0.5  # it did turn so far that a sign had to be kept


def test_colours_follow_the_stress(tmp_path):
    x = np.array([0.0, 0.1, 0.2, 0.3])
    bar = ws.Robot(
        masses=1.0,
        positions=np.stack([x, 0 * x, 0 * x + 1], axis=1),
        springs=[(0, 1), (1, 2), (2, 3)],
        stiffness=100.0,
        rest_length=[0.08, 0.12, 0.1],  # stretched, compressed, at rest
    )
    stage = Usd.Stage.Open(str(ws.export_usd(one_frame_of(bar), tmp_path / "bar.usdc")))
    (robot,) = robots_of(stage)
    mesh = stage.GetPrimAtPath(robot.GetPath().AppendPath("robot_0000_body/robot_0000_bars"))
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor")
    assert primvar.GetInterpolation() == "uniform"
    faces = np.array(primvar.ComputeFlattened(0)).reshape(SIDES, 3, 3)
    assert (np.ptp(faces, axis=0) == 0).all()
    stretched, compressed, resting = faces[0]
    np.testing.assert_allclose(stretched, appearance.TENSION, rtol=1e-5)
    np.testing.assert_allclose(compressed, appearance.COMPRESSION, rtol=1e-5)
    np.testing.assert_allclose(resting, appearance.NEUTRAL, rtol=1e-5)
    assert robot.GetCustomDataByKey("warp_springs:stressScale") == pytest.approx(2.0, rel=0.01)
    assert (np.array(primvar.GetIndices()) == 0).all()  # neutral where nothing is animated


def test_colours_in_every_frame_are_those_of_the_tensions(stage, exported):
    result, robot = exported[1], robots_of(stage)[1]
    mesh = stage.GetPrimAtPath("/World/Robots/walker/walker_body/walker_bars")
    indices = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor").GetIndicesAttr()
    scale = robot.GetCustomDataByKey("warp_springs:stressScale")
    tension = result.robots[1].tension(result.frames(1), result.times)
    expected = appearance.stress_index(tension, scale)
    assert 0 < np.mean(expected > appearance.STRESS_STEPS) < 1
    for frame, colors in enumerate(expected):
        shown = np.array(indices.Get(frame)).reshape(SIDES, -1)
        assert (shown == colors).all()


# -- which robots, where, under which names ----------------------------------------------------


def test_robots_never_overlap_on_the_grid(tmp_path, cube):
    towards = [cube.moving((1.0 if i % 2 == 0 else -1.0, 0.2 * i, 0.0)) for i in range(5)]
    result = ws.Simulation(towards, ws.Scene(ground=None)).run(0.4, fps=40)
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "five.usdc")))
    for frame in range(len(result.times)):
        boxes = []
        for robot in robots_of(stage):
            points = skinned(stage, robot, frame)["masses"][0]
            boxes.append((points.min(axis=0), points.max(axis=0)))
        for (low, high), (other_low, other_high) in combinations(boxes, 2):
            assert ((high < other_low) | (other_high < low))[:2].any()


def test_robots_that_walk_side_by_side_stand_close(tmp_path, cube):
    result = ws.Simulation([cube.moving((4.0, 0.0, 0.0))] * 4, ws.Scene(ground=None)).run(1, fps=10)
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "four.usdc")))
    middles = [mass_positions(stage, robot, 0).mean(axis=0) for robot in robots_of(stage)]
    assert 0.1 < np.linalg.norm(middles[1] - middles[0]) < 0.2


def test_spacing_and_no_grid(result, tmp_path):
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "a.usdc", spacing=2.5)))
    cells = []
    for robot in robots_of(stage):
        points = skinned(stage, robot, 0)["masses"][0]
        cells.append((points.min(axis=0) + points.max(axis=0)) / 2)
    assert np.linalg.norm((cells[1] - cells[0])[:2]) == pytest.approx(2.5, abs=1e-4)
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "b.usdc", grid=False)))
    for index, robot in enumerate(robots_of(stage)):
        assert np.abs(mass_positions(stage, robot, 0) - result.frames(index)[0]).max() < 5e-5


def test_chosen_robots_names_and_custom_data(result, tmp_path):
    data = {
        "fitness": np.float64(1.5),
        "seed": 2**40,
        "genome": np.arange(3.0),
        "valid": True,
        "parents": [3, 4],
        "run": {"name": "première", "none": None},
    }
    path = ws.export_usd(
        result, tmp_path / "a.usdc", robots=[1], names={1: "2 best/no. 1"}, custom_data={1: data}
    )
    stage = Usd.Stage.Open(str(path))
    (robot,) = robots_of(stage)
    assert robot.GetName() == "robot_2_best_no__1"
    assert robot.GetDisplayName() == "2 best/no. 1"
    kept = robot.GetCustomData()
    assert (kept["fitness"], kept["seed"], kept["valid"]) == (1.5, 2**40, True)
    assert list(kept["genome"]) == [0.0, 1.0, 2.0] and list(kept["parents"]) == [3, 4]
    assert kept["run"] == {"name": "première"}
    assert kept["warp_springs"]["index"] == 1
    assert kept["warp_springs"]["status"] == "OK"
    assert validation_errors(path) == []


def test_names_are_unique_and_never_those_of_the_scenery():
    names = ["best", "Best", "best", "Ground", ""]
    unique = usd_layout.unique_names(names, ["World", "Ground"])
    assert unique == ["best", "Best_2", "best_3", "Ground_2", "robot_"]


# -- bodies and runs that went wrong -----------------------------------------------------------

ODD = {
    "one mass": ws.Robot(
        masses=1.0, positions=[(0, 0, 1)], springs=np.zeros((0, 2), int), stiffness=[]
    ),
    "no springs": ws.Robot(
        masses=1.0, positions=[(0, 0, 1), (1, 0, 2)], springs=np.zeros((0, 2), int), stiffness=[]
    ),
    "coincident masses": ws.Robot(
        masses=1.0,
        positions=[(0, 0, 1), (0, 0, 1), (0.1, 0, 1)],
        springs=[(0, 1), (1, 2), (1, 2)],
        stiffness=50.0,
    ),
    "nothing but a point": ws.Robot(
        masses=1.0, positions=[(0, 0, 1), (0, 0, 1)], springs=[(0, 1)], stiffness=50.0
    ),
    "spinning line": ws.Robot(
        masses=0.1,
        positions=[(0, 0, 1), (0.1, 0, 1), (0.2, 0, 1)],
        springs=[(0, 1), (1, 2)],
        stiffness=50.0,
    ).spinning((0, 5, 9)),
    "bomb": ws.shapes.cube(stiffness=1e9).replace(rest_length=np.linspace(0.05, 0.3, 28)),
    "absurd": ws.shapes.cube(stiffness=1e300).replace(rest_length=1e300),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_bodies_export(name, tmp_path):
    robot = ODD[name]
    result = ws.Simulation([robot], ws.Scene()).run(0.2, fps=FPS)
    path = ws.export_usd(result, tmp_path / "odd.usdc")
    stage = Usd.Stage.Open(str(path))
    assert validation_errors(path) == []
    assert_all_finite(stage)
    (prim,) = robots_of(stage)
    for frame, simulated in enumerate(result.frames(0)):
        assert np.abs(mass_positions(stage, prim, frame) - simulated).max() < 5e-5
    status = prim.GetCustomDataByKey("warp_springs:status")
    assert status == ws.Status(int(result.status[0])).name
    assert (status == "OK") == (name not in ("bomb", "absurd"))
    assert prim.HasCustomDataKey("warp_springs:statusTime") == (status != "OK")


def test_frames_that_are_not_finite_repeat_the_last_good_one(result, tmp_path):
    frames = result.frames(0).copy()
    frames[4:] = np.nan
    frames[6, 0] = 1e300
    broken = dataclasses.replace(result, _frames={0: frames}, recorded=(0,))
    path = ws.export_usd(broken, tmp_path / "nan.usdc")
    stage = Usd.Stage.Open(str(path))
    (robot,) = robots_of(stage)
    assert_all_finite(stage)
    last = len(result.times) - 1
    assert np.abs(mass_positions(stage, robot, last) - frames[3]).max() < 5e-5
    assert robot.GetCustomDataByKey("warp_springs:heldFrames") == last - 3
    assert validation_errors(path) == []


def test_blocks_of_frames_join_seamlessly(result, tmp_path, monkeypatch):
    whole = ws.export_usd(result, tmp_path / "whole.usda").read_text()
    monkeypatch.setattr("warp_springs.io.usd.export._BLOCK_BYTES", 1)
    assert ws.export_usd(result, tmp_path / "blocks.usda").read_text() == whole


# -- complete or absent ------------------------------------------------------------------------


def test_an_export_that_fails_leaves_the_old_file_alone(result, tmp_path, monkeypatch):
    path = tmp_path / "robots.usdc"
    ws.export_usd(result, path)
    before = path.read_bytes()

    def fail(self, *arguments):
        raise RuntimeError("disk on fire")

    monkeypatch.setattr("warp_springs.io.usd.skel.SkelBody.write", fail)
    with pytest.raises(RuntimeError, match="on fire"):
        ws.export_usd(result, path)
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["robots.usdc"]


def test_writing_over_a_stage_that_is_open_shows_the_new_one(result, tmp_path):
    path = ws.export_usd(result, tmp_path / "robots.usdc", robots=[0])
    open_stage = Usd.Stage.Open(str(path))
    assert len(robots_of(open_stage)) == 1
    before = path.read_bytes()
    with path.open("rb") as reader:
        ws.export_usd(result, path)
        assert reader.read() == before  # renamed into its place: nobody sees half of it
    assert len(robots_of(open_stage)) == 2


def test_a_failure_of_usd_is_an_os_error(result, tmp_path, monkeypatch):
    def fail(*arguments):
        errors = []
        for _ in range(2):  # a full disk is told of for every block that did not fit
            with pytest.raises(Tf.ErrorException) as caught:
                Usd.Stage.Open(str(tmp_path / "absent.usdc"))
            errors += caught.value.args
        raise Tf.ErrorException(*errors)

    monkeypatch.setattr(UsdUtils, "CreateNewUsdzPackage", fail)
    with pytest.raises(OSError, match=r"could not write .*robots\.usdz") as refused:
        ws.export_usd(result, tmp_path / "robots.usdz")
    assert str(refused.value).count("absent.usdc") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"path": "robots.obj"}, r"robots\.obj.*\.usdc, \.usda, \.usdz"),
        ({"robots": [0, 7]}, r"robots\[1\]: robot 7 was not recorded; recorded are 0, 1"),
        ({"robots": [1, 1]}, "twice"),
        ({"robots": []}, "empty choice"),
        ({"robots": [0], "names": {1: "b"}}, "names: got robot 1"),
        ({"custom_data": {5: {}}}, "custom_data: got robot 5"),
        ({"custom_data": {0: {"fitness": math.nan}}}, r"custom_data\[0\]\['fitness'\].*finite"),
        ({"custom_data": {0: {"a": {"b": object()}}}}, r"custom_data\[0\]\['a'\]\['b'\]"),
        ({"custom_data": {0: {"seed": 2**63}}}, "63 bits"),
        ({"custom_data": {0: {3: 1}}}, "key 3"),
        ({"spacing": -1.0}, "spacing: got -1.0"),
        ({"spacing": 1.0, "grid": False}, "grid=False"),
    ],
)
def test_wrong_arguments_are_named(result, tmp_path, options, message):
    options = dict(options)
    path = tmp_path / options.pop("path", "robots.usdc")
    with pytest.raises(ValueError, match=message):
        ws.export_usd(result, path, **options)
    assert list(tmp_path.iterdir()) == []


def test_a_result_without_frames_is_refused(cube, tmp_path):
    result = ws.Simulation([cube], ws.Scene()).run(0.01)
    with pytest.raises(ValueError, match="no frames to export; simulate with"):
        ws.export_usd(result, tmp_path / "none.usdc")


def test_a_robot_without_any_finite_frame_is_named(result, tmp_path):
    nothing = np.full_like(result.frames(1), np.nan)
    broken = dataclasses.replace(result, _frames={0: result.frames(0), 1: nothing})
    with pytest.raises(ValueError, match="robot 1: no frame has finite positions"):
        ws.export_usd(broken, tmp_path / "nan.usdc")


def test_folders_that_cannot_be_written_to(result, tmp_path):
    with pytest.raises(NotADirectoryError, match="no folder"):
        ws.export_usd(result, tmp_path / "absent" / "robots.usdc")
    (tmp_path / "folder.usdc").mkdir()
    with pytest.raises(IsADirectoryError, match="is a folder"):
        ws.export_usd(result, tmp_path / "folder.usdc")


# -- meshes and poses --------------------------------------------------------------------------


def face_normals(part):
    corners = part.points[part.faces[:, :3]]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.mark.parametrize("detail", [usd_geometry.COARSE, usd_geometry.FINE])
def test_meshes_face_outward(cube, detail):
    middle = cube.positions - cube.center_of_mass
    springs = np.concatenate([cube.springs, cube.springs[:, ::-1]])
    tubes = usd_geometry.tubes(middle, springs, 0.01, detail.sides)
    balls = usd_geometry.balls(middle, 0.02, detail.cuts)
    for part in (tubes, balls):
        np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1.0)
        along = np.einsum("fi,fci->fc", face_normals(part), part.normals[part.corner_normals])
        assert (along > 0).all()
    at = balls.normals[balls.corner_normals]
    np.testing.assert_allclose(
        balls.points[balls.faces], middle[balls.masses][balls.faces] + 0.02 * at, atol=1e-15
    )
    at = tubes.points[tubes.faces] - 0.01 * tubes.normals[tubes.corner_normals]
    np.testing.assert_allclose(at, middle[tubes.masses][tubes.faces], atol=1e-15)
    skin = usd_geometry.skin(middle, cube.faces)
    outward = skin.points[skin.faces].mean(axis=1)
    assert (np.sum(face_normals(skin) * outward, axis=1) > 0).all()


@pytest.mark.parametrize(("cuts", "faces"), [(2, 48), (4, 192)])
def test_a_ball_is_closed(cuts, faces):
    ball = usd_geometry.balls(np.zeros((1, 3)), 1.0, cuts)
    edges = np.concatenate([ball.faces[:, [0, 1]], ball.faces[:, [1, 2]], ball.faces[:, [2, 0]]])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == 3 * faces and all((b, a) in there for a, b in there)


def test_tubes_are_cut_almost_straight():
    vectors = np.random.default_rng(3).normal(size=(5000, 3))
    axes = usd_geometry.axes()[usd_geometry.nearest_axes(vectors)]
    cosines = np.abs(np.sum(axes * vectors, axis=1)) / np.linalg.norm(vectors, axis=1)
    assert np.degrees(np.arccos(cosines.min())) < 7.0
    rings = usd_geometry.ring_normals(SIDES).reshape(-1, SIDES, 3)
    assert np.abs(np.einsum("aki,ai->ak", rings, usd_geometry.axes())).max() < 1e-12


def test_rigid_fit_recovers_a_motion(cube):
    rng = np.random.default_rng(5)
    rest = cube.positions - cube.positions.mean(axis=0)
    axes = rng.normal(size=(20, 3))
    centres = rng.normal(size=(20, 3))
    moved = [
        cube.rotated(axis, 6.0 * k / 19).moved(centre - cube.center_of_mass)
        for k, (axis, centre) in enumerate(zip(axes, centres, strict=True))
    ]
    frames = np.stack([robot.positions for robot in moved])
    fitted, rotations = usd_poses.rigid_fit(rest, frames)
    np.testing.assert_allclose(fitted, centres, atol=1e-12)
    np.testing.assert_allclose(
        rest @ rotations.transpose(0, 2, 1) + centres[:, None], frames, atol=1e-8
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    for q, rotation in zip(usd_poses.quaternions(rotations), rotations, strict=True):
        turned = np.array(Gf.Matrix3d(Gf.Quatd(q[3], *q[:3])))
        np.testing.assert_allclose(turned.T, rotation, atol=1e-12)


def test_a_mirrored_body_is_still_turned_and_not_mirrored(cube):
    rest = cube.positions - cube.positions.mean(axis=0)
    _, rotations = usd_poses.rigid_fit(rest, (rest * [1.0, 1.0, -1.0])[None])
    assert np.linalg.det(rotations[0]) == pytest.approx(1.0)


def test_what_a_body_leaves_open_is_not_turned():
    along, across = np.array([(1.0, 2.0, 2.0), (2.0, 1.0, -2.0)]) / 3.0
    angle = np.linspace(0.0, 3.0, 7)[:, None]
    turned = np.cos(angle) * along + np.sin(angle) * across
    places = np.array([-1.0, 0.0, 1.0])[:, None]
    _, rotations = usd_poses.rigid_fit(places * along, places * turned[:, None])
    np.testing.assert_allclose(rotations @ along, turned, atol=1e-5)
    axis = np.cross(along, across)
    np.testing.assert_allclose(rotations @ axis, np.tile(axis, (7, 1)), atol=1e-5)
    _, rotations = usd_poses.rigid_fit(np.zeros((2, 3)), np.ones((1, 2, 3)))
    np.testing.assert_array_equal(rotations[0], np.eye(3))
