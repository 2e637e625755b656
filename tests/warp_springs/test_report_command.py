"""``warp-springs report``: as a real process, and opened in a real browser."""

from __future__ import annotations

import subprocess
import sys

import pytest

import warp_springs as ws
from tests.chromium import Browser
from warp_springs.view.pages import exhibits

SCENE = """
name = "pair"
about = "two cubes fall"
scene.damping = 0.25
simulation.duration = 0.4
record.fps = 20
record.write = ["result"]
[[robots]]
name = "upper"
body.shape = "cube"
position = [0, 0, 0.2]
[[robots]]
name = "lower"
body.shape = "cube"
body.stiffness = 4321.0
position = [0, 0, 0.02]
"""


@pytest.fixture(autouse=True)
def small_films(monkeypatch):
    films = tuple((kind, (160, 90), 10.0) for kind, _, _ in exhibits.FILMS)
    monkeypatch.setattr(exhibits, "FILMS", films)


@pytest.fixture
def shell(tmp_path):
    def run(*arguments):
        command = [sys.executable, "-m", "warp_springs.cli", *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


def test_a_run_is_reported_with_all_its_parameters(shell, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    assert shell("run", "scene.toml").returncode == 0
    done = shell("report", "out/pair.npz")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "wrote out/pair_report.html\n"
    path = tmp_path / "out" / "pair_report.html"
    assert path.stat().st_size < 5_000_000
    with Browser() as browser:
        page = browser.open(path.as_uri(), size=(1100, 900))
        page.picture()
        text = page.evaluate("document.body.innerText")
        assert page.complaints == [] and page.requests == [path.as_uri()]
        assert page.evaluate("document.querySelectorAll('figure svg').length") == 12
        assert page.evaluate("document.querySelectorAll('video, img[src*=webp]').length") == 2
    for words in ("two cubes fall", "All 2 robots came through 0.4 s", "Motion of upper",
                  "0.25 1/s", "4321 N/m", "warp-springs run pair.toml --out ."):  # fmt: skip
        assert words in text, words


def test_a_result_without_its_scene_tells_what_it_knows(cube, tmp_path):
    ball = ws.Sphere(center=(0.0, 0.3, 0.0), radius=0.1)
    scene = ws.Scene(damping=0.125, ground=None, obstacles=(ball,))
    result = ws.Simulation([cube], scene).run(0.2, fps=20)
    text = ws.write_report(result, tmp_path / "report.html", names={0: "my cube"}).read_text()
    for words in ("scene.damping", "0.125 1/s", "scene.obstacles.0.radius", "my cube: mass"):
        assert words in text, words
    assert "scene.ground" not in text and "footfall" not in text


def test_a_robot_that_was_stopped_is_no_success(cube, tmp_path):
    result = ws.Simulation([cube, cube.moving((0, 0, 1e9))], ws.Scene()).run(0.2, fps=20)
    assert result.status.tolist().count(0) == 1, "the second robot is refused"
    path = ws.write_report(result, tmp_path / "report.html")
    assert '<p class="verdict bad">1 of 2 robots had to be stopped' in path.read_text()


def test_bad_wishes_are_one_clear_line(shell, cube, tmp_path):
    result = ws.Simulation([cube], ws.Scene()).run(0.1)
    with pytest.raises(ValueError, match="no frames"):
        ws.write_report(result, tmp_path / "report.html")
    done = shell("report", "nothing.npz")
    assert done.returncode == 1 and "nothing.npz" in done.stderr
    assert done.stderr.count("\n") == 1
