"""Films: real files, decoded again; cameras, layouts, labels, forces and obstacles."""

import dataclasses
import errno
import math

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import warp_springs as ws
from warp_springs.view import appearance
from warp_springs.view.look import Cut, Look
from warp_springs.view.pictures import film as film_module
from warp_springs.view.pictures import video
from warp_springs.view.pictures.actors import actors_of, between
from warp_springs.view.pictures.camera import Camera
from warp_springs.view.pictures.directing import Director, Setting
from warp_springs.view.pictures.film import Film
from warp_springs.view.pictures.legend import rows_of
from warp_springs.view.pictures.picture import picture
from warp_springs.view.pictures.rasteriser import Rasteriser

SIZE = (160, 90)


@pytest.fixture(scope="module")
def walk():
    """Two robots with muscles of 4 cycles/s, recorded for three cycles at 20 frames/s."""
    body = ws.shapes.lattice(2, 1, 1, edge=0.1, mass_per_vertex=0.1, stiffness=1500.0)
    body = body.replace(amplitude=0.006, phase=np.linspace(0, 6, body.n_springs), omega=8 * np.pi)
    return ws.Simulation([body, body.scaled(1.5)], ws.Scene(damping=1.0)).run(0.75, fps=20)


def moving_along(velocity, count=21, fps=10):
    """A result whose only robot, a cube, was made to move at a constant velocity."""
    cube = ws.shapes.cube()
    result = ws.Simulation([cube], ws.Scene()).run((count - 1) / fps, fps=fps)
    way = np.arange(count)[:, None] / fps * np.asarray(velocity)
    frames = {0: cube.positions + way[:, None]}
    return dataclasses.replace(result, _frames=frames)


def decoded(path):
    """The properties of an MP4 file, and its pictures."""
    reader = imageio_ffmpeg.read_frames(str(path))
    facts = next(reader)
    width, height = facts["size"]
    return facts, [np.frombuffer(f, np.uint8).reshape(height, width, 3) for f in reader]


def test_mp4_plays_everywhere_and_shows_the_pictures(walk, tmp_path):
    done = []
    path = ws.render(walk, tmp_path / "a.mp4", size=(159, 89), fps=20, progress=done.append)
    facts, frames = decoded(path)
    assert (facts["codec"], facts["size"], facts["fps"]) == ("h264", SIZE, 20.0)
    assert facts["pix_fmt"].startswith("yuv420p")
    data = path.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")  # plays before it is all there
    assert len(frames) == 15 == len(done) and done == sorted(done) and done[-1] == 1.0
    film = Film(walk, [0, 1], Look(), Cut(fps=20), Rasteriser(SIZE))
    for k in (0, 7, 14):
        error = film.picture(k).astype(float) - frames[k]
        assert np.abs(error).mean() < 7.0  # colours have half the resolution
        assert np.abs(error.mean(axis=(0, 1))).max() < 1.5  # and the right matrix and range
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]


@pytest.mark.parametrize("suffix", ["mp4", "webp"])
def test_the_same_film_has_the_same_bytes(walk, tmp_path, suffix):
    files = [
        ws.render(walk, tmp_path / f"{k}.{suffix}", size=SIZE, fps=10, threads=k, turns=1)
        for k in (1, 2)
    ]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_webp_has_all_pictures_for_the_right_time(walk, tmp_path):
    path = ws.render(walk, tmp_path / "a.webp", size=SIZE, fps=24, robots=1)
    film = Film(walk, [1], Look(), Cut(fps=24), Rasteriser(SIZE))
    with Image.open(path) as image:
        assert image.n_frames == len(film) == 18
        total = 0
        for k in range(18):
            image.seek(k)
            pixels = np.asarray(image.convert("RGB"), float)
            assert np.abs(pixels - film.picture(k)).mean() < 7.0
            total += image.info["duration"]
    assert total == 750


def test_pictures_are_drawn_as_the_encoder_takes_them(walk, tmp_path, monkeypatch):
    drawn, seen = [], []
    original = Film.picture
    monkeypatch.setattr(Film, "picture", lambda film, k: drawn.append(k) or original(film, k))
    for suffix in ("mp4", "webp"):
        drawn.clear(), seen.clear()
        path = tmp_path / f"a.{suffix}"
        ws.render(walk, path, size=SIZE, fps=20, progress=lambda _: seen.append(len(drawn)))
        assert drawn == list(range(15))
        assert seen in (list(range(1, 16)), list(range(2, 16)))


