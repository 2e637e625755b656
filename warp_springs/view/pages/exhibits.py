"""Films, pages and pictures of a result that are small enough to be put inside a document."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_springs.result import Result

__all__ = ["FILMS", "film", "player", "still"]

FILMS = (
    ("mp4", (640, 360), 25.0),
    ("mp4", (480, 270), 20.0),
    ("webp", (480, 270), 12.5),
    ("webp", (320, 180), 10.0),
)
"""How a film is tried until it is small enough: kind, size in pixels, pictures per second."""


def film(
    result: Result,
    robots: int | Sequence[int] | None,
    most: int,
    start: float | None = None,
    duration: float | None = None,
) -> tuple[bytes, str]:
    """A film and its kind: H.264 where there is an encoder, an animated picture elsewhere.

    Args:
        result: With recorded frames.
        robots: Who is in it; all that were recorded by default.
        most: Bytes that it should not exceed; the smallest that can be made is taken if it does.
        start: Where in the run it starts [s].
        duration: How much of the run it shows [s].
    """
    from warp_springs.view.pictures.picture import render

    data, found = b"", ""
    with tempfile.TemporaryDirectory() as folder:
        for kind, size, fps in FILMS:
            path = Path(folder, f"film.{kind}")
            with suppress(RuntimeError):  # no encoder for mp4
                render(result, path, robots=robots, size=size, fps=fps, start=start,
                       duration=duration, clock=False)  # fmt: skip
                data, found = path.read_bytes(), kind
                if len(data) <= most:
                    break
    return data, found


def player(
    result: Result,
    robots: Sequence[int],
    most: int,
    names: Mapping[int, str],
    custom_data: Mapping[int, Mapping[str, Any]],
    title: str,
) -> tuple[str, int]:
    """A page with as many of the robots as keep it below `most` letters, and how many these are.

    The first robot is always on it.
    """
    from warp_springs.view.pages.player import html_page

    count = len(robots)
    while True:
        shown = list(robots[:count])
        page = html_page(
            result,
            robots=shown,
            names={i: names[i] for i in shown if i in names},
            custom_data={i: custom_data[i] for i in shown if i in custom_data},
            title=title,
        )
        if len(page) <= most or count == 1:
            return page, count
        count = max(1, min(count - 1, int(count * most / len(page))))


def still(result: Result, robots: Sequence[int], labels: Sequence[str] | None) -> bytes:
    """A picture of the last frame as WebP, a tenth of a PNG; several robots in a tile each."""
    from PIL import Image

    from warp_springs.view.pictures.picture import picture

    layout = "panel" if len(robots) > 1 else None
    pixels = picture(result, robots=list(robots), labels=labels, layout=layout, size=(1280, 800))
    with io.BytesIO() as target:
        Image.fromarray(pixels).save(target, format="WEBP", quality=88)
        return target.getvalue()
