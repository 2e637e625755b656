"""What all pages have in common: the head, the style that they share, and how scripts run."""

from __future__ import annotations

import html
from collections.abc import Sequence
from importlib.resources import files
from string import Template

__all__ = ["asset", "filled"]

_SCRIPT = '<script>\n(() => {{\n"use strict";\n{}}})();\n</script>'


def filled(name: str, *, title: str, policy: str, scripts: Sequence[str] = (), **parts: str) -> str:
    """A whole page: the body and the style of a name, in the shell.

    Args:
        name: Of ``assets/NAME.html`` and ``NAME.css``.
        title: What the page is called, plain text.
        policy: What it may load, as browsers want it, beside ``default-src 'none'``, its own
            styles and its own scripts, if there are any.
        scripts: Files of the folder ``assets`` that run as one script, in this order.
        **parts: HTML that the body leaves open.
    """
    script = _SCRIPT.format("\n".join(map(asset, scripts))) if scripts else ""
    runs = "script-src 'unsafe-inline'; " if scripts else ""
    words = html.escape(title)
    return Template(asset("shell.html")).substitute(
        title=words,
        policy=f"default-src 'none'; style-src 'unsafe-inline'; {runs}{policy}",
        style=asset("shell.css") + asset(f"{name}.css"),
        body=Template(asset(f"{name}.html")).substitute(title=words, **parts).strip(),
        script=script,
    )


def asset(name: str) -> str:
    """The text of a file of the folder ``assets``."""
    return files("warp_springs.view").joinpath("assets", name).read_text(encoding="utf-8")
