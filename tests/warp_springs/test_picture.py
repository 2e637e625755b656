"""Pictures of results: colours, arrangement, files, and errors that say what is wrong."""

import dataclasses
import errno

import numpy as np
import pytest
from PIL import Image

import warp_springs as ws
from tests.warp_springs.posed import posed
from warp_springs.view import appearance
from warp_springs.view.look import Look
from warp_springs.view.pictures import picture
from warp_springs.view.pictures.actors import actors_of
from warp_springs.view.pictures.camera import Camera
from warp_springs.view.pictures.directing import put_on_grid
from warp_springs.view.pictures.rasteriser import Rasteriser
from warp_springs.view.pictures.scenery import draw_scene

SIZE = (160, 120)


@pytest.fixture(scope="module")
def cubes():
    robots = [ws.shapes.cube().moved((0, 0, 0.1 * i)) for i in range(3)]
    squeezed = [np.stack((r.positions, r.positions * (1, 1, 0.9))) for r in robots]
    return posed(robots, squeezed)


def spring_pixels(stretch, color="stress"):
    robot = ws.Robot(
        masses=1.0, positions=[(-0.1, 0, 0.1), (0.1, 0, 0.1)], springs=[(0, 1)], stiffness=100.0
    )
    frames = robot.positions[None] * [(stretch, 1, 1)]
    camera = Camera(eye=(0.0, -1.0, 0.1), target=(0.0, 0.0, 0.1))
    pixels = picture.picture(
        posed([robot], [frames], ground=False), size=SIZE, camera=camera, color=color
    )
    return pixels[59, 80].astype(int)


def test_stretched_is_red_compressed_is_blue_relaxed_is_neutral():
    r, g, b = spring_pixels(1.2)
    assert r > 2 * b and r > 2 * g
    r, g, b = spring_pixels(0.8)
    assert b > 2 * r and b > 1.5 * g
    for neutral in (spring_pixels(1.0), spring_pixels(1.2, color="plain")):
        assert np.ptp(neutral) < 25 and neutral.min() > 120


