"""Cells of a finite-element mesh as springs, exterior triangles and volumes."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_springs.geometry import FloatArray

__all__ = ["CellBlock", "cell_volumes", "exterior_triangles", "springs_of_cells"]

IndexArray = NDArray[np.intp]

SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line": (),
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "hexahedron": (
        (0, 3, 2, 1),
        (4, 5, 6, 7),
        (0, 1, 5, 4),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (3, 0, 4, 7),
    ),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}
"""Corners of the sides of each kind of cell, in the order of VTK."""
SOLID = ("tetra", "hexahedron", "wedge", "pyramid")
_CORNERS = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4} | {
    "hexahedron": 8,
    "wedge": 6,
    "pyramid": 5,
}


class CellBlock:
    """Cells of one kind, without the nodes in the middle of their edges and sides.

    Args:
        kind: What meshio calls them: ``"tetra"``, ``"tetra10"``, ``"polygon"``, ...
        nodes: Numbers of their nodes, shape (C, K).

    Attributes:
        kind: A key of `SIDES`, or ``"polygon"``.
        corners: Numbers of their corners, shape (C, K).

    Raises:
        ValueError: They are none of points, lines, polygons, tetrahedra, hexahedra, wedges and
            pyramids.
    """

    def __init__(self, kind: str, nodes: NDArray) -> None:
        base = re.fullmatch(r"([a-z]+)\d*", kind)
        self.kind = base.group(1) if base else kind
        if self.kind == "polygon":
            count = nodes.shape[1]
            self.sides: tuple[tuple[int, ...], ...] = (tuple(range(count)),)
        elif self.kind in SIDES:
            count, self.sides = _CORNERS[self.kind], SIDES[self.kind]
        else:
            raise ValueError(
                f"cells of type {kind!r} are not understood, only lines, triangles, quads, "
                "polygons, tetrahedra, hexahedra, wedges and pyramids"
            )
        self.corners: IndexArray = np.asarray(nodes)[:, :count].astype(np.intp)

    @property
    def is_solid(self) -> bool:
        """Whether they have a volume."""
        return self.kind in SOLID

    def pairs(self, diagonals: bool) -> Sequence[tuple[int, int]]:
        """The corners of one cell that springs join: its edges, or all pairs."""
        count = self.corners.shape[1]
        if diagonals or self.kind == "line":
            return list(itertools.combinations(range(count), 2))
        around = [zip(side, (*side[1:], side[0]), strict=True) for side in self.sides]
        return sorted({tuple(sorted(pair)) for pairs in around for pair in pairs})

    def triangles(self) -> tuple[IndexArray, IndexArray, IndexArray]:
        """All sides of all cells as triangles.

        Returns:
            Corners (T, 3), the cell of each, and the side of each, numbered through.
        """
        triangles, cells, sides = [], [], []
        for number, side in enumerate(self.sides):
            for i in range(1, len(side) - 1):
                triangles.append(self.corners[:, [side[0], side[i], side[i + 1]]])
                cells.append(np.arange(len(self.corners)))
                sides.append(np.arange(len(self.corners)) * len(self.sides) + number)
        if not triangles:
            return np.zeros((0, 3), np.intp), np.zeros(0, np.intp), np.zeros(0, np.intp)
        return np.concatenate(triangles), np.concatenate(cells), np.concatenate(sides)


def springs_of_cells(
    blocks: Sequence[CellBlock], diagonals: bool
) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Every edge of the cells once, lower corner first, in ascending order.

    Args:
        blocks: The cells.
        diagonals: Whether all corners of a cell are joined, instead of its edges alone.

    Returns:
        Springs (S, 2), and for each the block and the cell in it that it was first found in.
    """
    pairs, owners, cells = [], [], []
    for number, block in enumerate(blocks):
        ends = np.array(block.pairs(diagonals))
        found = block.corners[:, ends].reshape(-1, 2)
        pairs.append(np.sort(found, axis=1))
        owners.append(np.full(len(found), number))
        cells.append(np.repeat(np.arange(len(block.corners)), len(ends)))
    every, owner, cell = map(np.concatenate, (pairs, owners, cells))
    proper = every[:, 0] != every[:, 1]  # a collapsed cell has edges without length
    every, owner, cell = every[proper], owner[proper], cell[proper]
    springs, first = np.unique(every, axis=0, return_index=True)
    return springs, owner[first], cell[first]


