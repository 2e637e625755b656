"""Result files: everything comes back to the bit, damaged files are refused, frames stay lazy."""

import dataclasses
import json
import zipfile

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.io import trees


@pytest.fixture(scope="module")
def result(tumbling_cube, walker):
    """Three robots of two kinds, two of them recorded, with energies and a late start."""
    scene = ws.Scene(gravity=(0.1, 0.0, -9.0), damping=0.5)
    simulation = ws.Simulation([tumbling_cube, walker, tumbling_cube], scene)
    simulation.run(0.1)
    return simulation.run(0.2, fps=30, record=[0, 1], energy=True)


@pytest.fixture
def saved(result, tmp_path):
    return result.save(tmp_path / "run.npz")


def assert_same(one, other):
    assert len(one) == len(other)
    for field in dataclasses.fields(ws.Result):
        if field.name.startswith("_") or field.name == "energy":
            continue
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
        else:
            assert list(a) == list(b) if field.name == "robots" else a == b
    for index in range(len(one)):
        np.testing.assert_array_equal(one.positions(index), other.positions(index))
        np.testing.assert_array_equal(one.velocities(index), other.velocities(index))
    for index in one.recorded:
        np.testing.assert_array_equal(one.frames(index), other.frames(index))
    assert (one.energy is None) == (other.energy is None)
    if one.energy is not None:
        for name, account in dataclasses.asdict(one.energy).items():
            np.testing.assert_array_equal(account, getattr(other.energy, name))


def test_everything_comes_back_to_the_bit(result, saved):
    again = ws.Result.load(saved)
    assert_same(result, again)
    assert again.scene == result.scene and again.start_time == result.start_time == 0.1
    assert isinstance(again.scene.gravity, tuple)
    with pytest.raises(ValueError, match="robot 2 was not recorded"):
        again.frames(2)


def test_a_loaded_result_can_be_saved_over_itself_and_exported(result, saved, tmp_path):
    again = ws.Result.load(saved)
    again.save(saved)
    assert_same(result, ws.Result.load(saved))
    assert ws.export_usd(again, tmp_path / "run.usdc").is_file()


def test_variants_stay_variants(cube, tmp_path):
    many = cube.variants(stiffness=np.linspace(500.0, 900.0, 40)[:, None] * np.ones(28))
    result = ws.Simulation(many, ws.Scene(ground=None)).run(0.01)
    again = ws.Result.load(result.save(tmp_path / "many.npz"))
    assert isinstance(again.robots, ws.Variants)
    np.testing.assert_array_equal(again.robots.array("stiffness"), many.array("stiffness"))
    assert_same(result, again)
    assert again.recorded == () and again.scene.ground is None


def test_materials_elements_and_obstacles(cube, tmp_path):
    """Data that kernels may not know yet must come back all the same."""
    robot = (
        cube.made_of(ws.materials.MUSCLE, where=np.arange(5))
        .with_cables(np.arange(3))
        .pushed([1, 2], (0.0, 1.0, 0.0), start=0.1, duration=0.1)
        .fixed([0])
        .held_to(ws.Sphere((0, 0, 1), 2.0), [3])
        .tethered([4], 50.0, (0.0, 0.0, 1.0))
    )
    scene = ws.Scene(
        drag=0.1,
        wind=(1, 0, 0),
        water=ws.Water(level=-1.0),
        ground=ws.Ground(material=("rubber", "concrete")),
        obstacles=(
            ws.Plane((1, 0, 1)),
            ws.HeightField(np.eye(3), 0.5),
            ws.Box((2, 0, 0), (1, 1, 1)),
        ),
    )
    plain = ws.Simulation(cube, ws.Scene()).run(0.01)
    result = dataclasses.replace(plain, robots=(robot,), scene=scene)
    again = ws.Result.load(result.save(tmp_path / "rich.npz"))
    assert again.robots[0] == robot and again.robots[0].materials == robot.materials
    assert again.robots[0].elements == robot.elements
    np.testing.assert_array_equal(again.scene.obstacles[1].heights, np.eye(3))
    assert again.scene.obstacles[::2] == scene.obstacles[::2]
    assert (again.scene.water, again.scene.wind) == (scene.water, scene.wind)
    assert again.scene.ground == scene.ground


