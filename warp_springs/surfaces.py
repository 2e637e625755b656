"""Planes, spheres, boxes and height fields: obstacles of a scene, and what masses are held to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.fields import require_positive, require_vector
from warp_springs.checks import check_number
from warp_springs.geometry import FloatArray, rotation_matrix

__all__ = [
    "Box",
    "Circle",
    "HeightField",
    "Line",
    "Plane",
    "Sphere",
    "Surface",
    "height_map",
    "hills",
    "rough_terrain",
]

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Surface:
    """How an obstacle answers a mass that enters it.

    Attributes:
        stiffness: K [N/m]; a mass at a depth d is pushed out along the normal by K d.
        static_friction: Coefficient mu_s below which a mass sticks (Coulomb's law).
        kinetic_friction: Coefficient mu_k with which a mass slides.

    Where a mass is only held to a shape (`Robot.held_to`) the geometry alone counts.
    """

    stiffness: float = 1e5
    static_friction: float = 1.0
    kinetic_friction: float = 0.8

    def __post_init__(self) -> None:
        kind = type(self).__name__
        check_number(f"{kind}.stiffness", self.stiffness, above=0.0)
        check_number(f"{kind}.static_friction", self.static_friction, at_least=0.0)
        check_number(f"{kind}.kinetic_friction", self.kinetic_friction, at_least=0.0)


def _direction(name: str, value: ArrayLike) -> Triple:
    """A vector of length one, refused with a ValueError where it has no direction."""
    vector = require_vector(name, value)
    length = float(np.sqrt(vector @ vector))
    if length == 0.0:
        raise ValueError(f"{name} = {tuple(vector.tolist())}: must not be zero")
    return _triple(vector / length)


def _triple(vector: FloatArray) -> Triple:
    return tuple(float(value) for value in vector)


@dataclass(frozen=True)
class Plane(Surface):
    """The plane normal . p = offset; as an obstacle, everything behind it is solid.

    Attributes:
        normal: Outward normal, shape (3,), of any length but zero; kept as a unit vector. The
            offset is divided with it, so that (a, b, c) and d of a x + b y + c z = d may be given.
        offset: Signed distance from the origin times the length of the normal given [m].
    """

    normal: Triple = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        normal = require_vector("Plane.normal", self.normal)
        unit = _direction("Plane.normal", normal)
        check_number("Plane.offset", self.offset, at_least=-np.finfo(float).max)
        object.__setattr__(self, "offset", float(self.offset / np.sqrt(normal @ normal)))
        object.__setattr__(self, "normal", unit)


@dataclass(frozen=True)
class Sphere(Surface):
    """A solid ball, or the sphere that masses are held to.

    Attributes:
        center: Centre [m], shape (3,).
        radius: Radius [m], positive.
    """

    center: Triple
    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "center", _triple(require_vector("Sphere.center", self.center)))
        object.__setattr__(self, "radius", require_positive("Sphere.radius", self.radius))


@dataclass(frozen=True)
class Box(Surface):
    """A solid box, turned about its centre if asked.

    Attributes:
        center: Centre [m], shape (3,).
        size: Lengths of the edges [m], shape (3,), positive.
        axis: Axis of the turn, shape (3,).
        angle: Angle of the turn [rad], counter-clockwise about the axis.
    """

    center: Triple
    size: Triple
    axis: Triple = (0.0, 0.0, 1.0)
    angle: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        size = require_vector("Box.size", self.size)
        if not (size > 0.0).all():
            raise ValueError(f"Box.size = {tuple(size.tolist())}: must be greater than 0")
        object.__setattr__(self, "center", _triple(require_vector("Box.center", self.center)))
        object.__setattr__(self, "size", _triple(size))
        object.__setattr__(self, "axis", _direction("Box.axis", self.axis))
        rotation_matrix(np.asarray(self.axis), self.angle)  # refuses a bad angle

    @property
    def rotation(self) -> FloatArray:
        """Columns are the directions of the edges, shape (3, 3)."""
        return rotation_matrix(np.asarray(self.axis), self.angle)


@dataclass(frozen=True, eq=False)
class HeightField(Surface):
    """Terrain: heights over a grid, bilinear between its points, flat beyond its rim.

    Attributes:
        heights: Height [m] of each grid point, shape (X, Y), at least 2 by 2; x runs along
            axis 0. `ws.height_map` reads one from a picture.
        spacing: Distance of neighbouring grid points [m].
        origin: Where grid point (0, 0) is, and what is added to all heights [m], shape (3,).
    """

    heights: ArrayLike
    spacing: float
    origin: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        heights = np.array(self.heights, np.float64)
        if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
            raise ValueError(
                f"HeightField.heights: shape {heights.shape} given, a table of finite numbers of "
                "at least 2 by 2 expected"
            )
        heights.flags.writeable = False
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "spacing", require_positive("HeightField.spacing", self.spacing))
        object.__setattr__(self, "origin", _triple(require_vector("origin", self.origin)))


def height_map(path: str | Path, lowest: float, highest: float) -> FloatArray:
    """Heights [m] from the brightness of a picture: black is the lowest, white the highest.

    Row 0 of the picture, its upper edge, lies at the largest y.

    Returns:
        Heights, shape (width, height) of the picture in pixels, for `ws.HeightField`.

    Raises:
        ValueError: The file is no picture.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            grey = np.asarray(picture.convert("F"), np.float64)
            white = 65535.0 if picture.mode.startswith("I") else 255.0
    except (UnidentifiedImageError, OSError) as error:
        raise ValueError(f"height_map: {path} cannot be read as a picture: {error}") from None
    return lowest + (highest - lowest) * grey[::-1].T / white


def rough_terrain(
    seed: int,
    height: float = 0.05,
    feature: float = 0.3,
    size: float = 8.0,
    spacing: float = 0.1,
    **surface: float,
) -> HeightField:
    """Hills that a seed decides: a square about the origin whose highest point is at z = 0.

    Sixteen waves of random directions and phases, with wavelengths from ``feature`` up to four
    times that, are added up.

    Args:
        seed: Of the hills; the same seed gives the same hills.
        height: From the lowest point to the highest [m].
        feature: Shortest wavelength [m].
        size: Edge of the square [m]; beyond it the ground is flat.
        spacing: Distance of grid points [m].
        surface: Stiffness and friction, as of `HeightField`.

    Raises:
        ValueError: A number is out of range.
    """
    require_positive("feature", feature)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    waves = rng.random((16, 4))
    waves[:, 0] = feature * 4.0 ** waves[:, 0]
    waves[:, 1:3] *= 2.0 * np.pi
    waves[:, 3] = 1.0
    return hills(waves, height, size, spacing, **surface)


def hills(
    waves: ArrayLike, height: float, size: float = 8.0, spacing: float = 0.1, **surface: float
) -> HeightField:
    """Hills that are a sum of waves: a square about the origin whose highest point is at z = 0.

    Args:
        waves: Wavelength [m], direction [rad], phase [rad] and weight of each, shape (n, 4); long
            waves are high: the height of each is its weight times its wavelength, up to a factor.
        height: From the lowest point to the highest [m].
        size: Edge of the square [m]; beyond it the ground is flat.
        spacing: Distance of grid points [m].
        surface: Stiffness and friction, as of `HeightField`.

    Raises:
        ValueError: A number is out of range, or a wave is shorter than two grid points.
    """
    for name, value in {"height": height, "size": size, "spacing": spacing}.items():
        require_positive(name, value)
    table = np.asarray(waves, np.float64)
    if table.ndim != 2 or table.shape[1] != 4 or not len(table) or not np.isfinite(table).all():
        raise ValueError(f"waves: shape {table.shape} given, finite numbers (n, 4) expected")
    if table[:, 0].min() < 2.0 * spacing:
        raise ValueError(
            f"waves: a wavelength of {table[:, 0].min():g} m is shorter than two grid points, "
            f"{2.0 * spacing:g} m"
        )
    along = np.arange(-size / 2.0, size / 2.0 + spacing / 2.0, spacing)
    x, y = np.meshgrid(along, along, indexing="ij")
    heights = np.zeros_like(x)
    for wavelength, turn, phase, weight in table.tolist():
        angle = 2.0 * np.pi / wavelength * (x * np.cos(turn) + y * np.sin(turn)) + phase
        heights += weight * wavelength * np.sin(angle)
    steep = float(np.ptp(heights))
    heights = (heights - heights.max()) * (height / steep if steep > 0.0 else 0.0)
    return HeightField(heights, spacing, (along[0], along[0], 0.0), **surface)


@dataclass(frozen=True)
class Line:
    """The line through a point along a direction, for masses to be held to.

    Attributes:
        point: A point on the line [m], shape (3,).
        direction: Its direction, shape (3,), of any length but zero.
    """

    point: Triple
    direction: Triple

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _triple(require_vector("Line.point", self.point)))
        object.__setattr__(self, "direction", _direction("Line.direction", self.direction))


@dataclass(frozen=True)
class Circle:
    """A circle in space, for masses to be held to.

    Attributes:
        center: Centre [m], shape (3,).
        normal: Normal of its plane, shape (3,), of any length but zero.
        radius: Radius [m], positive.
    """

    center: Triple
    normal: Triple
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _triple(require_vector("Circle.center", self.center)))
        object.__setattr__(self, "normal", _direction("Circle.normal", self.normal))
        object.__setattr__(self, "radius", require_positive("Circle.radius", self.radius))