def test_slow_motion_goes_smoothly_through_the_frames(walk):
    film = Film(walk, [0], Look(), Cut(fps=20, speed=0.25), Rasteriser(SIZE))
    assert len(film) == 60
    np.testing.assert_allclose(np.diff(film.times), 0.0125)
    t = np.linspace(0.0, 1.0, 11)
    fall = (0.5 - 4.905 * t**2)[:, None, None] * np.ones((1, 2, 3))
    for time in (0.1, 0.3, 0.77, 0.85, 5.0):
        exact = 0.5 - 4.905 * min(time, 1.0) ** 2
        np.testing.assert_allclose(between(t, fall, time), exact, atol=1e-12)


def test_part_of_a_run(walk):
    film = Film(walk, [0], Look(), Cut(start=0.25, duration=0.2, fps=20), Rasteriser(SIZE))
    np.testing.assert_allclose(film.times, [0.25, 0.3, 0.35, 0.4])
    with pytest.raises(ValueError, match=r"start: got 2 s, the frames are of 0 to 0.75 s"):
        Film(walk, [0], Look(), Cut(start=2.0), Rasteriser(SIZE))


def director(result, **options):
    cut = Cut(**{k: v for k, v in options.items() if k in ("follow", "turns")})
    look = Look(camera=options.get("camera"))
    actors = actors_of(result, [0], look, None, film=True)
    return actors[0], Director(actors, Setting(result.times, result.scene, look, cut), SIZE)


@pytest.mark.parametrize("camera", [None, Camera(eye=(2.0, -2.0, 1.0))])
def test_the_camera_follows_a_robot(camera):
    result = moving_along((0.7, -0.4, 0.0))
    for follow in (True, False):
        actor, man = director(result, follow=follow, camera=camera)
        places = [
            man.camera(t).project(actor.positions(t).mean(axis=0)[None], SIZE)[0]
            for t in (0.0, 0.6, 1.3, 2.0)
        ]
        moved = np.ptp(places, axis=0)[:2].max()
        assert moved < 0.5 if follow else moved > 20


def test_a_bouncing_robot_does_not_shake_the_camera():
    cube = ws.shapes.cube().moved((0, 0, 0.4))
    result = ws.Simulation([cube], ws.Scene()).run(1.0, fps=60)
    _, man = director(result)
    heights = [man.camera(t).eye[2] for t in np.linspace(0, 1, 31)]
    assert np.ptp(heights) < 1e-9


def test_the_camera_falls_with_what_falls_freely():
    cube = ws.shapes.cube().moving((1.0, 0.0, 3.0))
    result = ws.Simulation([cube], ws.Scene(ground=None)).run(1.0, fps=20)
    actor, man = director(result)
    for time in (0.0, 0.4, 1.0):
        seen = man.camera(time).project(actor.positions(time).mean(axis=0)[None], SIZE)[0]
        np.testing.assert_allclose(seen[:2], (80, 45), atol=6.0)


@pytest.mark.parametrize(
    ("count", "size", "columns"),
    [(9, (1280, 720), 3), (2, (1280, 720), 2), (25, (1280, 720), 5), (6, (450, 800), 2)],
)
def test_tiles_of_a_panel_have_a_good_shape(count, size, columns):
    assert film_module._columns(count, size) == columns


def test_the_turntable_goes_around_at_one_distance():
    actor, man = director(moving_along((0.3, 0.0, 0.0)), turns=1.0)
    angles, distances = [], []
    for share in (0.0, 0.25, 0.5, 0.75):
        camera = man.camera(2.0 * share, share)
        x, y, _ = np.subtract(camera.eye, actor.way(2.0 * share))
        angles.append(math.degrees(math.atan2(y, x)))
        distances.append(math.hypot(x, y))
        seen = camera.project(actor.positions(2.0 * share), SIZE)
        assert ((seen[:, :2] > 0) & (seen[:, :2] < SIZE)).all()
    np.testing.assert_allclose(np.mod(np.diff(angles), 360), 90, atol=1e-6)
    np.testing.assert_allclose(distances, distances[0])


