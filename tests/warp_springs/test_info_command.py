"""``warp-springs info FILE``: robots, results, scenes and meshes, and files that are none."""

import subprocess
import sys

import pytest

import warp_springs as ws
from warp_springs import demos
from warp_springs.commands.info import InfoCommand


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    body = ws.shapes.lattice(2, 1, 1).made_of(ws.materials.MUSCLE).fixed([0])
    body.save(folder / "robot.npz")
    plain = ws.shapes.cube().moved((0, 0, 0.1))
    ws.Simulation([plain] * 3).run(0.1, fps=20, energy=True).save(folder / "result.npz")
    ws.write_mesh(plain, folder / "mesh.stl")
    (folder / "scene.toml").write_text(demos.text("ten-cubes"))
    (folder / "broken.npz").write_bytes(b"PK no")
    return folder


def said(path, capsys, **options):
    from rich.console import Console

    InfoCommand(path, **options).run(Console(width=200))
    rows = (line.split("  ", 1) for line in capsys.readouterr().out.splitlines())
    return {name.strip(): value.strip() for name, value in rows}


def test_a_robot(folder, capsys):
    rows = said(folder / "robot.npz", capsys)
    assert rows["holds"] == "a robot"
    assert rows["masses, springs, faces"] == "12, 50, 20"
    assert rows["mass"] == "1.2 kg" and rows["material muscle"] == "50 springs"
    assert rows["elements"] == "bonds"


def test_a_result(folder, capsys):
    rows = said(folder / "result.npz", capsys)
    assert (rows["holds"], rows["robots"], rows["status"]) == ("a result", "3", "OK 3")
    assert rows["frames"] == "3 of 3 robots, 0 s to 0.1 s"


def test_a_scene(folder, capsys):
    rows = said(folder / "scene.toml", capsys)
    assert (rows["holds"], rows["robots"], rows["springs"]) == ("a scene", "10", "280")


def test_a_mesh(folder, capsys):
    rows = said(folder / "mesh.stl", capsys)
    assert rows["masses, springs, faces"] == "8, 18, 12" and rows["volume"] == "0.001 m³"
    assert said(folder / "mesh.stl", capsys, scale="mm")["volume"] == "1e-12 m³"


@pytest.mark.parametrize("name", ["none.npz", "broken.npz", "none.xyz"])
def test_files_that_are_none(folder, name):
    command = [sys.executable, "-m", "warp_springs.cli", "info", name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert name in done.stderr and done.stderr.count("\n") == 1
