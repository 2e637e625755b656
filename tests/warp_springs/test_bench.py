"""``warp-springs bench``: its populations, its judgement, and the command itself."""

import json
import subprocess
import sys

import numpy as np
import pytest
from rich.console import Console

import warp_springs as ws
from warp_springs.bench import measure
from warp_springs.bench.cases import SECTIONS, Case, base_case, choices, section
from warp_springs.bench.populations import BODIES, FEATURES, different, scene_of, variants
from warp_springs.commands.bench import BenchCommand
from warp_springs.reference import Trial


def test_a_robot_is_the_same_in_a_population_of_any_size():
    few, many = variants("cube", 3), variants("cube", 50)
    assert few[2] == many[2]
    assert few[2] != many[3]


def test_different_robots_share_no_topology():
    robots = different("cube", 200)
    assert len({robot.topology for robot in robots}) == 200
    assert {robot.n_springs for robot in robots} == {26}


def test_springs_of_the_bodies():
    counts = {body: variants(body, 1).body.n_springs for body in BODIES}
    assert counts == {"cube": 28, "lattice": 296, "block": 2000}


@pytest.mark.parametrize("feature", FEATURES)
def test_a_scene_has_what_it_is_asked_for(feature):
    scene, robots = scene_of([feature]), variants("cube", 2, [feature])
    assert (scene.ground is not None) == (feature == "ground")
    assert (scene.damping > 0) == (feature == "damping")
    assert (scene.drag > 0) == (feature == "drag")
    assert robots[0].is_actuated == (feature == "actuation")
    assert scene_of(["ground"]).ground.has_friction is False
    assert scene_of(["ground", "friction"]).ground.has_friction is True


def test_choices_are_what_a_simulation_accepts():
    assert {"float32", "float64"} <= set(choices("precision"))
    assert choices("no such argument") == ()
    for name in SECTIONS:
        cases = section(name, base_case("cpu", 2, quick=True), [1, 4])
        assert len(cases) >= 2
        assert len(set(cases)) == len(cases)


@pytest.mark.parametrize("alike", [True, False])
def test_a_right_case_gets_a_speed(alike):
    case = Case(robots=5, alike=alike, precision="float64", integrator="leapfrog")
    (row,) = measure.measure([case], 2, 0.005, print)
    assert not row.wrong
    assert not row.missing
    assert row.error < 1e-12
    assert len(row.rates) == 2
    assert row.rate > 0


def test_a_case_that_cannot_run_here_says_why():
    (row,) = measure.measure([Case(robots=2, device="cuda:7")], 1, 0.005, print)
    assert "cuda:7" in row.missing
    assert not row.rates


class Elsewhere(Trial):
    """A reference that disagrees: its ground is soft."""

    def __init__(self, robot, scene, *rest):
        super().__init__(robot, ws.Scene(ground=ws.Ground(stiffness=1e3)), *rest)


def test_a_wrong_case_gets_no_speed_and_exit_code_1(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "Trial", Elsewhere)
    monkeypatch.setattr(measure, "_REFERENCES", {})
    out = tmp_path / "b.json"
    command = BenchCommand(section=("population",), sizes=(2,), quick=True, json=out)
    console = Console(record=True, width=100, file=(tmp_path / "screen").open("w"))
    with pytest.raises(RuntimeError, match="1 of 1 rows are wrong"):
        command.run(console)
    screen = console.export_text()
    assert "WRONG" in screen
    assert "wrong by" in screen
    (line,) = json.loads(out.read_text())["rows"]
    assert line["springs_per_second"] is None
    assert line["rates"] == []
    assert line["error_m"] > line["allowed_error_m"]


def test_a_robot_that_is_stopped_is_not_a_speed():
    row = measure.Row(Case(robots=2))
    fast = ws.shapes.cube().moving((1e6, 0, 0))
    result = ws.Simulation([fast] * 2, scene_of([])).run(0.05)
    measure._check_status(row, result)
    assert "2 robots were stopped, robot 0 with TOO_FAST" in row.wrong


def bench(*arguments):
    command = [sys.executable, "-m", "warp_springs.cli", "bench", *arguments]
    return subprocess.run(command, capture_output=True, text=True)


def test_the_command(tmp_path):
    out = tmp_path / "[deep]" / "bench.json"
    done = bench("--quick", "--section", "population", "--sizes", "1", "16", "--json", str(out))
    assert done.returncode == 0, done.stderr
    assert "processor" in done.stdout
    assert "error [m]" in done.stdout and "first use [s]" in done.stdout
    assert str(out) in done.stdout
    written = json.loads(out.read_text())
    assert written["machine"]["warp_springs"] == ws.__version__
    assert [row["robots"] for row in written["rows"]] == [1, 16]
    for row in written["rows"]:
        assert row["error_m"] < row["allowed_error_m"]
        assert row["springs_per_second"] > 0
        assert np.isfinite(row["first_use_s"])


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--rounds", "0"), "--rounds: got 0"),
        (("--sizes", "0"), "--sizes"),
        (("--seconds", "nan"), "--seconds"),
    ],
)
def test_bad_usage_is_one_clear_line(arguments, complaint):
    done = bench(*arguments)
    assert done.returncode == 1
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1
