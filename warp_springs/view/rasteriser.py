"""From triangles, cylinders and spheres to pixels: sets up the kernels of `kernels.raster`.

A picture is drawn in horizontal bands. A band needs memory for its own samples only, and bands
share nothing, so on a CPU several threads draw at once and the bits do not depend on how many.
"""

from __future__ import annotations

import functools
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_springs.kernels import raster, shading
from warp_springs.view import appearance
from warp_springs.view.camera import Camera, view_axes

TO_SUN = (-0.42, -0.62, 1.15)
"""Direction from the floor to the sun, world axes, any length."""

# places of the samples in a pixel: each row and column of a 4 x 4 grid holds one sample
_SAMPLES = ((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875))
_BAND_ROWS = 90
_CUDA_PARTS = 16
_MAP_SIZE = 1024
_SUN_SPREAD = 0.07


@dataclass(frozen=True)
class Drawing:
    """What a picture shows, in world coordinates and m; colours are linear RGB.

    Attributes:
        points: Points that the shapes refer to, (P, 3).
        triangles: Corners as indices of points, (T, 3).
        triangle_color: (T, 3).
        bars: Ends of cylinders as indices of points, (B, 2).
        bar_radius: (B,).
        bar_color: (B, 3).
        balls: Centres of spheres as indices of points, (K,).
        ball_radius: (K,).
        ball_color: (K, 3).
        floor: Height of the floor; None draws none.
        tile: Edge of a tile of the floor's checker.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    triangle_color: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3)))
    bars: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    bar_radius: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    bar_color: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3)))
    balls: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    ball_radius: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    ball_color: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3)))
    floor: float | None = 0.0
    tile: float = 0.1


class Rasteriser:
    """Draws pictures of one size on one device; keeps its buffers from picture to picture."""

    def __init__(
        self, size: tuple[int, int] = (1280, 720), device: str = "cpu", threads: int | None = None
    ):
        """Allocate the buffers.

        Args:
            size: Width and height in pixels, 1 ... 16384 each.
            device: A Warp device, "cpu" or "cuda:0".
            threads: How many threads draw on a CPU; default one for each core that the process
                may use. A CUDA device is driven by one thread.

        Raises:
            ValueError: For a size or a number of threads out of range.
        """
        self.size = _checked_size(size)
        self.device = wp.get_device(device)
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, got {threads}")
        width, height = self.size
        on_cpu = self.device.is_cpu
        self._threads = (threads or _usable_cores()) if on_cpu else 1
        self._parts = 1 if on_cpu else _CUDA_PARTS
        self._stride = 1 if on_cpu else width
        self._band_rows = min(_BAND_ROWS, height) if on_cpu else height
        self._samples = self._vectors(_SAMPLES)
        self._centre_of_pixel = self._vectors(((0.5, 0.5),))
        self._encode = wp.array(_screen_values(), dtype=wp.uint8, device=self.device)
        self._picture = wp.zeros((height, width, 3), dtype=wp.uint8, device=self.device)
        keys = width * self._band_rows * len(_SAMPLES)
        self._keys = [self._empty_keys(keys) for _ in range(self._threads)]
        self._map = self._empty_keys(_MAP_SIZE * _MAP_SIZE)
        table = (_MAP_SIZE + 1, _MAP_SIZE + 1)
        self._sums = wp.zeros(table, dtype=wp.vec2i, device=self.device)

    def draw(self, drawing: Drawing, camera: Camera) -> NDArray[np.uint8]:
        """Return the picture, (H, W, 3) uint8 sRGB; the same input gives the same bits.

        Shapes that reach behind the camera are left out.
        """
        sun, sun_lens, sun_points = self._sunlight(drawing, camera)
        shapes = self._shapes(drawing)
        self._map.fill_(raster.EMPTY)
        self._draw_shapes(sun_lens, self._centre_of_pixel, sun_points, shapes, self._map)
        launch = functools.partial(wp.launch, device=self.device)
        launch(shading.sum_rows, _MAP_SIZE, inputs=[sun, self._map], outputs=[self._sums])
        groups = -(-_MAP_SIZE // int(shading.COLUMNS_A_THREAD))
        launch(shading.sum_columns, groups, inputs=[], outputs=[self._sums])
        points = self._vectors(camera.view(drawing.points))
        surfaces = _surfaces(points, shapes)
        floor = _floor(drawing, camera)
        starts = range(0, self.size[1], self._band_rows)

        def draw_bands(thread: int) -> None:
            for start in starts[thread :: self._threads]:
                self._draw_band(start, camera, sun, floor, surfaces, shapes, self._keys[thread])

        if self._threads == 1:
            draw_bands(0)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(draw_bands, range(self._threads)))
        return self._picture.numpy().copy()

    def _draw_band(self, start, camera, sun, floor, surfaces, shapes, keys) -> None:
        """Draw the rows of the picture from `start` on."""
        width, height = self.size
        lens = raster.Lens()
        lens.perspective = 1
        lens.focal = camera.focal(height)
        lens.center_x = width / 2
        lens.center_y = height / 2
        lens.near = 1e-3 * camera.distance
        lens.width = width
        lens.first_row = start
        lens.rows = min(self._band_rows, height - start)
        lens.parts = self._parts
        keys.fill_(raster.EMPTY)
        self._draw_shapes(lens, self._samples, surfaces.points, shapes, keys)
        wp.launch(
            shading.shade,
            dim=(lens.rows, self._stride),
            inputs=[
                lens,
                self._samples,
                sun,
                floor,
                surfaces,
                self._map,
                self._sums,
                keys,
                self._encode,
                self._stride,
            ],
            outputs=[self._picture],
            device=self.device,
        )

    def _draw_shapes(self, lens, samples, points, shapes, keys) -> None:
        """Put the nearest surface of every sample into the keys."""
        n_triangles, n_bars = len(shapes["triangles"]), len(shapes["bars"])
        launch = functools.partial(wp.launch, outputs=[keys], device=self.device)
        launch(
            raster.draw_triangles,
            (n_triangles, lens.parts),
            inputs=[lens, samples, points, shapes["triangles"], 0],
        )
        launch(
            raster.draw_spheres,
            (len(shapes["balls"]), lens.parts),
            inputs=[
                lens,
                samples,
                points,
                shapes["balls"],
                shapes["ball_radius"],
                n_triangles + n_bars,
            ],
        )
        launch(
            raster.draw_cylinders,
            (n_bars, lens.parts),
            inputs=[lens, samples, points, shapes["bars"], shapes["bar_radius"], n_triangles],
        )

    def _shapes(self, drawing: Drawing) -> dict[str, wp.array]:
        """Return the shapes as arrays on the device."""
        colors = (drawing.triangle_color, drawing.bar_color, drawing.ball_color)
        array = functools.partial(wp.array, device=self.device)
        return {
            "triangles": array(drawing.triangles.astype(np.int32), dtype=wp.vec3i),
            "bars": array(drawing.bars.astype(np.int32), dtype=wp.vec2i),
            "bar_radius": array(drawing.bar_radius.astype(np.float32), dtype=float),
            "balls": array(drawing.balls.astype(np.int32), dtype=int),
            "ball_radius": array(drawing.ball_radius.astype(np.float32), dtype=float),
            "colors": array(np.concatenate(colors).astype(np.float32), dtype=wp.vec3),
        }

    def _sunlight(self, drawing: Drawing, camera: Camera):
        """Return the sun, the lens of its map, and the points as the sun sees them."""
        axes = view_axes(np.negative(TO_SUN))
        seen = drawing.points @ axes.T
        reach = max(float(np.max(drawing.ball_radius, initial=1e-3)), 1e-3)
        low, high = seen.min(axis=0) - reach, seen.max(axis=0) + reach
        # steps of scale and whole texels keep the shadow's edges still from frame to frame
        edge = 2.0 ** (math.ceil(4 * math.log2(1.02 * float((high - low)[:2].max()))) / 4)
        texel = edge / (_MAP_SIZE - 4)
        origin = np.append(np.rint((low + high)[:2] / 2 / texel) * texel, low[2] - reach)

        lens = raster.Lens()
        lens.perspective = 0
        lens.focal = 1 / texel
        lens.center_x = lens.center_y = _MAP_SIZE / 2
        lens.near = 0.0
        lens.width = lens.rows = _MAP_SIZE
        lens.first_row = 0
        lens.parts = self._parts

        sun = shading.Sun()
        sun.direction = wp.vec3(*(camera.axes @ -axes[2]))
        sun.up = wp.vec3(*camera.axes[:, 2])
        sun.turn = wp.mat33((axes @ camera.axes.T).ravel())
        sun.shift = wp.vec3(*(axes @ camera.eye - origin))
        sun.scale = 1 / texel
        sun.center = _MAP_SIZE / 2
        sun.size = _MAP_SIZE
        sun.spread = _SUN_SPREAD
        # the height of a point X, Y, Z of the sun's view above the floor is rise . (X, Y, Z) + foot
        rise, foot = axes[:, 2], axes[:, 2] @ origin - (drawing.floor or 0.0)
        slope = -rise[:2] / rise[2] * texel
        sun.floor = wp.vec3(-foot / rise[2] - slope.sum() * _MAP_SIZE / 2, *slope)
        return sun, lens, self._vectors(seen - origin)

    def _vectors(self, values) -> wp.array:
        """Return (..., 2 or 3) values as an array of vectors on the device."""
        values = np.ascontiguousarray(values, dtype=np.float32)
        dtype = wp.vec2 if values.shape[-1] == 2 else wp.vec3
        return wp.array(values, dtype=dtype, device=self.device)

    def _empty_keys(self, n: int) -> wp.array:
        return wp.empty(n, dtype=wp.uint64, device=self.device)


def draw(
    drawing: Drawing, camera: Camera, size: tuple[int, int] = (1280, 720), device: str = "cpu"
) -> NDArray[np.uint8]:
    """Return one picture, (H, W, 3) uint8 sRGB; for many of one size keep a `Rasteriser`."""
    return Rasteriser(size, device).draw(drawing, camera)


def _surfaces(points: wp.array, shapes: dict[str, wp.array]) -> shading.Surfaces:
    surfaces = shading.Surfaces()
    surfaces.points = points
    surfaces.corners = shapes["triangles"]
    surfaces.ends = shapes["bars"]
    surfaces.centers = shapes["balls"]
    surfaces.colors = shapes["colors"]
    return surfaces


def _floor(drawing: Drawing, camera: Camera) -> shading.Floor:
    """Return the floor as the camera sees it; fading scales with the camera's distance."""
    floor = shading.Floor()
    floor.visible = int(drawing.floor is not None)
    floor.height = camera.eye[2] - (drawing.floor or 0.0)
    floor.axis_x = wp.vec3(*(camera.axes[:, 0] / drawing.tile))
    floor.axis_y = wp.vec3(*(camera.axes[:, 1] / drawing.tile))
    floor.eye_x, floor.eye_y = (np.mod(np.array(camera.eye[:2]) / drawing.tile, 2.0)).tolist()
    floor.fade_from = 1.1 * camera.distance
    floor.fade_over = 1.6 * camera.distance
    floor.light = wp.vec3(*appearance.GROUND_LIGHT)
    floor.dark = wp.vec3(*appearance.GROUND_DARK)
    floor.sky = wp.vec3(*appearance.SKY)
    floor.zenith = wp.vec3(*appearance.ZENITH)
    return floor


def _screen_values(n: int = 4096) -> NDArray[np.uint8]:
    """Return the sRGB values of n linear ones from 0 to 1 (IEC 61966-2-1)."""
    linear = np.linspace(0.0, 1.0, n)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * curved).astype(np.uint8)


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    try:
        width, height = (int(n) for n in size)
    except (TypeError, ValueError):
        raise ValueError(f"size must be (width, height) in pixels, got {size!r}") from None
    if not (1 <= width <= 16384 and 1 <= height <= 16384):
        raise ValueError(f"size must be 1 ... 16384 pixels each way, got {size!r}")
    return width, height


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
