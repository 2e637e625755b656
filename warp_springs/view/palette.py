"""What the bars of robots are made of, as names and colours: one table for all that are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warp_springs.robot import Robot

__all__ = ["material_palette"]

CLASSES = 5
"""Springs without a material fall into so many classes of stiffness, equally wide as ratios."""
SOFT, HARD = (0.90, 0.72, 0.30), (0.06, 0.03, 0.20)
"""Colours of the softest and of the hardest class, linear RGB."""

Row = tuple[str, tuple[float, float, float]]


def material_palette(robots: Sequence[Robot]) -> tuple[list[Row], list[NDArray[np.int64]]]:
    """Names and colours of what springs are made of.

    Springs without a material are told apart by their stiffness: from sand (soft) to violet
    (hard), over the range of all robots given.

    Returns:
        Rows of a name and a colour in linear RGB, and for each robot the row of every spring, (S,).
    """
    table: dict[tuple, int] = {}
    labels = []
    edges = _edges(robots)
    for robot in robots:
        label = np.zeros(robot.n_springs, np.int64)
        for k, material in enumerate(robot.materials):
            if (own := robot.material == k).any():
                label[own] = table.setdefault(("material", material), len(table))
        bare = robot.material < 0
        classes = np.searchsorted(edges[1:-1], robot.stiffness, side="right")
        for k in np.unique(classes[bare]).tolist():
            label[bare & (classes == k)] = table.setdefault(("stiffness", k), len(table))
        labels.append(label)
    return [_row(*key, edges) for key in table], labels


def _row(kind: str, value, edges: NDArray[np.float64]) -> Row:
    if kind == "material":
        return value.name, value.rgb
    share = value / max(len(edges) - 2, 1)
    color = tuple(((1.0 - share) * np.array(SOFT) + share * np.array(HARD)).tolist())
    low, high = _figure(edges[value]), _figure(edges[min(value + 1, len(edges) - 1)])
    return (f"{low} N/m" if low == high else f"{low} to {high} N/m"), color


def _edges(robots: Sequence[Robot]) -> NDArray[np.float64]:
    """Edges of the classes of the stiffness of springs without material; one class if all agree."""
    bare = np.concatenate([robot.stiffness[robot.material < 0] for robot in robots])
    if bare.size == 0:
        return np.ones(2)
    count = CLASSES if bare.min() < bare.max() else 1
    return np.geomspace(bare.min(), bare.max(), count + 1)


def _figure(value: float) -> str:
    """Two figures, without an exponent where people do not want one: 12,000."""
    return f"{float(f'{value:.2g}'):,g}" if 1e-3 <= value < 1e6 else f"{value:.2g}"
