"""Texts in pictures: drawn once as small images with a halo, then laid over every frame."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

INK = (28, 32, 38)
HALO = (232, 237, 242)

Box = tuple[float, float, float, float]
"""Left, upper, right and lower edge in pixels."""


@functools.cache
def _font(size: int):
    import matplotlib
    from PIL import ImageFont

    file = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")
    return ImageFont.truetype(str(file), size)


@functools.lru_cache(maxsize=512)
def text_image(text: str, size: int) -> NDArray[np.float32]:
    """Return a text as an image, (h, w, 4): premultiplied sRGB 0 ... 255, then opacity 0 ... 1.

    Args:
        text: May have several lines.
        size: Height of the letters in pixels.
    """
    from PIL import Image, ImageDraw

    halo = max(1, size // 9)
    style = {"font": _font(size), "stroke_width": halo, "align": "center"}
    left, top, right, bottom = ImageDraw.Draw(Image.new("L", (1, 1))).textbbox(
        (0, 0), text, **style
    )
    image = Image.new("RGBA", (int(right - left) + 2, int(bottom - top) + 2), (*HALO, 0))
    place = (1 - left, 1 - top)
    ImageDraw.Draw(image).text(place, text, fill=INK, stroke_fill=HALO, **style)
    pixels = np.asarray(image, dtype=np.float32).copy()
    pixels[..., 3] /= 255.0
    pixels[..., :3] *= pixels[..., 3:]
    return pixels


def lay_over(pixels: NDArray[np.uint8], image: NDArray[np.float32], left: int, top: int) -> None:
    """Lay an image of `text_image` over a picture, (H, W, 3) uint8, in place."""
    height, width = pixels.shape[:2]
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + image.shape[1], width), min(top + image.shape[0], height)
    if x0 >= x1 or y0 >= y1:
        return
    part = image[y0 - top : y1 - top, x0 - left : x1 - left]
    below = pixels[y0:y1, x0:x1]
    below[:] = np.rint(part[..., :3] + (1.0 - part[..., 3:]) * below).astype(np.uint8)


def overlap(a: Box, b: Box) -> float:
    """Return the area that two boxes share [pixels]."""
    wide = min(a[2], b[2]) - max(a[0], b[0])
    high = min(a[3], b[3]) - max(a[1], b[1])
    return max(wide, 0.0) * max(high, 0.0)


def box_below(image: NDArray[np.float32], middle: float, top: float) -> Box:
    """Return the box of a text that hangs from a point."""
    height, width = image.shape[:2]
    return middle - width / 2, top, middle + width / 2, top + height


def checked_labels(labels: Sequence[str] | None, count: int) -> list[str] | None:
    """Labels as texts, one for each robot, or a refusal."""
    if labels is None:
        return None
    if isinstance(labels, str) or len(labels) != count:
        raise ValueError(f"labels: got {labels!r}, expected a text for each robot shown ({count})")
    return [str(label) for label in labels]