def test_a_panel_shows_each_robot_in_its_own_tile(tmp_path):
    robots = [ws.shapes.cube(edge=0.1 * 3**i) for i in range(4)]
    result = ws.Simulation(robots, ws.Scene(ground=None, gravity=(0, 0, 0))).run(0.1, fps=10)
    panel = picture(result, size=(324, 184), layout="panel")
    tiles = [panel[y : y + 90, x : x + 160] for y in (0, 94) for x in (0, 164)]
    alone = picture(result, robots=0, size=(160, 90))
    assert (panel[90:94] > 245).all() and (panel[:, 160:164] > 245).all()
    for tile in tiles:  # cubes of any size look alike, each through its own camera
        assert np.abs(tile.astype(int) - tiles[0]).mean() < 1.0
    assert (tiles[0] != alone).mean() > 0.01  # tiles have less margin
    labels = ["a", "b", "c", "d"]
    changed = (picture(result, size=(324, 184), layout="panel", labels=labels) != panel).any(2)
    assert all(changed[y : y + 40, x : x + 40].any() for y in (0, 94) for x in (0, 164))
    for y, x in ((0, 0), (0, 164), (94, 0), (94, 164)):
        changed[y : y + 40, x : x + 40] = False
    assert not changed.any()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("size", [(1280, 720), (400, 300)])
def test_labels_of_a_zoo_hide_nobody(seed, size):
    rng = np.random.default_rng(seed)
    robots = []
    while len(robots) < 9:
        mask = rng.random((3, 2, 3)) < 0.6
        mask[:, 0, 0] = True
        robots.append(ws.shapes.voxels(mask, edge=0.1 * rng.uniform(0.6, 1.0)))
    scene = ws.Scene(ground=None, gravity=(0, 0, 0))  # without a floor there are no shadows on it
    result = ws.Simulation(robots, scene).run(0.01, fps=100)
    plain = picture(result, size=size)
    nothing = picture(result, size=size, skin=False, bars=False, balls=False)
    names = [f"#{74165 + i}   0.9{i}" for i in range(9)]
    labelled = picture(result, size=size, labels=names)
    bare = picture(result, size=size, labels=names, skin=False, bars=False, balls=False)
    words = (bare != nothing).any(axis=2)  # the sky is the same from a camera farther back
    body = (labelled != bare).any(axis=2)
    assert not (words & body).any()
    assert words.sum() > 9 * 200 and (plain != nothing).any(axis=2).mean() > 0.06
    assert not words[[0, -1]].any() and not words[:, [0, -1]].any()


def test_robots_on_a_grid_never_meet_in_a_film():
    cube = ws.shapes.cube()
    robots = [cube.moving((1.5 * s, 0, 0)) for s in (1, -1, 1, -1)]
    scene = ws.Scene(ground=None, gravity=(0, 0, 0))
    result = ws.Simulation(robots, scene).run(1.0, fps=10)
    look = Look(layout="grid")
    film = Film(result, range(4), look, Cut(), Rasteriser(SIZE))
    actors = film.shots[0][0].actors
    for t in np.linspace(0, 1, 11):
        middles = [a.positions(t).mean(axis=0) for a in actors]
        for i in range(4):
            for k in range(i):
                assert np.abs(middles[i] - middles[k]).max() > 0.1


def test_robots_of_a_world_stay_where_they_are(walk):
    film = Film(walk, [0, 1], Look(layout="world"), Cut(), Rasteriser(SIZE))
    actors = film.shots[0][0].actors
    for i in (0, 1):
        np.testing.assert_array_equal(actors[i].positions(0.0), walk.frames(i)[0])


