"""Pictures against geometry worked out by other means: pinhole formulas and a NumPy ray caster."""

import errno
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from PIL import Image

import warp_springs as ws
from warp_springs.kernels import raster
from warp_springs.view import appearance, picture
from warp_springs.view.camera import Camera
from warp_springs.view.rasteriser import TO_SUN, Drawing, Rasteriser, draw

SIZE = (160, 120)
CAMERA = Camera(eye=(0.0, -2.0, 0.0), target=(0.0, 0.0, 0.0), field_of_view=40.0)
GREY = (0.5, 0.5, 0.5)


def ball(center, radius, color=GREY, floor=None) -> Drawing:
    return Drawing(
        points=np.array([center], dtype=float),
        balls=np.zeros(1, np.int32),
        ball_radius=np.array([radius]),
        ball_color=np.array([color]),
        floor=floor,
    )


def bar(a, b, radius, color=GREY) -> Drawing:
    return Drawing(
        points=np.array([a, b], dtype=float),
        bars=np.array([[0, 1]], np.int32),
        bar_radius=np.array([radius]),
        bar_color=np.array([color]),
        floor=None,
    )


def covered(drawing, camera=CAMERA, size=SIZE) -> np.ndarray:
    """Return where a picture without floor differs from the same picture of nothing."""
    elsewhere = ball((0.0, -1000.0, 0.0), 1e-3)
    empty = draw(elsewhere, camera, size)
    return (draw(drawing, camera, size) != empty).any(axis=2)


def result_of(robots, poses, ground=True, times=None) -> SimpleNamespace:
    """Return what `picture` reads of a result: frames (F, M, 3) of each robot."""
    times = np.arange(len(poses[0])) / 30 if times is None else times
    return SimpleNamespace(
        robots=robots,
        scene=SimpleNamespace(ground=object() if ground else None),
        times=times,
        end_time=float(times[-1]),
        recorded=tuple(range(len(robots))),
        frames=lambda i: poses[i],
        positions=lambda i: poses[i][-1],
    )


@pytest.fixture(scope="module")
def cubes():
    robots = [ws.shapes.cube().moved((0, 0, 0.1 * i)) for i in range(3)]
    squeezed = [np.stack((r.positions, r.positions * (1, 1, 0.9))) for r in robots]
    return result_of(robots, squeezed)


# geometry


@pytest.mark.parametrize("center", [(0.0, 0.0, 0.0), (0.35, 0.2, -0.25), (-0.5, -0.6, 0.2)])
def test_sphere_is_where_the_pinhole_formula_says(center):
    radius = 0.12
    rows, columns = np.nonzero(covered(ball(center, radius), size=(640, 480)))
    x, y, z = center[0], -center[2], center[1] + 2.0
    focal = 240 / np.tan(np.radians(20))
    for seen, across, middle in ((columns, x, 320), (rows, y, 240)):
        angle, half = np.arctan2(across, z), np.arcsin(radius / np.hypot(across, z))
        low, high = middle + focal * np.tan([angle - half, angle + half])
        assert seen.min() == pytest.approx(low, abs=1.0)
        assert seen.max() + 1 == pytest.approx(high, abs=1.0)
    if center == (0.0, 0.0, 0.0):
        expected = np.pi * (focal * radius / np.sqrt(z**2 - radius**2)) ** 2
        assert rows.size == pytest.approx(expected, rel=0.04)  # pixels of the edge count whole


def test_projection_agrees_with_the_formula():
    seen = CAMERA.project([(0.3, 0.4, 0.1)], SIZE)
    focal = 60 / np.tan(np.radians(20))
    assert np.allclose(seen, [[80 + focal * 0.3 / 2.4, 60 - focal * 0.1 / 2.4, 2.4]])


def test_cylinder_has_straight_edges_at_the_right_places():
    radius, size = 0.1, (640, 480)
    mask = covered(bar((-0.4, 0, 0), (0.4, 0, 0), radius), size=size)
    focal = 240 / np.tan(np.radians(20))
    half_height = focal * radius / np.sqrt(4 - radius**2)
    inside = mask[:, 220:420]
    assert np.all(inside.argmax(axis=0) == pytest.approx(240 - half_height, abs=1.0))
    assert np.all(inside.sum(axis=0) == pytest.approx(2 * half_height, abs=2.0))
    columns = np.nonzero(mask[240])[0]
    half_width = focal * 0.4 / (2 - radius)
    assert columns.min() == pytest.approx(320 - half_width, abs=1.0)
    assert columns.max() + 1 == pytest.approx(320 + half_width, abs=1.0)


