"""The rasteriser against pinhole formulas and against rays cast in NumPy."""

import numpy as np
import pytest
import warp as wp

from warp_springs.kernels import raster, shading
from warp_springs.view.pictures.camera import Camera
from warp_springs.view.pictures.rasteriser import TO_SUN, Drawing, draw

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


def test_the_kernels_compile_for_cuda(tmp_path):
    for module in (raster, shading):  # without a GPU, ahead of time
        wp.compile_aot_module(module, arch=[80], module_dir=str(tmp_path))
    binaries = sorted(path.name for path in tmp_path.glob("*.cubin"))
    assert len(binaries) == 2 and "raster" in binaries[0] and "shading" in binaries[1]
