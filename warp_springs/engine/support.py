"""What the layouts and precisions can simulate; the rest is refused instead of being left out."""

from __future__ import annotations

from collections.abc import Sequence

from warp_springs.body.elements import NONE, Elements
from warp_springs.body.variants import Variants
from warp_springs.robot import Robot
from warp_springs.scene import Scene

__all__ = ["elements_of", "refuse_unsupported"]


def elements_of(robots: Sequence[Robot]) -> list[Elements]:
    """The elements of robots, each structure once or more."""
    some = robots[:1] if isinstance(robots, Variants) else robots
    return [robot.elements for robot in some if robot.elements is not NONE]


def refuse_unsupported(robots: Sequence[Robot], scene: Scene, precision: str) -> None:
    """Raise NotImplementedError for what the kernels cannot simulate."""
    placed = bool(scene.obstacles)
    for elements in elements_of(robots):
        placed |= len(elements.bonds) > 0 or len(elements.tethers) > 0
    if placed and precision == "mixed":
        raise NotImplementedError(
            "precision: 'mixed' counts positions from a moving origin, and knows no obstacles, "
            "constraints or tethers; use 'float64' or 'float32'"
        )
