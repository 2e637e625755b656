"""The pictures of the README are made by a command, and the command works."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "benchmarks" / "pictures.py"


def test_every_picture_of_the_readme_can_be_made_again():
    shown = re.findall(
        r"!\[[^\]]*\]\(benchmarks/figures/([^)]+)\)", (ROOT / "README.md").read_text()
    )
    made = re.findall(r'^    "([\w.]+)": Studio\.', SCRIPT.read_text(), re.M)
    assert len(shown) >= 4 and set(shown) <= set(made)
    assert all((ROOT / "benchmarks/figures" / name).is_file() for name in made)


def test_a_picture_is_made(tmp_path):
    command = [sys.executable, SCRIPT, "scene.png", "--out", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "making scene.png\n"
    with Image.open(tmp_path / "scene.png") as image:
        pixels = np.asarray(image)
    assert pixels.shape == (720, 1280, 3)
    reds = (pixels[..., 0].astype(int) - pixels[..., 2] > 90).sum()
    blues = (pixels[..., 2].astype(int) - pixels[..., 0] > 90).sum()
    assert reds > 2000 and blues > 2000  # muscles that expand and that contract first


def test_an_unknown_picture_is_one_clear_line():
    done = subprocess.run([sys.executable, SCRIPT, "sunset.png"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "no picture is called sunset.png; there are zoo.png" in done.stderr
