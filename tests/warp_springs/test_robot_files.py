"""Robot.save and Robot.load: equal robots, documented layout, and refusals that name the file."""

import json

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.materials import BONE, MUSCLE


def bare():
    return ws.shapes.cube()


def material():
    body = ws.shapes.lattice(2, 1, 1).made_of(BONE).made_of(MUSCLE, where=[1, 5])
    return body.spinning((1, 2, 3)).replace(omega=4.0)


def everything():
    body = ws.shapes.lattice(2, 1, 1).with_cables([0, 3]).with_hardening(2e5, [4])
    body = body.with_harmonics([0.01, 0.002], [0.1, 0.2], [5]).with_dashpots(0.1)
    body = body.with_limits(breaks=1e3, springs=[7]).with_winch([0.0, 1.0], [0.0, 0.02], [8])
    body = body.pushed([2], force=(0, 0, 5.0), start=0.1, duration=0.2)
    body = body.tethered([1], stiffness=50.0, point=(0, 0, 1)).shod([3], static_friction=0.04)
    return body.fixed([0]).held_to(ws.Sphere(center=(0, 0, 0), radius=1.0), [11])


def empty():
    return ws.Robot(masses=1.0, positions=[(0, 0, 1)], springs=[], stiffness=1.0)


@pytest.mark.parametrize("make", [bare, material, everything, empty])
def test_what_is_loaded_is_what_was_saved(make, tmp_path):
    robot = make()
    path = robot.save(tmp_path / "robot.npz")
    loaded = ws.Robot.load(path)
    assert loaded == robot
    assert hash(loaded) == hash(robot)
    assert loaded.materials == robot.materials
    assert [p.name for p in tmp_path.iterdir()] == ["robot.npz"]


def test_the_file_is_plain_numpy(tmp_path):
    robot = material()
    with np.load(robot.save(tmp_path / "robot.npz"), allow_pickle=False) as file:
        assert np.array_equal(file["positions"], robot.positions)
        assert file["springs"].dtype == np.int32 and file["omega"] == 4.0
        header = json.loads(file["header"].item())
    assert header["format"] == "warp_springs robot" and header["version"] == 1


def test_results_keep_the_materials_of_their_robots(tmp_path):
    result = ws.Simulation([material()] * 2).run(0.01, fps=100)
    loaded = ws.Result.load(result.save(tmp_path / "result.npz"))
    assert loaded.robots[1] == material()
    assert loaded.robots[1].materials == (BONE, MUSCLE)


def changed(path, **entries):
    with np.load(path) as file:
        content = {name: file[name] for name in file.files} | entries
    np.savez(path, **content)


def test_damaged_files_are_named(tmp_path):
    path = everything().save(tmp_path / "robot.npz")
    whole = path.read_bytes()
    with np.load(path) as file:
        header = json.loads(file["header"].item())
    for share in (0.0, 0.3, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(ValueError, match=r"robot.npz: this is no readable robot file"):
            ws.Robot.load(path)
    for entries, message in [
        ({"header": np.array(json.dumps(header | {"version": 2}).encode())}, "version 2 of"),
        ({"header": np.array(json.dumps(header | {"format": "x"}).encode())}, "format 'x'"),
        ({"masses": np.zeros(12)}, "greater than 0"),
        ({"springs": np.array([[0, 99]], np.int32)}, "two different masses"),
        ({"positions": np.array(["x"])}, "positions"),
    ]:
        path.write_bytes(whole)
        changed(path, **entries)
        with pytest.raises(ValueError, match=f"robot.npz.*{message}"):
            ws.Robot.load(path)
    with pytest.raises(FileNotFoundError):
        ws.Robot.load(tmp_path / "none.npz")
    with pytest.raises(ValueError, match=r"expected a name in \.npz"):
        bare().save(tmp_path / "robot.json")


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = bare().save(tmp_path / "robot.npz")

    def fail(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        material().save(path)
    assert ws.Robot.load(path) == bare()