def test_colours_say_what_they_promise(walk):
    robot = walk.robots[0]
    (actor,) = actors_of(walk, [0], Look(color="actuation"), None, film=True)
    strain = robot.rest_length_at(0.3) / robot.rest_length - 1
    longer, shorter = strain.argmax(), strain.argmin()
    colors = actor.colors(0.3)
    assert colors[longer, 0] > 3 * colors[longer, 2]
    assert colors[shorter, 1] > 1.5 * colors[shorter, 0]
    made = robot.made_of(ws.materials.BONE, where=[0, 1]).made_of(ws.materials.MUSCLE, where=[2])
    result = ws.Simulation([made], ws.Scene()).run(0.05, fps=20)
    (actor,) = actors_of(result, [0], Look(color="material"), None, film=True)
    np.testing.assert_allclose(actor.colors(0.0)[1], ws.materials.BONE.rgb, rtol=1e-6)
    np.testing.assert_allclose(actor.colors(0.0)[2], ws.materials.MUSCLE.rgb, rtol=1e-6)


def test_the_legend_says_what_the_colours_mean(walk):
    (actor,) = actors_of(walk, [0], Look(), None, film=True)
    rows = rows_of([actor], Look())
    force = np.abs(walk.robots[0].tension(walk.frames(0), walk.times))
    assert rows[0][1] == f"stretched: {np.percentile(force, 95):.3g} N or more"
    assert rows[1] == (appearance.NEUTRAL, "relaxed")
    assert [w for _, w in rows_of([actor, actor], Look())] == ["stretched", "relaxed", "compressed"]
    (actor,) = actors_of(walk, [0], Look(color="actuation"), None, film=True)
    words = rows_of([actor], Look(color="actuation"))[0][1]
    share = 100 * 0.006 / walk.robots[0].rest_length.min()
    assert float(words.split()[-2]) == pytest.approx(share, rel=0.02)
    bone = dataclasses.replace(actor, body=actor.body.made_of(ws.materials.BONE))
    assert rows_of([bone], Look(color="material")) == [(ws.materials.BONE.rgb, "bone")]
    assert rows_of([actor], Look(color="plain")) == []
    size = (640, 360)
    plain = picture(walk, robots=0, size=size)
    changed = (picture(walk, robots=0, size=size, legend=True) != plain).any(axis=2)
    assert changed[-70:, -250:].any()
    changed[-70:, -250:] = False
    assert not changed.any()


def pixel(pixels, camera, place, size):
    column, row, _ = camera.project(np.array([place]), size)[0]
    return pixels[int(row), int(column)].astype(int)


def test_obstacles_are_where_the_scene_says():
    size = (320, 240)
    camera = Camera(eye=(0.0, -4.0, 2.5), target=(0.0, 0.3, 0.2))
    heights = np.zeros((5, 5))
    heights[2, 2] = 0.5
    obstacles = (
        ws.Sphere(center=(-1.2, 0.0, 0.3), radius=0.3),
        ws.Box(center=(1.2, 0.0, 0.25), size=(0.5, 0.5, 0.5), angle=0.5),
        ws.HeightField(heights=heights, spacing=0.2, origin=(-0.4, 0.6, 0.0)),
        ws.Plane(normal=(0.0, -1.0, 0.0), offset=-2.5),
    )
    cube = ws.shapes.cube()
    bare = ws.Simulation([cube], ws.Scene()).run(0.01, fps=100)
    full = dataclasses.replace(bare, scene=ws.Scene(obstacles=obstacles))
    before, after = (picture(r, size=size, camera=camera) for r in (bare, full))
    brown = np.array(appearance.OBSTACLE) / appearance.OBSTACLE[2]
    for place in [(-1.2, -0.2, 0.5), (1.2, 0.0, 0.5), (0.0, 1.0, 0.4), (0.9, 2.5, 0.8)]:
        r, _, b = pixel(after, camera, place, size)
        assert r > b + 12 and brown[0] > 1, place
    assert np.array_equal(
        pixel(after, camera, (0.5, -0.8, 0), size), pixel(before, camera, (0.5, -0.8, 0), size)
    )


def test_arrows_show_forces_while_they_act():
    size = (320, 240)
    camera = Camera(eye=(0.05, -1.0, 0.05), target=(0.05, 0.0, 0.05))
    cube = ws.shapes.cube(edge=0.1)
    result = ws.Simulation([cube], ws.Scene(ground=None, gravity=(0, 0, 0))).run(0.1, fps=100)
    pushed = cube.pushed([7], (5.0, 0.0, 0.0), start=0.04, duration=0.04)
    result = dataclasses.replace(result, robots=(pushed,))
    tip = 0.1 + 0.55 * cube.diameter
    shown = {}
    for frame in (2, 6, 9):
        pixels = picture(result, size=size, camera=camera, frame=frame)
        shown[frame] = pixel(pixels, camera, (tip - 0.04, 0.1, 0.1), size)
    r, _, b = shown[6]
    assert r > 2 * b
    for frame in (2, 9):
        assert abs(shown[frame][0] - shown[frame][2]) < 60


