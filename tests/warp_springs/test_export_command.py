"""``warp-springs export`` as a user meets it: a process, files, exit codes and words."""

import subprocess
import sys

import pytest

import warp_springs as ws
from tests.warp_springs.usd_reading import opened, robots_of, validation_errors


@pytest.fixture(scope="module")
def saved(tumbling_cube, walker, tmp_path_factory):
    simulation = ws.Simulation([tumbling_cube, walker, tumbling_cube], ws.Scene())
    result = simulation.run(0.2, fps=30, record=[0, 1])
    return result.save(tmp_path_factory.mktemp("saved") / "run.npz")


def export(*words):
    command = [sys.executable, "-m", "warp_springs.cli", "export", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_a_saved_result_becomes_an_animation(saved):
    done = export(saved)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"wrote {saved.with_suffix('.usdc')}\n"
    assert validation_errors(saved.with_suffix(".usdc")) == []
    assert len(robots_of(opened(saved.with_suffix(".usdc")))) == 2


def test_choices_reach_the_file(saved, tmp_path):
    out = tmp_path / "one.usda"
    done = export(
        saved, out, "--robots", 1, "--names", "best", "--color", "material", "--geometry", "mesh"
    )
    assert done.returncode == 0, done.stderr
    stage = opened(out)
    (robot,) = robots_of(stage)
    assert robot.GetName() == "best"
    assert {child.GetTypeName() for child in robot.GetChildren()} == {"Mesh"}
    bars = stage.GetPrimAtPath("/World/Robots/best/best_bars")
    assert bars.GetAttribute("primvars:displayColor:indices").GetNumTimeSamples() == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a.gif"], "a.gif"),
        (["a.usdc", "--robots", "2"], "robot 2 was not recorded"),
        (["a.usdc", "--names", "best"], "--names: got 1, expected one for each robot shown (2)"),
    ],
)
def test_mistakes_are_one_line(saved, tmp_path, words, message):
    done = export(saved, tmp_path / words[0], *words[1:])
    assert done.returncode == 1 and done.stdout == ""
    assert message in done.stderr and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_result_is_refused(tmp_path):
    robot = ws.shapes.cube().save(tmp_path / "cube.npz")
    done = export(robot)
    assert done.returncode == 1 and "no readable result file" in done.stderr
