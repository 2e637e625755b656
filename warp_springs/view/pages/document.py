"""A report as one HTML file: text, tables, plots, pictures, videos and pages, all inside it."""

from __future__ import annotations

import base64
import html
import io
import operator
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_springs.io.outputs import checked_output, written_beside
from warp_springs.view.pages import exhibits
from warp_springs.view.pages.player import SUFFIXES
from warp_springs.view.pages.shell import filled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warp_springs.result import Result

__all__ = ["Document"]

Cell = str | int | float

MOST_FILM = 900_000
"""Bytes that a film in a document takes at most."""
MOST_PAGE = 1_600_000
"""Letters that a page of robots in a document takes at most, unless it shows one robot."""

SHORT_TABLE = 12
"""Rows of a table that are not torn apart by the end of a sheet of paper."""

_NUMBER = re.compile(r"[-\u2212+]?[\d,]*\.?\d+(e[-+]?\d+)? ?%?")
_NAMED_GROUP = re.compile(r' id="[A-Za-z][\w.]*_\d+"')
"""Names that matplotlib gives to the parts of every figure, the same in each; nothing uses them."""


class _Part:
    """A figure of a document, by itself or in a row."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        return self._text


class Document:
    """A report that is written from top to bottom and is one file at the end.

    It needs no network and no other file, opens from the disk, and prints well: pages that play
    are left out of print. The same content gives the same bytes.

        report = ws.Document("A bouncing cube")
        report.section("Energies")
        report.row(report.plot(figure, "They add up to a constant."))
        report.write("report.html")

    Args:
        title: What it is called.
        subtitle: A line below the title.
    """

    def __init__(self, title: str, subtitle: str = "") -> None:
        self.title = title
        self.subtitle = subtitle
        self._sections: list[str] = []
        self._body: list[str | _Part] = []
        self._plots = 0

    # -- blocks, one below the other ---------------------------------------------------------------

    def section(self, title: str) -> None:
        """Begin a section; it is listed at the top."""
        self._sections.append(title)
        self._body.append(f'<h2 id="s{len(self._sections)}">{html.escape(title)}</h2>')

    def heading(self, title: str) -> None:
        """A heading within a section."""
        self._body.append(f"<h3>{html.escape(title)}</h3>")

    def text(self, *paragraphs: str) -> None:
        """Paragraphs of plain text."""
        self._body += [f"<p>{html.escape(words)}</p>" for words in paragraphs]

    def verdict(self, words: str, good: bool = True) -> None:
        """The one line that a reader must see."""
        kind = "verdict" if good else "verdict bad"
        self._body.append(f'<p class="{kind}">{html.escape(words)}</p>')

    def tiles(self, facts: Iterable[tuple[str, str]]) -> None:
        """Key figures side by side: (what it is, the figure)."""
        tiles = (
            f"<div><b>{html.escape(figure)}</b><span>{html.escape(name)}</span></div>"
            for name, figure in facts
        )
        self._body.append(f'<div class="tiles">{"".join(tiles)}</div>')

    def table(
        self,
        rows: Iterable[Sequence[Cell]],
        header: Sequence[str] = (),
        caption: str = "",
    ) -> None:
        """A table; numbers stand to the right, texts to the left.

        Args:
            rows: Cells, row by row. A column of numbers may hold them as texts ("0.48", "97%"),
                and words where there is none.
            header: Names of the columns.
            caption: What it shows.
        """
        top = f"<caption>{html.escape(caption)}</caption>" if caption else ""
        rows = [list(row) for row in rows]
        numeric = [_is_numeric(column) for column in zip(*rows, strict=True)] if header else []
        if header:
            numeric = numeric or [False] * len(header)
            heads = map(_cell, header, numeric, repeat("th"))
            top += f"<thead><tr>{''.join(heads)}</tr></thead>"
        body = "".join(
            f"<tr>{''.join(map(_cell, row, numeric or map(_is_number, row)))}</tr>" for row in rows
        )
        kind = "scroll short" if len(rows) <= SHORT_TABLE else "scroll"
        self._body.append(f'<div class="{kind}"><table>{top}<tbody>{body}</tbody></table></div>')

    def code(self, *lines: str) -> None:
        """Lines as they are typed."""
        self._body.append(f"<pre>{html.escape(chr(10).join(lines))}</pre>")

    def links(self, files: Iterable[tuple[str, str]]) -> None:
        """Files beside the report: (path relative to it, what it is)."""
        rows = "".join(
            f'<tr><td><a href="{html.escape(path)}">{html.escape(path)}</a></td>'
            f"<td>{html.escape(words)}</td></tr>"
            for path, words in files
        )
        self._body.append(f'<div class="scroll"><table><tbody>{rows}</tbody></table></div>')

    def row(self, *parts: _Part) -> None:
        """Put what `plot`, `image`, `video`, `page`, `film`, `player` and `still` returned side by
        side where there is room; without a row each stands where it was made.

        Raises:
            ValueError: Something else is given, or a part is in a row already.
        """
        loose = {id(block) for block in self._body if isinstance(block, _Part)}
        for part in parts:
            if id(part) not in loose:
                raise ValueError(
                    f"row: got {str(part)[:40]!r}, expected parts that a plot, image, video, page, "
                    "film, player or still of this document returned, each once"
                )
            loose.remove(id(part))
        taken = {id(part) for part in parts}
        self._body = [block for block in self._body if id(block) not in taken]
        inside = "".join(map(str, parts))
        self._body.append(f'<div class="row">{inside}</div>' if len(parts) > 1 else inside)

    # -- figures, which a row may put side by side -------------------------------------------------

    def plot(self, figure: Figure, caption: str = "") -> _Part:
        """A matplotlib figure as an inline drawing; dense scatters should be rasterised."""
        self._plots += 1
        drawing = _svg(figure, f"plot {self._plots}")
        return self._put(drawing, caption)

    def image(self, data: bytes | os.PathLike[str], caption: str = "", kind: str = "png") -> _Part:
        """A picture or an animation of a kind that browsers show: png, webp, gif, jpeg."""
        source = f"data:image/{kind};base64,{_base64(data)}"
        return self._put(f'<img src="{source}" alt="{html.escape(caption)}">', caption)

    def video(self, data: bytes | os.PathLike[str], caption: str = "", kind: str = "mp4") -> _Part:
        """A video of a kind that browsers play: mp4, webm."""
        source = f"data:video/{kind};base64,{_base64(data)}"
        return self._put(
            f'<video src="{source}" controls autoplay loop muted playsinline></video>', caption
        )

    def page(self, text: str, caption: str = "", printed: str = "") -> _Part:
        """A whole page, for example one of `ws.html_page`, in a frame that can do no harm.

        Args:
            text: The page.
            caption: What it shows.
            printed: What stands in its place on paper.
        """
        frame = f'<iframe sandbox="allow-scripts" loading="lazy" title="{html.escape(caption)}"'
        inside = f'{frame} srcdoc="{html.escape(text)}"></iframe>'
        note = f'<p class="printed">{html.escape(printed)}</p>' if printed else ""
        return self._put(inside, caption, "page", note)

    def film(
        self,
        result: Result,
        caption: str = "",
        robots: int | Sequence[int] | None = None,
        start: float | None = None,
        duration: float | None = None,
    ) -> _Part:
        """A film of recorded robots; H.264 with the extra ``video``, else an animated picture.

        Args:
            result: With recorded frames.
            caption: What it shows.
            robots: Who is in it; all that were recorded by default.
            start: Where in the run it starts [s]; default its first frame.
            duration: How much of the run it shows [s]; default all of it.
        """
        data, kind = exhibits.film(result, robots, MOST_FILM, start, duration)
        put = self.video if kind == "mp4" else self.image
        return put(data, caption, kind=kind)

    def player(
        self,
        result: Result,
        caption: str = "",
        robots: Sequence[int] | None = None,
        names: Mapping[int, str] | None = None,
        custom_data: Mapping[int, Mapping[str, Any]] | None = None,
        title: str = "",
    ) -> _Part:
        """The page of `ws.html_page` in a frame, with as many of the robots as keep it small.

        Args:
            result: With recorded frames.
            caption: What it shows; how to use it is added.
            robots: Who is on it, the most important first; all that were recorded by default.
            names: As in `ws.html_page`.
            custom_data: As there.
            title: As there.
        """
        shown = list(result.recorded if robots is None else robots)
        page, count = exhibits.player(
            result, shown, MOST_PAGE, names or {}, custom_data or {}, title or self.title
        )
        left_out = f" The first {count} of {len(shown)}." if count < len(shown) else ""
        return self.page(
            page,
            f"{caption}{left_out} Drag to turn, zoom, slow down, choose a robot, colour its "
            "springs by stress, material or actuation; press ? for the keys.",
            printed="The file holds a page here in which the robots move; open it in a browser.",
        )

    def still(
        self,
        result: Result,
        caption: str = "",
        robots: Sequence[int] | None = None,
        labels: Sequence[str] | None = None,
    ) -> _Part:
        """A picture of the last frame, each robot in a tile of its own.

        Args:
            result: With recorded frames.
            caption: What it shows.
            robots: Who is on it; all that were recorded by default.
            labels: A text for each.
        """
        shown = list(result.recorded if robots is None else robots)
        return self.image(exhibits.still(result, shown, labels), caption, kind="webp")

    def _put(self, inside: str, caption: str, kind: str = "", note: str = "") -> _Part:
        start = f'<figure class="{kind}">' if kind else "<figure>"
        below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
        part = _Part(f"{start}{inside}{below}</figure>{note}")
        self._body.append(part)
        return part

    # -- the end -----------------------------------------------------------------------------------

    def html(self) -> str:
        """The whole file."""
        entries = "".join(
            f'<a href="#s{i}">{html.escape(title)}</a>'
            for i, title in enumerate(self._sections, start=1)
        )
        return filled(
            "document",
            title=self.title,
            policy="img-src data:; media-src data:; script-src 'unsafe-inline'",
            subtitle=f"<p>{html.escape(self.subtitle)}</p>" if self.subtitle else "",
            contents=f'<nav aria-label="Sections">{entries}</nav>' if len(entries) > 1 else "",
            content="\n".join(map(str, self._body)),
        )

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the file, whole or not at all, and return its path.

        Raises:
            ValueError: The path does not end in ``.html``.
            OSError: It cannot be written.
        """
        path = checked_output(path, SUFFIXES)
        text = self.html()
        with written_beside(path) as draft:
            draft.write_text(text, encoding="utf-8")
        return path