def test_broken_springs_are_no_longer_drawn(breaking_rod):
    space = ws.Scene(ground=None, gravity=(0, 0, 0))
    result = ws.Simulation(breaking_rod, space).run(0.2, fps=100)
    broke = result.broken(0)[0]  # stretched by 0.1 m: after 0.05 s and a little
    assert 0.05 < broke < 0.07
    camera = Camera(eye=(0.0, -1.0, 0.1), target=(0.0, 0.0, 0.1))
    for frame in (3, 5, 8):
        pixels = picture(result, size=SIZE, camera=camera, frame=frame)
        gone = np.ptp(pixels[35:55, 80].astype(int), axis=0).max() < 15  # sky in the middle
        assert gone == (result.times[frame] > broke)


def test_few_cycles_are_said(walk, tmp_path):
    with pytest.warns(UserWarning, match=r"shows 1.6 cycles .* for 3 record 0.75 s"):
        ws.render(walk, tmp_path / "a.webp", size=SIZE, fps=10, duration=0.4)


def test_a_film_that_fails_leaves_the_old_file(walk, tmp_path):
    kept = tmp_path / "a.mp4"
    kept.write_bytes(b"old")

    def stop(done):
        if done > 0.5:
            raise KeyboardInterrupt

    for path in (kept, tmp_path / "b.webp"):
        with pytest.raises(KeyboardInterrupt):
            ws.render(walk, path, size=SIZE, fps=10, progress=stop)
    assert kept.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]


def test_a_full_disk_is_said(walk, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(video, "write_film", full)
    with pytest.raises(OSError, match=r"cannot write a film to .*a.mp4.*No space left"):
        ws.render(walk, tmp_path / "a.mp4", size=SIZE)
    assert not list(tmp_path.iterdir())


def test_mp4_without_ffmpeg_is_refused_at_once(walk, tmp_path, monkeypatch):
    def missing():
        raise RuntimeError("No ffmpeg exe could be found")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    with pytest.raises(RuntimeError, match=r"pip install 'warp-springs\[video\]'"):
        ws.render(walk, tmp_path / "a.mp4", size=SIZE)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fps": 0}, "fps: got 0, expected a finite number > 0"),
        ({"speed": -1}, "speed: got -1"),
        ({"layout": "row"}, "layout: got 'row', expected 'grid' or 'panel' or 'world'"),
        ({"skin": "blue"}, "skin: got 'blue', expected '#rrggbb'"),
        ({"thickness": 0}, "thickness: got 0"),
        ({"labels": ["a"]}, r"labels: got .*each robot shown \(2\)"),
        ({"size": (10, 10), "layout": "panel"}, "too small for a panel of 2"),
        ({"robots": [0, 5]}, "robot 5 does not exist"),
    ],
)
def test_wrong_options_are_named(walk, tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        ws.render(walk, tmp_path / "a.webp", **{"size": SIZE, **options})
    assert not list(tmp_path.iterdir())


def test_water_tints_what_is_below_its_surface():
    size = (320, 240)
    camera = Camera(eye=(0.05, -1.0, 0.35), target=(0.05, 0.0, 0.05))
    cube = ws.shapes.cube(edge=0.1)
    dry = ws.Simulation([cube], ws.Scene()).run(0.01, fps=100)
    wet = dataclasses.replace(dry, scene=ws.Scene(water=ws.Water(level=0.05)))
    before, after = (picture(r, size=size, camera=camera).astype(int) for r in (dry, wet))
    above, below = (0.05, 0.0, 0.085), (0.05, 0.0, 0.015)
    change = [
        pixel(after, camera, p, size) - pixel(before, camera, p, size) for p in (above, below)
    ]
    assert not change[0].any() and np.abs(change[1]).max() > 10