def drawn_keys(lens, points, triangles, bars, balls):
    """Return surface numbers and depths, one sample in the middle of each pixel, by the kernels."""
    keys = wp.full(lens.width * lens.rows, raster.EMPTY, dtype=wp.uint64, device="cpu")
    middle = wp.array([(0.5, 0.5)], dtype=wp.vec2, device="cpu")
    p = wp.array(points, dtype=wp.vec3, device="cpu")
    t = wp.array(triangles, dtype=wp.vec3i, device="cpu")
    b = wp.array(bars[0], dtype=wp.vec2i, device="cpu")
    s = wp.array(balls[0], dtype=int, device="cpu")
    bar_radius, ball_radius = (wp.array(x[1], dtype=float, device="cpu") for x in (bars, balls))
    n_t, n_b = len(triangles), len(bars[0])

    def launch(kernel, n, inputs):
        inputs = [lens, middle, p, *inputs]
        wp.launch(kernel, (n, lens.parts), inputs=inputs, outputs=[keys], device="cpu")

    launch(raster.draw_triangles, n_t, [t, 0])
    launch(raster.draw_cylinders, n_b, [b, bar_radius, n_t])
    launch(raster.draw_spheres, len(balls[0]), [s, ball_radius, n_t + n_b])
    found = keys.numpy().reshape(lens.rows, lens.width)
    depth = (found >> np.uint64(32)).astype(np.uint32).view(np.float32)
    return (found & np.uint64(0xFFFFFFFF)).astype(np.int64), depth


def cast_rays(lens, points, triangles, bars, balls):
    """Return the same by rays in double precision, shape by shape, with other formulas."""
    columns, rows = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.rows) + 0.5)
    x = (columns - lens.center_x) / lens.focal
    y = (rows - lens.center_y) / lens.focal
    flat, one = np.zeros_like(x), np.ones_like(x)
    if lens.perspective:
        start, d = np.stack((flat, flat, flat), -1), np.stack((x, y, one), -1)
    else:
        start, d = np.stack((x, y, flat), -1), np.stack((flat, flat, one), -1)
    depths = []
    for t in triangles:
        a, e1, e2 = points[t[0]], points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]
        system = np.stack(np.broadcast_arrays(e1, e2, -d), -1)
        u, v, depth = np.moveaxis(np.linalg.solve(system, (start - a)[..., None])[..., 0], -1, 0)
        depths.append(np.where((u >= 0) & (v >= 0) & (u + v <= 1), depth, np.inf))
    for (i, j), radius in zip(*bars, strict=True):
        w = (points[j] - points[i]) / np.linalg.norm(points[j] - points[i])
        across, off = d - (d @ w)[..., None] * w, start - points[i]
        off = off - (off @ w)[..., None] * w
        depth = nearest_root(across, off, radius)
        height = (start + depth[..., None] * d - points[i]) @ w
        inside = (height >= 0) & (height <= np.linalg.norm(points[j] - points[i]))
        depths.append(np.where(inside, depth, np.inf))
    for i, radius in zip(*balls, strict=True):
        depths.append(nearest_root(d, start - points[i], radius))
    depths = np.array(depths)
    nearest = depths.min(axis=0)
    return np.where(np.isfinite(nearest), depths.argmin(axis=0), 0xFFFFFFFF), nearest


def nearest_root(d, off, radius):
    a, b, c = (d * d).sum(-1), (d * off).sum(-1), (off * off).sum(-1) - radius**2
    inside = np.maximum(b * b - a * c, 0)
    return np.where(b * b - a * c >= 0, (-b - np.sqrt(inside)) / a, 1e9)