def exterior_triangles(blocks: Sequence[CellBlock], points: FloatArray) -> IndexArray:
    """The skin: sides that only one solid cell has, outward, and surface cells that are none's.

    Quads and polygons become triangles. Surface cells keep their winding, unless they are closed
    and inside out.
    """
    blocks = [block for block in blocks if block.kind != "line"]
    if not blocks:
        return np.zeros((0, 3), np.intp)
    keys = [_side_keys(block) for block in blocks]
    group = np.unique(_padded(keys), axis=0, return_inverse=True)[1].reshape(-1)
    groups = np.split(group, np.cumsum([len(key) for key in keys])[:-1])
    times = np.zeros(group.max(initial=-1) + 1, np.intp)
    for block, group in zip(blocks, groups, strict=True):
        if block.is_solid:
            times += np.bincount(group, minlength=len(times))
    skin, surface = [], []
    for block, group in zip(blocks, groups, strict=True):
        triangles, cells, sides = block.triangles()
        if block.is_solid:
            chosen = times[group[sides]] == 1
            middles = points[block.corners].mean(axis=1)[cells[chosen]]
            skin.append(_outward(triangles[chosen], points, middles))
        else:
            surface.append(triangles[times[group[sides]] == 0])
    if surface:
        skin.append(_inside_in(_distinct(np.concatenate(surface)), points))
    return np.concatenate(skin)


def cell_volumes(block: CellBlock, points: FloatArray) -> FloatArray:
    """Volume of each solid cell [m^3], the sum of the pyramids from its middle to its sides."""
    triangles, cells, _ = block.triangles()
    middle = points[block.corners].mean(axis=1)[cells]
    a, b, c = points[triangles].transpose(1, 0, 2) - middle
    volumes = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6.0
    return np.bincount(cells, volumes, minlength=len(block.corners))


def _side_keys(block: CellBlock) -> IndexArray:
    """The sorted corners of every side of every cell, sides of one cell together, -1 padded."""
    width = max((len(side) for side in block.sides), default=0)
    keys = np.full((len(block.corners), len(block.sides), width), -1, np.intp)
    for number, side in enumerate(block.sides):
        keys[:, number, : len(side)] = block.corners[:, side]
    return np.sort(keys.reshape(-1, width), axis=1)


def _padded(keys: Sequence[IndexArray]) -> IndexArray:
    """Keys of several widths below each other."""
    width = max((key.shape[1] for key in keys), default=1)
    parts = [np.pad(k, ((0, 0), (width - k.shape[1], 0)), constant_values=-1) for k in keys]
    return np.concatenate(parts) if parts else np.zeros((0, width), np.intp)


def _outward(triangles: IndexArray, points: FloatArray, middles: FloatArray) -> IndexArray:
    """Triangles turned away from the middles of their cells."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - middles) < 0.0
    return np.where(inward[:, None], triangles[:, ::-1], triangles)


def _distinct(triangles: IndexArray) -> IndexArray:
    """Triangles with three corners, each once, in their order."""
    corners = np.sort(triangles, axis=1)
    _, first = np.unique(corners, axis=0, return_index=True)
    proper = (corners[:, 1:] != corners[:, :-1]).all(axis=1)
    first = np.sort(first)
    return triangles[first[proper[first]]]


def _inside_in(triangles: IndexArray, points: FloatArray) -> IndexArray:
    """Triangles of a surface, all turned if it is closed and inside out."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    there, back = (np.sort(e @ np.array([len(points), 1])) for e in (edges, edges[:, ::-1]))
    if len(triangles) == 0 or not np.array_equal(there, back):
        return triangles
    a, b, c = (points[triangles] - points[triangles].mean(axis=(0, 1))).transpose(1, 0, 2)
    return triangles[:, ::-1] if np.einsum("ij,ij->", a, np.cross(b, c)) < 0.0 else triangles
