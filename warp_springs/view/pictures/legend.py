"""What the colours of bars mean, as swatches with words in the corner of a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.view import appearance
from warp_springs.view.look import Look
from warp_springs.view.palette import material_palette
from warp_springs.view.pictures import labels as texts
from warp_springs.view.pictures.actors import Actor

Row = tuple[ArrayLike, str]
"""A colour in linear RGB and what it means."""


def rows_of(actors: Sequence[Actor], look: Look) -> list[Row]:
    """Return the rows of the legend, none where colours say nothing."""
    if look.color == "material":
        table, _ = material_palette([a.body for a in actors])
        return [(color, name) for name, color in table]
    alone = actors[0].scale if len(actors) == 1 else None
    if look.color == "stress":
        much = "" if alone is None else f": {alone:.3g} N or more"
        words = (f"stretched{much}", "relaxed", f"compressed{much}")
        return _three(appearance.TENSION, appearance.COMPRESSION, words)
    if look.color == "actuation" and any(a.scale is not None for a in actors):
        much = "" if alone is None else f" by {100 * alone:.3g} %"
        words = (f"told to be longer{much}", "as on average", f"told to be shorter{much}")
        return _three(appearance.LONGER, appearance.SHORTER, words)
    return []


def draw_legend(
    pixels: NDArray[np.uint8], rows: Sequence[Row], letters: int, *, in_line: bool
) -> None:
    """Draw rows into the lower right corner of a picture, (H, W, 3) uint8, in place.

    Args:
        pixels: The picture.
        rows: Colours and words, from the top.
        letters: Height of the letters in pixels.
        in_line: Beside each other instead of below each other.
    """
    images = [texts.text_image(words, letters) for _, words in rows]
    widths = np.array([image.shape[1] for image in images], int)
    height, width = pixels.shape[:2]
    step = strip_height(letters)
    if in_line:  # from the right edge to the left
        lefts = width - letters - np.cumsum((widths + 3 * letters)[::-1])[::-1] + 3 * letters
        tops = np.full(len(rows), height - step + (step - letters) // 2)
    else:
        lefts = np.full(len(rows), width - letters - widths.max(initial=0))
        tops = height - letters // 2 - step * np.arange(len(rows), 0, -1)
    for (color, _), image, left, top in zip(rows, images, lefts, tops, strict=True):
        swatch = pixels[max(top, 0) : top + letters, max(left - 2 * letters, 0) : max(left - 6, 0)]
        swatch[:] = np.rint(255 * appearance.to_screen(color))
        texts.lay_over(pixels, image, int(left), int(top) + (letters - image.shape[0]) // 2)


def strip_height(letters: int) -> int:
    """Height in pixels of a line of the legend for letters of a height."""
    return round(1.6 * letters)


def _three(above: ArrayLike, below: ArrayLike, words: tuple[str, str, str]) -> list[Row]:
    return list(zip((above, appearance.NEUTRAL, below), words, strict=True))