@pytest.mark.parametrize("perspective", [1, 0])
@pytest.mark.parametrize("seed", range(3))
def test_every_sample_sees_what_a_ray_hits(perspective, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1.2, -0.9, 3.0), (1.2, 0.9, 5.0), (40, 3))
    triangles = rng.permuted(np.tile(np.arange(40), (9, 1)), axis=1)[:, :3]
    bars = rng.permuted(np.tile(np.arange(40), (30, 1)), axis=1)[:, :2], rng.uniform(0.01, 0.1, 30)
    balls = np.arange(20), rng.uniform(0.02, 0.2, 20)
    lens = raster.Lens()
    lens.perspective, lens.near, lens.first_row, lens.parts = perspective, 0.01, 0, 3
    lens.width, lens.rows, lens.center_x, lens.center_y = 192, 144, 96.0, 72.0
    lens.focal = 260.0 if perspective else 70.0
    shapes = (triangles, bars, balls)
    surface, depth = drawn_keys(lens, points, *shapes)
    expected, expected_depth = cast_rays(lens, points, *shapes)
    expected_depth = np.where(expected_depth < 100, expected_depth, np.inf)
    expected = np.where(expected_depth < 100, expected, 0xFFFFFFFF)
    same = surface == expected
    assert same.mean() > 0.9985  # rounding decides on a few samples at edges
    assert (surface != 0xFFFFFFFF).mean() > 0.3
    hit = same & np.isfinite(expected_depth)
    assert np.abs(depth - expected_depth)[hit].max() < 3e-3  # grazing rays
    assert np.median(np.abs(depth - expected_depth)[hit]) < 2e-6


def test_triangles_that_share_edges_leave_no_gap():
    rng = np.random.default_rng(5)
    n = 24
    x, z = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n))
    y = rng.uniform(-0.1, 0.1, (n, n))
    x, z = x + rng.uniform(-0.05, 0.05, (n, n)), z + rng.uniform(-0.05, 0.05, (n, n))
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1))).astype(np.int32)
    sheet = Drawing(
        points=np.stack((x, y, z), -1).reshape(-1, 3),
        triangles=triangles,
        triangle_color=np.zeros((len(triangles), 3)),
        floor=None,
    )
    assert draw(sheet, CAMERA, (400, 300)).max() < 120  # the sky would be bright


def test_nearer_object_hides_a_farther_one():
    red, blue = (0.8, 0.0, 0.0), (0.0, 0.0, 0.8)
    for front, back in ((red, blue), (blue, red)):
        both = Drawing(
            points=np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]),
            balls=np.arange(2, dtype=np.int32),
            ball_radius=np.array([0.1, 0.3]),
            ball_color=np.array([front, back]),
            floor=None,
        )
        pixels = draw(both, CAMERA, SIZE).astype(int)
        (r, _, b), (r_side, _, b_side) = pixels[60, 80], pixels[60, 80 + 18]
        assert (r > b) == (front == red)
        assert (r_side > b_side) == (back == red)


# light and colour


def test_shadow_falls_along_the_sun_and_is_darker():
    camera = Camera(eye=(0.3, -2.0, 1.5), target=(0.2, 0.2, 0.0))
    size = (320, 240)
    center = np.array([0.0, 0.0, 0.4])
    lit = draw(ball((0.0, -1000.0, 5.0), 1e-3, floor=0.0), camera, size).astype(int)
    shaded = draw(ball(center, 0.1, floor=0.0), camera, size).astype(int)
    to_sun = np.array(TO_SUN) / TO_SUN[2]
    column, row, _ = camera.project([center - to_sun * center[2]], size)[0]
    place = int(row), int(column)
    assert np.all(shaded[place] < 0.8 * lit[place])
    far = camera.project([(0.6, -0.3, 0.0)], size)[0]
    place = int(far[1]), int(far[0])
    assert np.array_equal(shaded[place], lit[place])