def test_robots_that_were_refused_and_odd_bodies(tmp_path):
    point = ws.Robot(masses=1.0, positions=[(0, 0, 1)], springs=[], stiffness=[])
    bomb = ws.shapes.cube(stiffness=1e300).replace(rest_length=1e300)
    result = ws.Simulation([point, bomb], ws.Scene()).run(0.1, fps=30)
    assert result.status[1] != 0
    assert_same(result, ws.Result.load(result.save(tmp_path / "odd.npz")))


def test_arrays_that_robots_share_are_written_once(cube, tmp_path):
    sizes = []
    for count in (100, 200):
        result = ws.Simulation([cube] * count, ws.Scene(ground=None)).run(0.001)
        sizes.append(result.save(tmp_path / "same.npz").stat().st_size)
    assert sizes[1] - sizes[0] < 100 * 600  # states of 8 masses and a reference, no springs


def test_the_documented_layout(result, saved):
    file = np.load(saved)
    header = json.loads(file["header"].item())
    assert (header["format"], header["version"]) == ("warp_springs result", 1)
    assert header["warp_springs"] == ws.__version__
    dtype, first, shape = header["result"]["times"]["array"]
    times = file[f"pool/{dtype}"][first : first + shape[0]]
    np.testing.assert_array_equal(times, result.times)
    np.testing.assert_array_equal(file["frames/1"], result.frames(1))
    np.testing.assert_array_equal(file["positions"][8:20], result.positions(1))


def test_frames_stay_on_the_disk_until_asked_for(saved):
    frames = ws.Result.load(saved).frames(0)
    assert isinstance(frames.base, np.memmap) and not frames.flags.writeable


def rewritten(path, change):
    """The file with its header changed."""
    with zipfile.ZipFile(path) as file:
        entries = {name: file.read(name) for name in file.namelist()}
    header = json.loads(np.load(path)["header"].item())
    change(header)
    with zipfile.ZipFile(path, "w") as file:
        for name, data in entries.items():
            if name != "header.npy":
                file.writestr(name, data)
        with file.open("header.npy", "w") as entry:
            np.lib.format.write_array(entry, np.array(json.dumps(header).encode()))


def forge_type(name):
    def change(header):
        header["objects"].append({"type": name, "fields": {"command": "true"}})

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h: h.update(format="robot"), "'robot', expected 'warp_springs result'"),
        (lambda h: h.update(version=9, warp_springs="7.0"), "version 9 .* warp_springs 7.0"),
        (lambda h: h["result"].pop("scene"), "scene"),
        (forge_type("subprocess.Popen"), "subprocess.Popen"),
        (forge_type("warp_springs.io.results.os"), "which this version has not"),
        (forge_type("quiet"), "which this version has not"),
    ],
)
def test_files_of_something_else_are_refused(saved, change, message):
    rewritten(saved, change)
    with pytest.raises(ValueError, match=message) as error:
        ws.Result.load(saved)
    assert str(saved) in str(error.value)


def test_damaged_files_are_refused(saved, tmp_path):
    whole = saved.read_bytes()
    for part in (whole[: len(whole) // 2], b"", b"not a zip at all", whole[:-30]):
        (tmp_path / "part.npz").write_bytes(part)
        with pytest.raises(ValueError, match=r"part\.npz: this is no readable result file"):
            ws.Result.load(tmp_path / "part.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match="no readable result file"):
        ws.Result.load(tmp_path / "other.npz")
    with pytest.raises(FileNotFoundError, match=r"absent\.npz"):
        ws.Result.load(tmp_path / "absent.npz")


def test_what_cannot_be_written_is_named(result, saved, tmp_path):
    before = saved.read_bytes()
    with pytest.raises(TypeError, match=r"device: a function cannot be kept"):
        dataclasses.replace(result, device=lambda: 1).save(saved)
    assert saved.read_bytes() == before
    with pytest.raises(ValueError, match=r"run\.txt.*\.npz"):
        result.save(tmp_path / "run.txt")
    assert {path.name for path in tmp_path.iterdir()} == {"run.npz"}


@pytest.mark.parametrize(
    "value",
    [None, True, 3, -0.0, float("inf"), "é", (1, (2.5,)), [1, [2]], {"a": 1, 2: (3,)}],
)
def test_trees_come_back(value):
    writer = trees.Writer()
    tree = json.loads(json.dumps(writer.tree(value, "x")))
    assert repr(trees.Reader(writer.pools(), writer.objects).value(tree)) == repr(value)
