"""A pinhole camera: where it stands, and where a point of the world lands in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks from one point at another; the picture's up is world z.

    Attributes:
        eye: Where it stands, (x, y, z) in m.
        target: What lies in the middle of the picture, (x, y, z) in m.
        field_of_view: Angle from the picture's lower to its upper edge, degrees.

    Raises:
        ValueError: If eye and target coincide or are not finite, or the angle is not in 1 ... 150.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    field_of_view: float = 32.0

    def __post_init__(self) -> None:
        for name in ("eye", "target"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(
                    f"Camera: {name} must be three finite coordinates in m, got {value}"
                )
            object.__setattr__(self, name, tuple(value.tolist()))
        if self.eye == self.target:
            raise ValueError(f"Camera: eye and target are the same point {self.eye}")
        if not 1.0 <= self.field_of_view <= 150.0:
            raise ValueError(
                f"Camera: field_of_view must be 1 ... 150 degrees, got {self.field_of_view!r}"
            )

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors to the right, down and forward as rows, (3, 3)."""
        forward = np.subtract(self.target, self.eye)
        return view_axes(forward)

    @property
    def distance(self) -> float:
        """Distance from the eye to the target, m."""
        return float(np.linalg.norm(np.subtract(self.target, self.eye)))

    def focal(self, height: int) -> float:
        """Focal length in pixels of a picture `height` pixels high."""
        return 0.5 * height / float(np.tan(np.radians(self.field_of_view) / 2))

    def view(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return view coordinates (P, 3) in m (right, down, away) of world points (P, 3)."""
        return (np.asarray(points, dtype=np.float64) - self.eye) @ self.axes.T

    def project(self, points: ArrayLike, size: tuple[int, int]) -> NDArray[np.float64]:
        """Return column, row (pixels; whole numbers are pixel corners) and depth (m), (P, 3).

        Args:
            points: World points (P, 3) in m.
            size: Width and height of the picture in pixels.
        """
        seen = self.view(points)
        width, height = size
        scale = self.focal(height) / seen[:, 2]
        middle = np.array([width / 2, height / 2])
        return np.column_stack((middle + seen[:, :2] * scale[:, None], seen[:, 2]))

    @classmethod
    def framing(
        cls,
        points: ArrayLike,
        size: tuple[int, int],
        *,
        radius: ArrayLike = 0.0,
        azimuth: float = -58.0,
        elevation: float = 27.0,
        field_of_view: float = 32.0,
        margin: float = 1.25,
    ) -> Camera:
        """Return the camera that stands as near as it can with all spheres in the picture.

        Args:
            points: Centres of the spheres, world points (P, 3) in m.
            size: Width and height of the picture in pixels.
            radius: Their radii, (P,) or one number, m; below 1 mm counts as 1 mm.
            azimuth: Where it stands around the vertical, degrees from +x towards +y.
            elevation: How high it stands above the horizon, degrees.
            field_of_view: As in `Camera`.
            margin: Size of the picture in units of the part that the spheres may fill.
        """
        points = np.asarray(points, dtype=np.float64)
        around, above = np.radians(azimuth), np.radians(elevation)
        forward = -np.array(
            [np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)]
        )
        axes = view_axes(forward)
        seen = points @ axes.T
        half = np.tan(np.radians(field_of_view) / 2) / margin
        slopes = np.array([half * size[0] / size[1], half])
        # a sphere fits if |x - x_eye| + r sqrt(1 + slope^2) <= slope (z - z_eye), likewise for y
        radius = np.maximum(np.broadcast_to(radius, len(points)), 1e-3)[:, None]
        reach = radius * np.sqrt(1 + slopes**2) - slopes * seen[:, 2:]
        right = (seen[:, :2] + reach).max(axis=0)
        left = (-seen[:, :2] + reach).max(axis=0)
        eye_z = -float(((right + left) / (2 * slopes)).max())
        eye = np.append((right - left) / 2, eye_z)
        middle = float(seen[:, 2].mean())
        target = np.array([eye[0], eye[1], max(middle, eye_z + 1e-3)])
        return cls(tuple(eye @ axes), tuple(target @ axes), field_of_view)


def view_axes(forward: ArrayLike) -> NDArray[np.float64]:
    """Return unit vectors to the right, down and forward as rows, (3, 3), for a view direction.

    Down is as near to -z as it can be; a vertical view has +y of the world at its top.
    """
    forward = np.asarray(forward, dtype=np.float64)
    forward = forward / np.linalg.norm(forward)
    up = np.array([0.0, 1.0, 0.0]) if abs(forward[2]) > 1 - 1e-9 else np.array([0.0, 0.0, 1.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(forward, right), forward))
