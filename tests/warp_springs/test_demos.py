"""The demonstrations: what they promise is measured on them, and what they leave behind."""

import subprocess
import sys

import numpy as np
import pytest
from rich.console import Console

from warp_springs import demos
from warp_springs.config import SceneFile, parse
from warp_springs.demos.findings import bounces, findings, heights, peak_deceleration
from warp_springs.demos.slope import demonstrate, trials
from warp_springs.materials import FRICTION
from warp_springs.view.outputs import write_outputs
from warp_springs.view.parameters import energy_change


def shell(folder, *arguments):
    command = [sys.executable, "-m", "warp_springs.cli", "demo", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", demos.NAMES)
def test_every_demonstration_is_a_scene_file(name):
    config = demos.load(name)
    assert config.name == name
    assert config.about == demos.about(name) and len(config.about) < 100
    assert {"usd", "picture", "energies"} <= set(config.record.write)


def test_the_cube_bounces_and_its_energy_is_constant():
    config = demos.load("bouncing-cube")
    result = config.run()
    assert not result.status.any()
    assert bounces(result) >= 3
    assert result.robots[0].velocities.any(), "it spins"
    change, residual = energy_change(result)
    assert change < 0.05 and residual < 0.05  # percent
    total = result.energy.total[0]
    assert change == pytest.approx(100 * np.ptp(total) / np.abs(total).max())


def test_the_cube_breathes_each_spring_in_its_own_phase():
    config = demos.load("breathing-cube")
    robot = config.build_robots()[0]
    assert len(set(np.round(robot.phase, 9))) == 28
    assert config.simulation.duration * robot.omega / (2 * np.pi) >= 3
    facts = dict(findings(config, config.run()))
    assert float(facts["cycles"]) >= 3


def test_ten_cubes_come_to_rest_in_a_pile():
    config = demos.load("ten-cubes")
    result = config.run()
    assert result.status[0] == 0 and len(result) == 1
    assert result.energy.kinetic[0, -1] < 1e-3 * result.energy.total[0, 0]
    assert np.diff(result.energy.total[0]).max() < 1e-3 * result.energy.total[0, 0]
    height = np.sort(heights(config, result))
    assert height[0] > 0.04 and height[-1] > height[0] + 0.1  # some lie on others
    assert [name for name, _ in findings(config, result)][1] == "heights of their centres"


def test_soft_legs_absorb_the_blow():
    config = demos.load("soft-legs")
    assert [round(r.bounds[0, 2], 9) for r in config.build_robots()] == [1.2, 2.0, 1.2, 2.0]
    soft_low, soft_high, stiff_low, stiff_high = (peak_deceleration(config, i) for i in range(4))
    assert stiff_low > 5 * soft_low and stiff_high > 5 * soft_high
    assert soft_high > soft_low


def test_a_smaller_worm_crawls():
    small = {"robot.body.spacing": 0.012, "robot.body.n_springs": 8000, "simulation.duration": 0.5}
    config = demos.load("worm", small)
    result = config.run()
    assert not result.status.any()
    assert abs(result.center_of_mass[0, 0] - config.build_robots()[0].center_of_mass[0]) > 1e-3


def test_the_worm_is_the_courses():
    worm = demos.load("worm")
    assert worm.robot.body.n_springs == 270_033
    assert sorted(worm.robot.body.bounds) == [0.0375, 0.1875, 0.1875]


@pytest.mark.parametrize("pair", [("rubber", "concrete"), ("waxed wood", "dry snow")])
def test_cubes_stay_and_slide_as_predicted(pair):
    (trial,) = trials(demos.load("slope"), {pair: FRICTION[pair]})
    assert trial.creep < 1e-7
    assert trial.measured == pytest.approx(trial.predicted, rel=2e-3)


def test_the_slope_says_units_beside_what_it_found(tmp_path, capsys, monkeypatch):
    few = {pair: FRICTION[pair] for pair in list(FRICTION)[:4]}
    monkeypatch.setattr("warp_springs.demos.slope.trials", lambda config: trials(config, few))
    folder = tmp_path / "[out]"
    assert demonstrate(demos.load("slope"), folder, Console(width=80)) == 0
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert " ".join(lines[2].split()) == "surfaces mu_s mu_k [°] [nm] [°] [m/s²] [m/s²]"
    assert lines[3].startswith("steel on steel")
    assert all(str(path) in printed for path in folder.glob("slope*"))
    assert "creep [nm]" in (folder / "slope_parameters.md").read_text()


def test_a_scene_file_that_was_written_is_the_demonstration(tmp_path):
    config = demos.load("tetrahedron", {"simulation.duration": 0.3, "record.write": []})
    result = config.run()
    paths = write_outputs(config, result, tmp_path, findings(config, result))
    table = paths[0].read_text()
    assert table.startswith("# tetrahedron\n")
    assert "| bounces | " in table and "| scene.damping | 1.00005 1/s |" in table
    again = parse(SceneFile, paths[1].read_text(), "copy")
    assert again.model_dump() == config.model_dump()


def test_a_demonstration_as_a_process(tmp_path):
    done = shell(tmp_path, "tetrahedron", "--set", "simulation.duration=0.3", "record.fps=20")
    assert done.returncode == 0, done.stderr
    assert "total energy varies by" in done.stdout and "robot.body.stiffness" in done.stdout
    names = {path.name for path in (tmp_path / "out").iterdir()}
    endings = (".usdc", ".png", "_energies.png", "_parameters.md", ".toml")
    assert names == {f"tetrahedron{ending}" for ending in endings}


def test_demonstrations_are_listed_and_printed(tmp_path):
    listed = shell(tmp_path, "--list")
    assert listed.returncode == 0
    assert [line.split()[0] for line in listed.stdout.splitlines()] == list(demos.NAMES)
    printed = shell(tmp_path, "ten-cubes", "--toml")
    assert printed.stdout == demos.text("ten-cubes")
    refused = shell(tmp_path, "ten-cube")
    assert refused.returncode == 1 and refused.stderr.count("\n") == 1
    assert (
        "no demonstration 'ten-cube' (did you mean 'ten-cubes'?); there are bounc" in refused.stderr
    )
    assert shell(tmp_path).returncode == 2


def test_the_shell_says_a_line_of_each_command_and_all_in_its_own_help(tmp_path):
    command = [sys.executable, "-m", "warp_springs.cli"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout.count("•") == 7 and "Simulate one of the classroom's" in done.stdout
    assert len(done.stdout.splitlines()) < 35
    own = subprocess.run([*command, "demo", "--help"], capture_output=True, text=True, check=True)
    assert "NAME_energies.png" in own.stdout
