"""What every view of a robot shares: its colours, how thick it is drawn, where it stands in a zoo.

Colours are linear RGB in 0 ... 1, as OpenUSD and a renderer's arithmetic want them; an sRGB screen
value is the business of whoever writes pixels. The module uses NumPy only, so that exporters of
any kind can stand on it.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

NEUTRAL = (0.80, 0.80, 0.78)
"""Colour of a bar without stress."""
TENSION = (0.76, 0.012, 0.012)
"""Colour of a bar stretched to the stress scale or beyond."""
COMPRESSION = (0.012, 0.06, 0.76)
"""Colour of a bar compressed to the stress scale or beyond."""
LONGER = (0.83, 0.30, 0.02)
"""Colour of a bar told to be as long as any is, or longer."""
SHORTER = (0.01, 0.30, 0.26)
"""Colour of a bar told to be as short as any is, or shorter."""
PUSH = (0.86, 0.36, 0.01)
"""Colour of the arrows that stand for external forces."""
OBSTACLE = (0.52, 0.44, 0.36)
"""Colour of obstacles."""
OBSTACLE_DARK = (0.36, 0.30, 0.24)
"""Colour of every other tile of an obstacle that is tiled."""
MASS = (0.012, 0.013, 0.016)
"""Colour of the spheres that stand for masses."""
SKIN = (0.26, 0.47, 0.66)
"""Colour of the exterior triangles."""
WATER = (0.07, 0.30, 0.44)
"""Colour of deep water."""
HELD = (0.45, 0.46, 0.48)
"""Colour of the spheres of masses that are fixed or held to something."""
GROUND_LIGHT = (0.70, 0.72, 0.75)
"""Colour of one half of the checker's tiles."""
GROUND_DARK = (0.42, 0.46, 0.54)
"""Colour of the other half of the checker's tiles."""
SKY = (0.91, 0.94, 0.97)
"""Colour that the ground fades into."""
ZENITH = (0.66, 0.78, 0.93)
"""Colour of the sky high above the horizon."""

STRESS_STEPS = 32
"""Shades between neutral and full tension, and between neutral and full compression."""
LEAST_STRESS_SCALE = 1e-6
"""Force in N below which no spring is coloured: rounding errors are not stress."""

_TILE_PER_SIZE = 0.45
_BAR_PER_LENGTH = 0.042
_BALL_PER_BAR = 1.9
_LENGTH_WITHOUT_SPRINGS = 0.1


def to_screen(linear: ArrayLike) -> NDArray[np.float64]:
    """Return the sRGB values, 0 ... 1, of linear ones of any shape (IEC 61966-2-1)."""
    linear = np.asarray(linear, dtype=np.float64)
    curved = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curved)


def stress_palette() -> NDArray[np.float32]:
    """Return the table that `stress_index` points into, (1 + 2 * STRESS_STEPS, 3) linear RGB.

    Entry 0 is neutral, 1 ... STRESS_STEPS go to full tension, the rest to full compression. A
    viewer that shows only one entry of an indexed colour takes entry 0, hence the order.
    """
    return _diverging_palette(TENSION, COMPRESSION)


def _diverging_palette(above: ArrayLike, below: ArrayLike) -> NDArray[np.float32]:
    """Return a table like `stress_palette` that goes to two other colours."""
    share = np.arange(1, STRESS_STEPS + 1)[:, None] / STRESS_STEPS
    neutral = np.array(NEUTRAL)
    sides = [neutral + share * (np.asarray(color) - neutral) for color in (above, below)]
    return np.concatenate((neutral[None], *sides)).astype(np.float32)


def stress_scale(tension: ArrayLike, percentile: float = 95.0) -> float:
    """Return the force in N that is shown in full colour.

    Args:
        tension: Spring forces in N of any shape, for example (F, S): all that will be shown
            with one scale. Values that are not finite are left out.
        percentile: Share, in percent, of the absolute values that lie below the scale; a few
            overloaded springs then do not bleach all others.
    """
    magnitude = np.abs(np.asarray(tension, dtype=np.float64))
    magnitude = magnitude[np.isfinite(magnitude)]
    if magnitude.size == 0:
        return LEAST_STRESS_SCALE
    return max(float(np.percentile(magnitude, percentile)), LEAST_STRESS_SCALE)


