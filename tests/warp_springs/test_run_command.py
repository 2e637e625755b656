"""``warp-springs run``: as a real process."""

import subprocess
import sys

import pytest

import warp_springs as ws
from warp_springs.config import load_scene

SCENE = """
name = "drop"
about = "a cube falls"
robot.body.shape = "cube"
robot.position = [0, 0, 0.05]
simulation.duration = 0.2
record.fps = 30
"""


@pytest.fixture
def shell(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)

    def run(*arguments):
        command = [sys.executable, "-m", "warp_springs.cli", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


def test_a_scene_is_simulated_and_everything_is_written(shell, tmp_path):
    done = shell("run", "scene.toml", "--out", "here", "--set", "robot.body.edge=0.2")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0] == "drop  a cube falls"
    assert "\x1b" not in done.stdout, "no colours in what is piped"
    paths = [line.strip() for line in lines[lines.index("wrote") + 1 :]]
    assert [path.removeprefix("here/drop") for path in paths] == [
        ".npz",
        ".usdc",
        ".png",
        "_energies.png",
        "_parameters.md",
        ".toml",
    ]
    assert {tmp_path / path for path in paths} == set((tmp_path / "here").iterdir())
    result = ws.Result.load(tmp_path / "here" / "drop.npz")
    assert result.robots[0].diameter == pytest.approx(0.2 * 3**0.5)
    table = (tmp_path / "here" / "drop_parameters.md").read_text()
    assert "| robot.body.edge | 0.2 m |" in table
    assert "| scene.gravity | (0, 0, -9.81) m/s² |" in table
    # The scene that was written gives the same result, bit for bit.
    again = load_scene(tmp_path / "here" / "drop.toml").run()
    assert (again.positions(0) == result.positions(0)).all()


def test_a_scene_writes_only_what_it_is_asked_for(shell, tmp_path):
    done = shell("run", "scene.toml", "--set", 'record.write=["mesh", "page"]')
    assert done.returncode == 0, done.stderr
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"drop.pvd", "drop_0000.vtu", "drop.html", "drop.toml", "drop_parameters.md"} <= names
    assert not {"drop.npz", "drop.usdc", "drop.png"} & names


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["none.toml"], 1, "warp-springs: there is no file none.toml\n"),
        (["scene.toml", "--set", "robot.body.edge=-1"], 1, "scene.toml: robot.body.edge: input"),
        (["scene.toml", "--set", "edge"], 1, "--set takes KEY=VALUE"),
        (["scene.toml", "--out", "scene.toml"], 1, "out: scene.toml is no folder"),
        (["scene.toml", "--live-at", "127.0.0.1:80"], 1, "127.0.0.1:80 goes with --live"),
        (["."], 1, "cannot read ."),
        ([], 2, "SCENE.toml"),
    ],
)
def test_failures_are_one_line(shell, arguments, code, message):
    done = shell("run", *arguments)
    assert done.returncode == code
    assert message in done.stderr
    assert code == 2 or done.stderr.count("\n") == 1


def test_a_robot_that_was_stopped_is_an_exit_code_of_its_own(shell):
    done = shell("run", "scene.toml", "--set", "simulation.dt=0.05", "record.write=[]")
    assert done.returncode == 3
    assert "UNSTABLE_STEP 1" in done.stdout
