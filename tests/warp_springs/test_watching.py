"""Watching a simulation: its frames so far, and as a page while `warp-springs run` goes on."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest

import warp_springs as ws

SCENE = """
name = "drop"
robot.body.shape = "lattice"
robot.body.nx = 6
robot.body.ny = 6
robot.body.nz = 6
robot.position = [0, 0, 0.05]
simulation.duration = 1.0
simulation.dt = 1e-5
record.fps = 60
record.write = ["result"]
"""


def test_the_frames_so_far_are_those_of_the_end(walker, cube):
    robots = [walker, cube.moved((0.0, 0.0, 0.3)), walker.moved((1.0, 0.0, 0.1))]
    simulation = ws.Simulation(robots, ws.Scene(), dt=2e-5)
    seen = []
    assert simulation.so_far() is None
    result = simulation.run(
        1.0, fps=50, record=[0, 1], energy=True, progress=lambda _: seen.append(simulation.so_far())
    )
    assert simulation.so_far() is None
    seen = [found for found in seen if found is not None]
    counts = [len(found.times) for found in seen]
    assert counts == sorted(counts) and counts[-1] == len(result.times) == 51
    for found in seen:
        count = len(found.times)
        np.testing.assert_array_equal(found.times, result.times[:count])
        for robot in (0, 1):
            np.testing.assert_array_equal(found.frames(robot), result.frames(robot)[:count])
        np.testing.assert_array_equal(found.energy.total, result.energy.total[:, :count])
        np.testing.assert_array_equal(found.energy.work, result.energy.work[:, :count])
    assert "webgl2" in ws.html_page(seen[0])


def test_looking_changes_nothing(walker):
    watched = ws.Simulation([walker], ws.Scene(), dt=1e-4)
    result = watched.run(0.5, fps=30, energy=True, progress=lambda _: watched.so_far())
    alone = ws.Simulation([walker], ws.Scene(), dt=1e-4).run(0.5, fps=30, energy=True)
    np.testing.assert_array_equal(result.frames(0), alone.frames(0))
    np.testing.assert_array_equal(result.energy.residual, alone.energy.residual)


def test_a_scene_is_seen_while_it_runs_and_no_longer(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    command = [sys.executable, "-m", "warp_springs.cli", "run", "scene.toml", "--live"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    for text in process.stdout:
        if "http://" in text:
            url = text.split()[-1]
            break
    states, robots = [], ""
    while process.poll() is None:
        try:
            with urllib.request.urlopen(f"{url}state", timeout=10) as answer:
                states.append(json.load(answer))
            if states[-1]["page"]:
                with urllib.request.urlopen(f"{url}robots", timeout=10) as answer:
                    robots = answer.read().decode()
        except (urllib.error.URLError, ConnectionError):
            break
        time.sleep(0.02)
    assert process.wait(60) == 0
    frames = [dict(state["facts"])["frames"] for state in states if state["facts"]]
    assert len(set(frames)) > 1, "it was updated"
    curve = [state["curve"] for state in states if state["curve"]["x"]][-1]
    result = ws.Result.load(tmp_path / "out" / "drop.npz")
    expected = result.energy.total[0][: len(curve["x"])]
    np.testing.assert_allclose(curve["lines"][0]["values"], expected)
    assert curve["title"] == "energy of lattice" and "webgl2" in robots
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"{url}state", timeout=2)