def _svg(figure: Figure, salt: str) -> str:
    """A figure as text that is the same whenever it is made, fit to stand beside others."""
    import matplotlib

    # The salt keeps the names of clip paths and markers apart from those of other figures.
    settings = {"svg.fonttype": "none", "svg.hashsalt": salt}
    with matplotlib.rc_context(settings), io.StringIO() as target:
        nothing = {"Date": None, "Creator": None}
        figure.savefig(target, format="svg", bbox_inches="tight", metadata=nothing)
        text = target.getvalue()
    drawing = text[text.index("<svg") :]
    drawing = re.sub(r"<metadata>.*?</metadata>", "", drawing, flags=re.S)
    return _NAMED_GROUP.sub("", re.sub(r"\n\s*", "\n", drawing))


def _cell(value: Cell, right: bool, tag: str = "td") -> str:
    if _is_number(value):
        value = f"{value:,}" if isinstance(value, int) else f"{value:.4g}"
    start = f'<{tag} class="number">' if right else f"<{tag}>"
    return f"{start}{html.escape(str(value))}</{tag}>"


def _is_number(value: Cell) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_numeric(column: Sequence[Cell]) -> bool:
    """Whether a column is one of numbers: some are, and the others are words without any digit."""
    texts = [str(value) for value in column]
    numbers = [_NUMBER.fullmatch(text) is not None for text in texts]
    words = [not any(map(str.isdecimal, text)) for text in texts]
    return any(numbers) and all(map(operator.or_, numbers, words))


def _base64(data: bytes | os.PathLike[str]) -> str:
    content = data if isinstance(data, bytes) else Path(data).read_bytes()
    return base64.b64encode(content).decode()
