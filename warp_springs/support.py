"""Which elements the kernels can simulate; others are refused instead of being left out."""

from __future__ import annotations

from collections.abc import Sequence

from warp_springs.elements import NONE
from warp_springs.robot import Robot
from warp_springs.scene import Scene
from warp_springs.variants import Variants

__all__ = ["refuse_unsupported"]


def refuse_unsupported(robots: Sequence[Robot], scene: Scene) -> None:
    """Raise NotImplementedError for an element that the kernels do not know."""
    for name in ("wind", "water", "obstacles", "collisions"):
        if getattr(scene, name):
            raise NotImplementedError(f"Scene.{name} cannot be simulated yet")
    for robot in [robots.body] if isinstance(robots, Variants) else robots:
        if robot.elements is not NONE:
            raise NotImplementedError(f"{robot.elements!r} cannot be simulated yet")
