"""USD files in three.js: they open without a complaint, play, and are where they were simulated."""

import numpy as np
import pytest

import warp_springs as ws
from tests.three_viewer import Viewer
from warp_springs.view import appearance

FPS = 30


@pytest.fixture(scope="module")
def viewer():
    with Viewer() as viewer:
        yield viewer


@pytest.fixture(scope="module")
def result(tumbling_cube, walker):
    robots = [tumbling_cube.spinning((0.0, 0.0, 15.0)), walker]
    return ws.Simulation(robots, ws.Scene()).run(0.5, fps=FPS)


def share_like(picture, linear):
    """Share of a picture's pixels whose hue is that of a colour in linear RGB."""
    wanted = appearance.to_screen(linear)
    pixels = picture.astype(float) / 255.0
    flat = pixels - pixels.mean(axis=2, keepdims=True)
    wanted = wanted - wanted.mean()
    length = np.linalg.norm(flat, axis=2) * np.linalg.norm(wanted)
    along = flat @ wanted
    saturated = np.linalg.norm(flat, axis=2) > 0.5 * np.linalg.norm(wanted)
    return np.mean((along > 0.97 * length) & saturated)


@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usdz"])
def test_every_format_opens_and_plays_true_to_the_simulation(viewer, result, tmp_path, suffix):
    path = ws.export_usd(result, tmp_path / f"robots{suffix}", grid=False)
    page = viewer.open(path)
    for frame in (0, 7, 15):
        page.evaluate(f"show({frame / FPS})")
        for index in range(2):
            places = np.array(page.evaluate(f"masses('robot_000{index}')"))
            assert np.abs(places - result.frames(index)[frame]).max() < 5e-5
    assert page.complaints == []
    assert page.evaluate("clips.every((clip) => Math.abs(clip.duration - 0.5) < 1e-6)")


def test_it_is_drawn_and_moves(viewer, result, tmp_path):
    page = viewer.open(ws.export_usd(result, tmp_path / "robots.usdc"))
    pictures = []
    for time in (0.0, 0.25):
        page.evaluate(f"show({time})")
        pictures.append(page.picture())
    assert 0.01 < share_like(pictures[0], appearance.SKIN) < 0.5
    changed = (np.abs(np.subtract(*pictures, dtype=int)).max(axis=2) > 40).mean()
    assert 0.005 < changed < 0.5
    # The camera that follows keeps a robot that crosses the other's picture.
    assert page.evaluate("cameras") == ["Camera", "FollowCamera"]
    assert page.complaints == []


def test_bars_have_the_colours_of_their_materials(viewer, cube, tmp_path):
    body = cube.moved((0, 0, 0.2)).made_of(ws.materials.MUSCLE)
    body = body.made_of(ws.materials.MUSCLE2, where=np.arange(14)).replace(faces=None)
    result = ws.Simulation(body, ws.Scene()).run(0.1, fps=FPS)
    page = viewer.open(ws.export_usd(result, tmp_path / "cube.usdc", color="material"))
    page.evaluate("show(0)")
    picture = page.picture()
    assert share_like(picture, ws.materials.MUSCLE.rgb) > 0.01
    assert share_like(picture, ws.materials.MUSCLE2.rgb) > 0.01


def test_the_camera_that_follows_keeps_up(viewer, cube, tmp_path):
    result = ws.Simulation(cube.moving((3.0, 0.0, 0.0)), ws.Scene(ground=None)).run(1.0, fps=FPS)
    path = ws.export_usd(result, tmp_path / "runner.usdc")
    shares = {}
    for camera in ("Camera", "FollowCamera"):
        page = viewer.open(path, camera)
        page.evaluate("show(1.0)")
        shares[camera] = share_like(page.picture(), appearance.SKIN)
    assert shares["FollowCamera"] > 10 * shares["Camera"] > 0


def test_moving_meshes_at_least_go_along(viewer, result, tmp_path):
    """three.js animates no vertices: the robot moves as a stiff body."""
    page = viewer.open(ws.export_usd(result, tmp_path / "mesh.usdc", geometry="mesh"))
    pictures = []
    for time in (0.0, 0.25):
        page.evaluate(f"show({time})")
        pictures.append(page.picture())
    assert (np.abs(np.subtract(*pictures, dtype=int)).max(axis=2) > 40).mean() > 0.005
    assert page.complaints == []


def test_a_body_that_breaks_opens_without_a_complaint(viewer, breaking_rod, tmp_path):
    space = ws.Scene(ground=None, gravity=(0, 0, 0))
    result = ws.Simulation(breaking_rod, space).run(0.2, fps=FPS)
    page = viewer.open(ws.export_usd(result, tmp_path / "torn.usdc"))
    page.evaluate("show(0.2)")
    places = np.array(page.evaluate("masses('robot_0000')"))
    assert np.abs(places - result.frames(0)[-1]).max() < 5e-5
    assert page.complaints == []
