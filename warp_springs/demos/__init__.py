"""The classroom's demonstrations: scene files that show the physics, each one command.

`NAMES` lists them. All but the slope, which is many scenes, are scene files of this folder: to be
read, copied and changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_springs.config import SceneFile

__all__ = ["NAMES", "about", "load", "text"]

NAMES = (
    "bouncing-cube",
    "breathing-cube",
    "ten-cubes",
    "tetrahedron",
    "soft-legs",
    "cable-pendulum",
    "worm",
    "slope",
)
"""The demonstrations, in the order in which one would look at them."""


def text(name: str) -> str:
    """The scene file of a demonstration."""
    return (resources.files(__name__) / f"{name}.toml").read_text(encoding="utf-8")


def about(name: str) -> str:
    """What a demonstration shows, in one line."""
    return next(
        line.partition("=")[2].strip().strip('"')
        for line in text(name).splitlines()
        if line.startswith("about")
    )


def load(name: str, overrides: Mapping[str, Any] | None = None) -> SceneFile:
    """A demonstration as a scene; overrides and errors as of `warp_springs.config.load_scene`."""
    from warp_springs.config import SceneFile, parse

    return parse(SceneFile, text(name), f"demo {name}", overrides)
