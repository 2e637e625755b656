"""From triangles, cylinders and spheres to pixels: sets up the kernels of `kernels.raster`.

A picture is drawn in horizontal bands. A band needs memory for its own samples only, and bands
share nothing, so on a CPU several threads draw at once and the bits do not depend on how many.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from warp_springs.engine.layouts import device_named
from warp_springs.kernels import raster, shading
from warp_springs.view import appearance
from warp_springs.view.pictures.camera import Camera, view_axes

TO_SUN = (-0.42, -0.62, 1.15)
"""Direction from the floor to the sun, world axes, any length."""

# places of the shading.SAMPLES samples in a pixel: one in each row and column of a 4 x 4 grid
_SAMPLES = ((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875))
_BAND_ROWS = 90
_CUDA_BAND_ROWS = 2160
_CUDA_PARTS = 16
_SUN_SPREAD = 0.07
_LONGEST_REACH = 40
_CLARITY = 5.0  # tiles of the floor after which 1 / e of the light comes through water


def _none(*row: int) -> Callable[[], NDArray[np.float64]]:
    """Return a maker of an array without rows."""
    return functools.partial(np.zeros, (0, *row))


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
        water: Height of the surface of water; None: there is none.
        casters: How many of the first points throw shadows: the sun's map covers these, the rest
            may lie outside; None: all.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.integer] = field(default_factory=_none(3))
    triangle_color: NDArray[np.floating] = field(default_factory=_none(3))
    bars: NDArray[np.integer] = field(default_factory=_none(2))
    bar_radius: NDArray[np.floating] = field(default_factory=_none())
    bar_color: NDArray[np.floating] = field(default_factory=_none(3))
    balls: NDArray[np.integer] = field(default_factory=_none())
    ball_radius: NDArray[np.floating] = field(default_factory=_none())
    ball_color: NDArray[np.floating] = field(default_factory=_none(3))
    floor: float | None = 0.0
    tile: float = 0.1
    water: float | None = None
    casters: int | None = None


class Rasteriser:
    """Draws pictures of one size on one device; keeps its buffers from picture to picture."""

    def __init__(
        self,
        size: tuple[int, int] = (1280, 720),
        device: str | wp.Device = "cpu",
        threads: int | None = None,
        map_size: int = 1024,
    ):
        """Allocate the buffers.

        Args:
            size: Width and height in pixels, 1 ... 16384 each.
            device: A Warp device, "cpu" or "cuda:0".
            threads: How many threads draw on a CPU; default one for each core that the process
                may use. A CUDA device is driven by one thread.
            map_size: Texels along the edge of the map that shadows come from, 256 ... 1024.

        Raises:
            ValueError: For a size or a number of threads out of range.
        """
        self.size = _checked_size(size)
        self._map_size, self._asked_threads = map_size, threads
        self.device = device_named(device)
        self._launch = functools.partial(wp.launch, device=self.device)
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, got {threads}")
        width, height = self.size
        on_cpu = self.device.is_cpu
        self._parts = 1 if on_cpu else _CUDA_PARTS
        self._stride = 1 if on_cpu else width
        self._band_rows = min(_BAND_ROWS if on_cpu else _CUDA_BAND_ROWS, height)
        bands = -(-height // self._band_rows)
        self._threads = min(threads or _usable_cores(), bands) if on_cpu else 1
        self._samples = self._array(_SAMPLES, wp.vec2)
        self._middle = self._array(((0.5, 0.5),), wp.vec2)
        self._encode = wp.array(_screen_values(), dtype=wp.uint8, device=self.device)
        self._picture = wp.zeros((height, width, 3), dtype=wp.uint8, device=self.device)
        keys = width * self._band_rows * len(_SAMPLES)
        self._keys = [self._empty_keys(keys) for _ in range(self._threads)]
        self._map = self._empty_keys(map_size * map_size)
        table = (map_size + 1, map_size + 1)
        self._sums = wp.zeros(table, dtype=wp.vec2i, device=self.device)

    def of_size(self, size: tuple[int, int], map_size: int) -> Rasteriser:
        """Return one of another size that draws on the same device with as many threads."""
        return Rasteriser(size, self.device, self._asked_threads, map_size)

    def draw(self, drawing: Drawing, camera: Camera) -> NDArray[np.uint8]:
        """Return the picture, (H, W, 3) uint8 sRGB; the same input gives the same bits.

        The drawing needs a point at least. Shapes that reach behind the camera are left out.
        """
        surfaces = self._surfaces(drawing, camera)
        sun = self._sunlight(drawing, camera, surfaces)
        floor = _floor(drawing, camera)
        starts = range(0, self.size[1], self._band_rows)

        def draw_bands(thread: int) -> None:
            for start in starts[thread :: self._threads]:
                self._draw_band(start, camera, sun, floor, surfaces, self._keys[thread])

        if self._threads == 1:
            draw_bands(0)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(draw_bands, range(self._threads)))
        return self._picture.numpy().copy()

    def _draw_band(
        self,
        start: int,
        camera: Camera,
        sun: shading.Sun,
        floor: shading.Floor,
        surfaces: shading.Surfaces,
        keys: wp.array,
    ) -> None:
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
        self._draw_surfaces(lens, self._samples, surfaces.points, surfaces, keys)
        inputs = [lens, self._samples, sun, floor, surfaces, keys]
        self._launch(
            shading.shade,
            (lens.rows, self._stride),
            inputs=[*inputs, self._encode, self._stride],
            outputs=[self._picture],
        )

    def _draw_surfaces(
        self,
        lens: raster.Lens,
        samples: wp.array,
        points: wp.array,
        surfaces: shading.Surfaces,
        keys: wp.array,
    ) -> None:
        """Put the nearest surface of every sample into the keys; the points are the lens's own."""
        keys.fill_(raster.EMPTY)
        n_triangles, n_bars = len(surfaces.corners), len(surfaces.ends)
        view = [lens, samples, points]
        self._launch(
            raster.draw_triangles,
            (n_triangles, lens.parts),
            inputs=[*view, surfaces.corners, 0],
            outputs=[keys],
        )
        self._launch(
            raster.draw_spheres,
            (len(surfaces.centers), lens.parts),
            inputs=[*view, surfaces.centers, surfaces.center_radii, n_triangles + n_bars],
            outputs=[keys],
        )
        self._launch(
            raster.draw_cylinders,
            (n_bars, lens.parts),
            inputs=[*view, surfaces.ends, surfaces.end_radii, n_triangles],
            outputs=[keys],
        )

    def _surfaces(self, drawing: Drawing, camera: Camera) -> shading.Surfaces:
        """Return the shapes on the device, their points in view coordinates."""
        colors = (drawing.triangle_color, drawing.bar_color, drawing.ball_color)
        surfaces = shading.Surfaces()
        surfaces.points = self._array(camera.view(drawing.points), wp.vec3)
        surfaces.corners = self._array(drawing.triangles, wp.vec3i)
        surfaces.ends = self._array(drawing.bars, wp.vec2i)
        surfaces.end_radii = self._array(drawing.bar_radius, float)
        surfaces.centers = self._array(drawing.balls, int)
        surfaces.center_radii = self._array(drawing.ball_radius, float)
        surfaces.colors = self._array(np.concatenate(colors), wp.vec3)
        return surfaces

    def _sunlight(
        self, drawing: Drawing, camera: Camera, surfaces: shading.Surfaces
    ) -> shading.Sun:
        """Draw the sun's map and its table of sums, and return the light that reads them."""
        axes = view_axes(np.negative(TO_SUN))
        seen = drawing.points @ axes.T
        thickest = np.concatenate(([1e-3], drawing.bar_radius, drawing.ball_radius)).max()
        low, high = _corners(seen[: drawing.casters], thickest)
        # steps of scale and whole texels keep the shadow's edges still from frame to frame
        edge = 2.0 ** (math.ceil(4 * math.log2(1.02 * float((high - low)[:2].max()))) / 4)
        texel = edge / (self._map_size - 2 * _LONGEST_REACH - 4)
        nearest = seen[:, 2].min() - 2 * thickest
        origin = np.append(np.rint((low + high)[:2] / 2 / texel) * texel, nearest)

        lens = raster.Lens()
        lens.perspective = 0
        lens.focal = 1 / texel
        lens.center_x = lens.center_y = self._map_size / 2
        lens.near = 0.0
        lens.width = lens.rows = self._map_size
        lens.first_row = 0
        lens.parts = self._parts

        sun = shading.Sun()
        sun.direction = wp.vec3(*(camera.axes @ -axes[2]))
        sun.up = wp.vec3(*camera.axes[:, 2])
        sun.turn = wp.mat33((axes @ camera.axes.T).ravel())
        sun.shift = wp.vec3(*(axes @ camera.eye - origin))
        sun.scale = 1 / texel
        sun.center = self._map_size / 2
        sun.size = self._map_size
        sun.depths, sun.sums = self._map, self._sums
        # the height of a point X, Y, Z of the sun's view above the floor is rise . (X, Y, Z) + foot
        height = drawing.floor or 0.0
        rise, foot = axes[:, 2], axes[:, 2] @ origin - height
        slope = -rise[:2] / rise[2] * texel
        sun.floor = wp.vec3(-foot / rise[2] - slope.sum() * self._map_size / 2, *slope)
        longest_way = (drawing.points[:, 2].max() + thickest - height) / -rise[2]
        sun.spread = _SUN_SPREAD
        sun.reach = int(np.clip(_SUN_SPREAD * longest_way / texel, 2, _LONGEST_REACH))

        points = self._array(seen - origin, wp.vec3)
        self._draw_surfaces(lens, self._middle, points, surfaces, self._map)
        self._launch(shading.sum_rows, self._map_size, inputs=[sun], outputs=[self._sums])
        threads = -(-self._map_size // int(shading.COLUMNS_A_THREAD))
        self._launch(shading.sum_columns, threads, inputs=[], outputs=[self._sums])
        return sun

    def _array(self, values: ArrayLike, dtype: type) -> wp.array:
        """Return values as an array on the device, single precision or int32."""
        scalar = np.int32 if dtype in (int, wp.vec2i, wp.vec3i) else np.float32
        return wp.array(np.ascontiguousarray(values, scalar), dtype=dtype, device=self.device)

    def _empty_keys(self, n: int) -> wp.array:
        return wp.empty(n, dtype=wp.uint64, device=self.device)


def draw(
    drawing: Drawing, camera: Camera, size: tuple[int, int] = (1280, 720), device: str = "cpu"
) -> NDArray[np.uint8]:
    """Return one picture, (H, W, 3) uint8 sRGB; for many of one size keep a `Rasteriser`."""
    return Rasteriser(size, device).draw(drawing, camera)


def _corners(points: NDArray[np.float64], margin: float) -> tuple[NDArray, NDArray]:
    """Return the lowest and the highest corner of a box with a margin around points (P, 3)."""
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _floor(drawing: Drawing, camera: Camera) -> shading.Floor:
    """Return the floor as the camera sees it; fading scales with the camera's distance."""
    floor = shading.Floor()
    floor.visible = int(drawing.floor is not None)
    floor.height = camera.eye[2] - (drawing.floor or 0.0)
    floor.axis_x = wp.vec3(*(camera.axes[:, 0] / drawing.tile))
    floor.axis_y = wp.vec3(*(camera.axes[:, 1] / drawing.tile))
    floor.eye_x, floor.eye_y = (np.mod(np.array(camera.eye[:2]) / drawing.tile, 2.0)).tolist()
    floor.fade_from = 0.9 * camera.distance
    floor.fade_over = 1.2 * camera.distance
    floor.light = wp.vec3(*appearance.GROUND_LIGHT)
    floor.dark = wp.vec3(*appearance.GROUND_DARK)
    floor.sky = wp.vec3(*appearance.SKY)
    floor.zenith = wp.vec3(*appearance.ZENITH)
    floor.wet = int(drawing.water is not None and camera.eye[2] > drawing.water)
    floor.depth = camera.eye[2] - (drawing.water or 0.0)
    floor.clarity = _CLARITY * drawing.tile
    floor.water = wp.vec3(*appearance.WATER)
    return floor


def _screen_values(n: int = 4096) -> NDArray[np.uint8]:
    """Return the bytes of a screen for n linear values from 0 to 1."""
    return np.rint(255 * appearance.to_screen(np.linspace(0.0, 1.0, n))).astype(np.uint8)


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
