"""How pictures and films look, and how a film runs: the options of `ws.render`, checked."""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from dataclasses import dataclass

from warp_springs.checks import check_choice, check_number
from warp_springs.materials import linear_rgb
from warp_springs.view import appearance
from warp_springs.view.pictures.camera import Camera

COLORS = ("stress", "material", "actuation", "plain")
"""What the colour of a bar may say."""
LAYOUTS = ("grid", "panel", "world")
"""How several robots may be shown."""
LEAST_CYCLES = 3
"""Cycles of the slowest muscle that a film should show."""


@dataclass(frozen=True)
class Look:
    """What is drawn and how; the fields are the arguments of `ws.render`.

    Raises:
        ValueError: A value is out of range; the message names it.
    """

    color: str = "stress"
    skin: bool | str = True
    bars: bool = True
    balls: bool = True
    thickness: float = 1.0
    layout: str | None = None
    camera: Camera | None = None
    azimuth: float | None = None
    elevation: float | None = None
    labels: Sequence[str] | None = None
    caption: str | None = None
    legend: bool = False

    def __post_init__(self) -> None:
        check_choice("color", self.color, COLORS)
        if self.layout is not None:
            check_choice("layout", self.layout, LAYOUTS)
        check_number("thickness", self.thickness, above=0.0)
        for name in ("azimuth", "elevation"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), at_least=-360.0)
        if isinstance(self.skin, str):
            linear_rgb(self.skin, "skin")

    @property
    def skin_color(self) -> tuple[float, float, float] | None:
        """Colour of the faces, linear RGB, or None where none are drawn."""
        if isinstance(self.skin, str):
            return linear_rgb(self.skin)
        return appearance.SKIN if self.skin else None


@dataclass(frozen=True)
class Cut:
    """Which part of a run a film shows, how fast, and how the camera moves.

    Raises:
        ValueError: A value is out of range; the message names it.
    """

    fps: float = 30.0
    speed: float = 1.0
    start: float | None = None
    duration: float | None = None
    follow: bool = True
    turns: float = 0.0
    clock: bool = True

    def __post_init__(self) -> None:
        check_number("fps", self.fps, above=0.0)
        check_number("speed", self.speed, above=0.0)
        check_number("turns", self.turns, at_least=-1e6)
        for name, bound in (("start", {"at_least": -1e9}), ("duration", {"above": 0.0})):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), **bound)


def checked_frame(frame: int | None, count: int) -> int | None:
    """The index of a frame among `count`, counted from the last if negative, or a refusal."""
    if frame is None:
        return None
    if not isinstance(frame, numbers.Integral) or isinstance(frame, bool):
        raise TypeError(f"frame: got {frame!r}, expected a whole number or None")
    if not -count <= frame < count:
        raise ValueError(
            f"frame {frame} is out of range: {count} frames were recorded, {-count} ... {count - 1}"
        )
    return int(frame) % count