def test_shadow_is_softer_under_a_higher_object():
    camera = Camera(eye=(0.0, -0.001, 3.0), target=(0.0, 0.0, 0.0), field_of_view=15)
    size = (300, 300)
    lit = draw(ball((9.0, 9.0, 1.0), 1e-3, floor=0.0), camera, size)[150, :, 1].astype(float)
    widths = []
    for height in (0.25, 0.6):  # the shadow falls on the middle, the ball hides what is below it
        pair = Drawing(
            points=np.array([np.array(TO_SUN) / TO_SUN[2] * height, (1.5, 0, 0.1)]),
            balls=np.arange(2, dtype=np.int32),
            ball_radius=np.array([0.1, 0.1]),
            ball_color=np.array([GREY, GREY]),
        )
        light = draw(pair, camera, size)[150, :, 1] / lit
        assert light.min() < 0.7
        widths.append(np.count_nonzero((light > 0.7) & (light < 0.98)))
    assert widths[1] > 1.5 * widths[0] > 0


def spring_pixels(stretch, color="stress"):
    robot = ws.Robot(
        masses=1.0, positions=[(-0.1, 0, 0.1), (0.1, 0, 0.1)], springs=[(0, 1)], stiffness=100.0
    )
    frames = robot.positions[None] * [(stretch, 1, 1)]
    camera = Camera(eye=(0.0, -1.0, 0.1), target=(0.0, 0.0, 0.1))
    pixels = picture.picture(
        result_of([robot], [frames], ground=False), size=SIZE, camera=camera, color=color
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
    assert np.allclose(palette[[0, steps, -1]], [appearance.NEUTRAL, appearance.TENSION,
                                                 appearance.COMPRESSION])  # fmt: skip
    assert appearance.stress_scale(np.r_[np.ones(99), 1e9, np.nan]) == 1.0
    assert appearance.stress_scale([]) == appearance.LEAST_STRESS_SCALE


# the whole picture


def test_same_bits_twice_and_with_any_number_of_threads(cubes):
    poses = picture.side_by_side([picture.pose(cubes, i, -1) for i in range(3)])
    drawing = picture.arrange(poses)
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
    cubes_in_space = result_of(cubes.robots, [cubes.frames(i) for i in range(3)], ground=False)
    space = picture.picture(cubes_in_space, size=SIZE)
    assert not np.array_equal(space, plain)
    assert len(np.unique(space[-1], axis=0)) == 1  # no checker


def test_chosen_camera_frames_all_robots(cubes):
    poses = picture.side_by_side([picture.pose(cubes, i, -1) for i in range(3)])
    points = np.concatenate([p.positions for p in poses])
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
    robot = ws.Robot(masses=1.0, positions=[(5.0, 5.0, 0.3)], springs=np.zeros((0, 2)),
                     stiffness=1.0)  # fmt: skip
    pixels = picture.picture(result_of([robot], [robot.positions[None]]), size=SIZE)
    assert pixels[60, 80].max() < 90


# errors


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frame": 2}, "frame 2 is out of range: 2 frames were recorded, -2 ... 1"),
        ({"frame": -3}, "frame -3 is out of range"),
        ({"robots": 3}, "robot 3 does not exist: the result holds 0 ... 2"),
        ({"robots": []}, "at least one robot"),
        ({"color": "heat"}, "color must be one of 'stress', 'plain', got 'heat'"),
        ({"labels": ["one"]}, "labels must be 3 texts"),
        ({"labels": "abc"}, "labels must be 3 texts"),
        ({"size": (0, 10)}, "size must be 1 ... 16384 pixels"),
        ({"size": 7}, r"size must be \(width, height\)"),
    ],
)
def test_wrong_arguments_are_named(cubes, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        ws.render(cubes, tmp_path / "x.png", **change)
    assert not list(tmp_path.iterdir())


def test_robot_that_was_not_recorded_is_named(cubes, tmp_path):
    some = SimpleNamespace(**{**vars(cubes), "recorded": (0, 2)})
    with pytest.raises(ValueError, match="robot 1 was not recorded; recorded are 0, 2"):
        ws.render(some, tmp_path / "x.png", robots=[0, 1])
    none = SimpleNamespace(**{**vars(cubes), "recorded": ()})
    with pytest.raises(ValueError, match="no robot was recorded"):
        ws.render(none, tmp_path / "x.png")


def test_paths_that_cannot_be_written_are_named(cubes, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"must end in .png, got .*x.gif"):
        ws.render(cubes, tmp_path / "x.gif")
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        ws.render(cubes, tmp_path / "missing" / "x.png")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(IsADirectoryError, match="it is a folder"):
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