def test_stress_colours_index_their_palette():
    palette, steps = appearance.stress_palette(), appearance.STRESS_STEPS
    index = appearance.stress_index([0.0, 5.0, 99.0, -5.0, -99.0, np.nan, np.inf], 10.0)
    assert index.tolist() == [0, steps // 2, steps, steps + steps // 2, 2 * steps, 0, 0]
    assert palette.shape == (2 * steps + 1, 3)
    ends = [appearance.NEUTRAL, appearance.TENSION, appearance.COMPRESSION]
    assert np.allclose(palette[[0, steps, -1]], ends)
    assert appearance.stress_scale(np.r_[np.ones(99), 1e9, np.nan]) == 1.0
    assert appearance.stress_scale([]) == appearance.LEAST_STRESS_SCALE


def scenery(result, look=Look(), film=False):  # noqa: B008
    """Actors on a grid, and what is to be seen of them at first."""
    actors = actors_of(result, range(len(result.robots)), look, None, film=film)
    put_on_grid(actors)
    return actors, draw_scene(actors, result.scene, look, actors[0].times[0])


def test_same_bits_twice_and_with_any_number_of_threads(cubes):
    _, drawing = scenery(cubes)
    size = (257, 193)
    camera = Camera.framing(drawing.points, size)
    first = Rasteriser(size, threads=1)
    pixels = first.draw(drawing, camera)
    assert pixels.shape == (193, 257, 3) and pixels.dtype == np.uint8
    other = Camera.framing(drawing.points, size, azimuth=30)
    assert not np.array_equal(first.draw(drawing, other), pixels)
    assert np.array_equal(first.draw(drawing, camera), pixels)
    for threads in (2, 3):
        assert np.array_equal(Rasteriser(size, threads=threads).draw(drawing, camera), pixels)


def test_render_of_a_real_run_writes_what_picture_returns(tmp_path):
    robot = ws.shapes.cube().moved((0, 0, 0.05))
    result = ws.Simulation([robot, robot.scaled(2)], ws.Scene()).run(0.1, fps=30)
    path = ws.render(result, tmp_path / "cubes.PNG", size=SIZE, frame=2)
    assert path == tmp_path / "cubes.PNG"
    with Image.open(path) as image:
        written = np.asarray(image)
    assert np.array_equal(written, picture.picture(result, size=SIZE, frame=2))
    assert not np.array_equal(written, picture.picture(result, size=SIZE, frame=0))
    assert [p.name for p in tmp_path.iterdir()] == ["cubes.PNG"]


def test_end_is_shown_without_recording(cubes):
    end = picture.picture(cubes, frame=None, size=SIZE)
    assert np.array_equal(end, picture.picture(cubes, frame=-1, size=SIZE))


def test_skin_and_ground_and_labels_are_drawn_or_not(cubes):
    plain = picture.picture(cubes, size=SIZE)
    assert not np.array_equal(plain, picture.picture(cubes, size=SIZE, skin=False))
    labelled = picture.picture(cubes, size=SIZE, labels=["a", "b", "ω"])
    changed = (labelled != plain).any(axis=2)
    assert 0 < changed.mean() < 0.1
    cubes_in_space = posed(cubes.robots, [cubes.frames(i) for i in range(3)], ground=False)
    space = picture.picture(cubes_in_space, size=SIZE)
    assert not np.array_equal(space, plain)
    assert len(np.unique(space[-1], axis=0)) == 1  # no checker


def test_chosen_camera_frames_all_robots(cubes):
    points = scenery(cubes)[1].points
    for azimuth in (-80, 10, 200):
        camera = Camera.framing(points, SIZE, azimuth=azimuth, elevation=40, margin=1.25)
        share = np.abs(camera.project(points, SIZE)[:, :2] / SIZE * 2 - 1).max()
        assert share == pytest.approx(1 / 1.25, abs=0.02)


def test_grid_keeps_robots_apart_in_reading_order():
    rng = np.random.default_rng(0)
    low = rng.uniform(-9, 9, (7, 3))
    extents = np.stack((low, low + rng.uniform(0.1, 1, (7, 3))), axis=1)
    offsets = appearance.grid_offsets(extents)
    assert np.all(offsets[:, 2] == 0)
    centers = extents.mean(axis=1) + offsets
    assert np.all(np.diff(centers[:3, 0]) > 0) and np.all(np.diff(centers[::3, 1]) < 0)
    moved = extents + offsets[:, None]
    for i in range(7):
        for j in range(i):
            apart = (moved[i, 0] > moved[j, 1]) | (moved[j, 0] > moved[i, 1])
            assert apart[:2].any()


def test_a_single_mass_without_springs_is_drawn():
    none = np.zeros((0, 2), int)
    robot = ws.Robot(masses=1.0, positions=[(5.0, 5.0, 0.3)], springs=none, stiffness=1.0)
    pixels = picture.picture(posed([robot], [robot.positions[None]]), size=SIZE)
    assert pixels[60, 80].max() < 90


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frame": 2}, "frame 2 is out of range: 2 frames were recorded, -2 ... 1"),
        ({"frame": -3}, "frame -3 is out of range"),
        ({"robots": 3}, "robot 3 does not exist: the result holds 0 ... 2"),
        ({"robots": []}, "at least one robot"),
        ({"color": "heat"}, "color: got 'heat', expected 'stress' or 'material' or"),
        ({"labels": ["one"]}, r"labels: got .*each robot shown \(3\)"),
        ({"labels": "abc"}, r"labels: got .*each robot shown \(3\)"),
        ({"size": (0, 10)}, "size must be 1 ... 16384 pixels"),
        ({"size": 7}, r"size must be \(width, height\)"),
    ],
)
def test_wrong_arguments_are_named(cubes, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        ws.render(cubes, tmp_path / "x.png", **change)
    assert not list(tmp_path.iterdir())


def test_robot_that_was_not_recorded_is_named(cubes, tmp_path):
    some = dataclasses.replace(cubes, recorded=(0, 2))
    with pytest.raises(ValueError, match="robot 1 was not recorded; recorded are 0, 2"):
        ws.render(some, tmp_path / "x.png", robots=[0, 1])
    none = dataclasses.replace(cubes, recorded=())
    with pytest.raises(ValueError, match="no robot was recorded"):
        ws.render(none, tmp_path / "x.png")


def test_paths_that_cannot_be_written_are_named(cubes, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"x.gif', expected a name in .png, .mp4, .webp"):
        ws.render(cubes, tmp_path / "x.gif")
    with pytest.raises(NotADirectoryError, match="there is no folder"):
        ws.render(cubes, tmp_path / "missing" / "x.png")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(IsADirectoryError, match="is a folder"):
        ws.render(cubes, tmp_path / "folder.png")

    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    kept = ws.render(cubes, tmp_path / "kept.png", size=SIZE)
    before = kept.read_bytes()
    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(OSError, match=r"cannot write a picture to .*kept.png.*No space left"):
        ws.render(cubes, kept, size=SIZE, frame=0)
    assert kept.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.png", "kept.png"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"eye": (0, 0, 0)}, "same point"),
        ({"eye": (0, 0)}, "three finite coordinates"),
        ({"eye": (0, 0, np.nan)}, "three finite coordinates"),
        ({"eye": (1, 0, 0), "field_of_view": 0.0}, "field_of_view must be 1 ... 150"),
    ],
)
def test_impossible_cameras_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Camera(**fields)