def stress_index(tension: ArrayLike, scale: float) -> NDArray[np.int32]:
    """Return the entries of `stress_palette` for spring forces in N; same shape as `tension`.

    Forces beyond `scale` (N) take the last shade; forces that are not finite are neutral.
    """
    if not scale > 0.0:
        raise ValueError(f"stress_index: scale must be a positive force in N, got {scale!r}")
    share = np.nan_to_num(np.asarray(tension, np.float64) / scale, nan=0.0, posinf=0.0, neginf=0.0)
    shade = np.rint(np.clip(share, -1.0, 1.0) * STRESS_STEPS).astype(np.int32)
    return np.where(shade < 0, STRESS_STEPS - shade, shade).astype(np.int32)


def stress_color(tension: ArrayLike, scale: float) -> NDArray[np.float32]:
    """Return linear RGB, (..., 3), for spring forces in N of shape (...)."""
    return stress_palette()[stress_index(tension, scale)]


def actuation_color(strain: ArrayLike, scale: float) -> NDArray[np.float32]:
    """Return linear RGB, (..., 3), for what muscles do now.

    Args:
        strain: Change of the rest length as a share of its mean, (...); 0 is what does not move.
        scale: Strain in full colour, positive.
    """
    return _diverging_palette(LONGER, SHORTER)[stress_index(strain, scale)]


def drawn_radii(rest_length: ArrayLike) -> tuple[float, float]:
    """Return the radii in m of the bars and of the spheres of a robot.

    Both follow the median of its rest lengths (S,) in m, so a robot of any size looks alike.
    """
    lengths = np.asarray(rest_length, dtype=np.float64)
    typical = float(np.median(lengths)) if lengths.size else _LENGTH_WITHOUT_SPRINGS
    if not typical > 0.0:
        typical = _LENGTH_WITHOUT_SPRINGS
    bar = _BAR_PER_LENGTH * typical
    return bar, _BALL_PER_BAR * bar


def tile_size(sizes: ArrayLike) -> float:
    """Return the edge in m of the floor's tiles under robots of some sizes (R,), their diagonals.

    It is the largest of 1, 2, 5 times a power of ten that is not above 0.45 of the median size.
    """
    length = _TILE_PER_SIZE * float(np.median(sizes))
    if not length > 0.0:
        return 0.1
    power = 10.0 ** np.floor(np.log10(length * (1 + 1e-9)))
    return float(power * max(n for n in (1, 2, 5) if n * power <= length * (1 + 1e-9)))


def grid_offsets(
    extents: ArrayLike, columns: int | None = None, spacing: float = 1.5
) -> NDArray[np.float64]:
    """Return how far to move each robot so that all stand on a square grid around the origin.

    The middle of each robot's footprint goes to the middle of its cell, in the order of reading:
    along +x, the first row farthest along +y. Heights stay as they are.

    Args:
        extents: (R, 2, 3) m, the lowest and highest corner of each robot, over one frame or
            over all that will be shown.
        columns: Robots in a row; default the square root of R, rounded up.
        spacing: Distance of cells in units of the largest footprint.

    Returns:
        (R, 3) m offsets; their z is 0.

    Raises:
        ValueError: For a wrong shape, values that are not finite, or fewer than one column.
    """
    extents = np.asarray(extents, dtype=np.float64)
    if extents.ndim != 3 or extents.shape[1:] != (2, 3):
        raise ValueError(f"grid_offsets: extents must have shape (R, 2, 3), got {extents.shape}")
    if not np.isfinite(extents).all():
        bad = int(np.argwhere(~np.isfinite(extents))[0, 0])
        raise ValueError(f"grid_offsets: the extents of robot {bad} are not finite")
    n = len(extents)
    if columns is None:
        columns = max(1, int(np.ceil(np.sqrt(n))))
    if columns < 1:
        raise ValueError(f"grid_offsets: columns must be at least 1, got {columns}")
    offsets = np.zeros((n, 3))
    if n == 0:
        return offsets
    pitch = spacing * float((extents[:, 1, :2] - extents[:, 0, :2]).max())
    row, column = np.divmod(np.arange(n), columns)
    rows, columns = int(row[-1]) + 1, min(columns, n)
    offsets[:, 0] = (column - (columns - 1) / 2) * pitch
    offsets[:, 1] = ((rows - 1) / 2 - row) * pitch
    offsets[:, :2] -= extents[:, :, :2].mean(axis=1)
    return offsets
