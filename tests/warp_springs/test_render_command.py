"""``warp-springs render`` as a user meets it: a process, files, exit codes and words."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import warp_springs as ws


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A saved result: two robots with muscles of 2 cycles/s, 0.3 s of them, one recorded."""
    body = ws.shapes.cube().replace(amplitude=0.01, omega=4 * np.pi)
    result = ws.Simulation([body, body.scaled(2)], ws.Scene()).run(0.3, fps=20, record=[1])
    return result.save(tmp_path_factory.mktemp("saved") / "run.npz")


def render(*words):
    command = [sys.executable, "-m", "warp_springs.cli", "render", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True)


def test_a_picture(saved, tmp_path):
    out = tmp_path / "a.png"
    done = render(saved, out, "--size", 160, 90, "--color", "actuation", "--skin", "#aa5522")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == f"wrote {out}"
    ws.render(
        ws.Result.load(saved), tmp_path / "b.png", size=(160, 90), color="actuation", skin="#aa5522"
    )
    assert out.read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_film_of_three_cycles_though_fewer_were_recorded(saved, tmp_path):
    out = tmp_path / "a.webp"
    done = render(saved, out, "--size", 96, 54, "--fps", 10, "--no-bars")
    assert done.returncode == 0, done.stderr
    assert "holds 0.3 s and 3 cycles take 1.5 s: simulating 1.5 s" in done.stdout
    with Image.open(out) as image:
        assert image.n_frames == 15


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["missing.npz", "a.png"], 1, "missing.npz"),
        (["RUN", "a.gif"], 1, "expected a name in .png, .mp4, .webp"),
        (["RUN", "a.png", "--robots", "7"], 1, "robot 7 does not exist"),
        (["RUN", "a.png", "--color", "heat"], 2, "heat"),
        (["RUN"], 2, "OUT"),
    ],
)
def test_what_goes_wrong_is_said_in_a_line(saved, tmp_path, words, code, message):
    words = [saved if word == "RUN" else word for word in words]
    done = subprocess.run(
        [sys.executable, "-m", "warp_springs.cli", "render", *map(str, words)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
