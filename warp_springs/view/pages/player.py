"""The page: recorded robots in motion as one self-contained HTML file that opens anywhere."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_springs.checks import check_choice
from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.view.pages.shell import filled

if TYPE_CHECKING:
    from warp_springs.result import Result

__all__ = ["export_html", "html_page"]

COLORS = ("stress", "material", "actuation")
"""What the colour of a bar may say."""
SCRIPTS = ("data", "camera", "meshes", "shaders", "draw", "plot", "main")
"""The parts of the page's script, in the order in which they build on each other."""

SUFFIXES = (".html", ".htm")
"""What the name of a page may end in."""


def export_html(result: Result, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write recorded robots as a page that plays them, and return its path.

    One file that needs no network, no server and no plug-in: it opens from the disk, from a mail
    or inside a sandboxed frame, on a phone as well. It plays, scrubs and slows down; the view
    turns, moves, zooms and follows a robot; bars are coloured by stress, by material (by stiffness
    where a robot has no materials) or by actuation; the energies of the chosen robot, or its speed
    where none were recorded, are plotted beside it. Everything works by mouse, keys and touch.

    The file appears whole or not at all. Positions are kept to within 1/128 of a bar's radius, or
    to within 1/65,000 of a robot's way where that is more.

    Args:
        result: What `Simulation.run` returned, recorded with ``fps=``.
        path: File to write, ``.html``.
        **options: As in `html_page`.

    Raises:
        ValueError: As in `html_page`, or the suffix is not ``.html``.
        OSError: The file cannot be written.
    """
    path = checked_output(path, SUFFIXES)
    text = html_page(result, **options)
    with written_beside(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


def html_page(
    result: Result,
    *,
    robots: Iterable[int] | None = None,
    names: Mapping[int, str] | None = None,
    custom_data: Mapping[int, Mapping[str, Any]] | None = None,
    title: str = "Soft robots",
    color: str = "stress",
    skin: bool = True,
    grid: bool = True,
    spacing: float | None = None,
) -> str:
    """Return the page that `export_html` writes, for example to put it into a frame of another.

    Args:
        result: What `Simulation.run` returned, recorded with ``fps=``.
        robots: Indices of recorded robots; all of them by default.
        names: Name of a robot by its index; "robot 7" by default.
        custom_data: For a robot by its index, what the page says about it: label -> value.
        title: What the page is called.
        color: What the colour of a bar says at first: "stress", "material" or "actuation".
        skin: Whether faces are shown at first.
        grid: Whether several robots are put on a square grid, each starting in the middle of its
            cell; otherwise all stay where they were simulated.
        spacing: Distance of the cells [m]; by default large enough that no two robots touch.

    Raises:
        ValueError: The result has no frames, a robot was not recorded or has no finite frame,
            names or custom data belong to a robot that is not shown, the colour is unknown, or
            the spacing is not a positive length.
    """
    from warp_springs.view.pages.scene import described

    check_choice("color", color, COLORS)
    header, data = described(result, robots, names or {}, custom_data or {}, grid, spacing)
    header["look"] = {"color": color, "skin": bool(skin)}
    return filled(
        "page",
        title=title,
        policy="img-src data:",
        scripts=[f"page_{name}.js" for name in SCRIPTS],
        header=_as_script(header),
        data=data,
    )


def _as_script(value: Mapping[str, Any] | Sequence[Any]) -> str:
    """JSON that no part of ends the script element that it stands in."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
