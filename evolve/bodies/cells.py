"""Bodies of cells: boxes of eight masses, each of which grows out of a side of another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evolve.bodies.plan import Plan

__all__ = [
    "BEND",
    "DOWN",
    "LEFT",
    "RIGHT",
    "SWELL",
    "SWING_SIDEWAYS",
    "TIP",
    "UP",
    "Cells",
    "Tissue",
]

UP, RIGHT, DOWN, LEFT, TIP = range(5)
"""Sides of a cell on which another may grow, seen along its heading."""

SWELL, BEND, SWING_SIDEWAYS = range(3)
"""What a cell does as it breathes: grow longer, bend up and down, or bend left and right."""

# Corners 0 to 3 are the base of a cell and 4 to 7 its tip: left above, right above, right below,
# left below, counter-clockwise about the heading. The quads are the sides in the order above, as
# the bases of what grows on them: each starts left above of its own heading.
_SIDES = np.array([[0, 1, 5, 4], [5, 1, 2, 6], [7, 6, 2, 3], [0, 4, 7, 3], [4, 5, 6, 7]])
_BACK = np.array([3, 2, 1, 0])
_RING = np.array([[4, 5], [5, 6], [6, 7], [4, 7], [4, 6], [5, 7]])
_CROSS = np.array([[i, j] for i in range(4) for j in range(4, 8)])
_PAIRS = np.concatenate([_RING, _CROSS])
"""Springs that a cell adds: those of its tip, and from its base to its tip."""


def _shares() -> np.ndarray:
    """What share of the strain along the heading each spring takes, signed, shape (3, 22)."""
    apart = (_CROSS[:, 1] - 4 - _CROSS[:, 0]) % 4
    along = np.array([1.0, 1 / 2, 1 / 3, 1 / 2])[apart]  # square of the cosine to the heading
    above, left = np.array([1, 1, -1, -1]), np.array([1, -1, -1, 1])
    kinds = [np.ones(4), above, left]
    cross = np.array([along * (w[_CROSS[:, 0]] + w[_CROSS[:, 1] - 4]) / 2 for w in kinds])
    return np.concatenate([np.zeros((3, len(_RING))), cross], axis=1)


_STRAIN = _shares()


@dataclass(frozen=True)
class Tissue:
    """What a cell is made of and what it does; all but the kind in [0, 1], as in `Plan.genes`."""

    rest: float = 0.5
    swing: float = 0.0
    phase: float = 0.0
    stiffness: float = 0.5
    kind: int = SWELL
    """`SWELL`, `BEND` or `SWING_SIDEWAYS`."""


class Cells:
    """A body that grows cell by cell, within limits; what does not fit is refused.

    Args:
        edge: Length of the edges of the first cell [m].
        most: Cells that the body may have.
        extent: Longest side of the bounding box that it may have [m].
        behind: How far back it may reach, seen from the base of the first cell, negative [m].
    """

    def __init__(self, edge: float, most: int, extent: float, behind: float = -np.inf) -> None:
        self.edge, self.most, self.extent, self.behind = edge, most, extent, behind
        self.corners: list[np.ndarray] = []
        """The eight masses of each cell."""
        self.parents: list[int] = []
        """The cell on which each grew; -1 for the first."""
        self._points: np.ndarray = np.zeros((0, 3))
        self._tissues: list[Tissue] = []
        self._taken: set[tuple[int, int]] = set()

    def __len__(self) -> int:
        return len(self.corners)

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells [m], shape (C, 3)."""
        return self._points[np.array(self.corners)].mean(axis=1)

    def free(self, cell: int, side: int) -> bool:
        """Whether nothing grew on a side of a cell."""
        return (cell, side) not in self._taken

    def side(self, cell: int, side: int) -> tuple[np.ndarray, np.ndarray]:
        """The middle of a side [m], shape (3,), and its outward normal, of length one."""
        quad = self._points[self.corners[cell][_SIDES[side]]]
        return quad.mean(axis=0), _frame(quad)[0]

    def seed(self, tissue: Tissue, length: float = 1.0) -> int:
        """The first cell, heading along x.

        Args:
            tissue: What it is made of.
            length: Its length, in edges.
        """
        if self.corners:
            raise ValueError("the body has its first cell already")
        half = 0.5 * self.edge
        base = np.array([[0, half, half], [0, -half, half], [0, -half, -half], [0, half, -half]])
        self._points = np.concatenate([base, base + np.array([length * self.edge, 0, 0])])
        self.corners.append(np.arange(8))
        self.parents.append(-1)
        self._tissues.append(tissue)
        return 0

    def grow(
        self,
        cell: int,
        side: int,
        tissue: Tissue,
        length: float = 1.0,
        turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
        taper: float = 1.0,
    ) -> int | None:
        """Add a cell on a side of another; None where there is no room.

        Args:
            cell: On which cell.
            side: On which of its sides: `UP`, `RIGHT`, `DOWN`, `LEFT`, or `TIP`.
            tissue: What it is made of.
            length: Its length, in edges of the first cell.
            turn: How far its tip is turned up, to the left, and about the heading [rad].
            taper: Width of its tip in widths of its base.
        """
        if len(self) >= self.most or not self.free(cell, side):
            return None
        base = self.corners[cell][_SIDES[side]]
        quad = self._points[base]
        tip = _extruded(quad, length * self.edge, turn, taper)
        if not self._has_room(quad, tip, cell):
            return None
        self._taken.add((cell, side))
        number = len(self._points)
        self._points = np.concatenate([self._points, tip])
        self.corners.append(np.concatenate([base, np.arange(number, number + 4)]))
        self.parents.append(cell)
        self._tissues.append(tissue)
        return len(self) - 1

    def _has_room(self, quad: np.ndarray, tip: np.ndarray, parent: int) -> bool:
        """Whether a new cell keeps the body within its extent, and away from its other cells."""
        if np.ptp(np.concatenate([self._points, tip]), axis=0).max() > self.extent:
            return False
        if tip[:, 0].min() < self.behind:
            return False
        middle = 0.5 * (quad.mean(axis=0) + tip.mean(axis=0))
        apart = np.linalg.norm(self.centres - middle, axis=1)
        apart[parent] = np.inf
        return bool(apart.min() > 0.8 * self.edge)

    def plan(self) -> Plan:
        """The body as a plan; every cell is as heavy as any other."""
        pairs, genes, tissues = [], [], self._tissues
        shares = np.zeros(len(self._points))
        first = np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2], [1, 3]])
        for cell, (corners, tissue) in enumerate(zip(self.corners, tissues, strict=True)):
            pairs.append(corners[_PAIRS])
            genes.append(_genes(tissue))
            shares[corners] += 1.0
            if cell == 0:  # the base of the first cell is the tip of none
                pairs.append(corners[first])
                genes.append(_genes(tissue)[: len(first)])
        return Plan(
            self._points.astype(np.float32),
            shares.astype(np.float32),
            np.concatenate(pairs).astype(np.int32),
            np.concatenate(genes).astype(np.float32),
            self._faces(),
        )

    def _faces(self) -> np.ndarray:
        """Two triangles for every side on which nothing grew, shape (T, 3)."""
        quads = [self.corners[0][_BACK]]
        for cell, corners in enumerate(self.corners):
            quads += [corners[_SIDES[side]] for side in range(5) if self.free(cell, side)]
        quads = np.array(quads)
        return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


def _genes(tissue: Tissue) -> np.ndarray:
    """Genes of the springs that a cell adds, shape (22, 4)."""
    strain = _STRAIN[tissue.kind]
    genes = np.empty((len(strain), 4))
    genes[:, 0] = 0.5 + (tissue.rest - 0.5) * np.abs(strain)
    genes[:, 1] = tissue.swing * np.abs(strain)
    genes[:, 2] = (tissue.phase + 0.5 * (strain < 0.0)) % 1.0
    genes[:, 3] = tissue.stiffness
    return genes


def _frame(quad: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heading, left and up of a base, of length one, from its corners, shape (4, 3)."""
    a, b, c, d = quad
    left, up = a + d - b - c, a + b - c - d
    heading = _unit(_cross(left, up))
    up = _unit(_cross(heading, left))
    return heading, _cross(up, heading), up


def _extruded(quad: np.ndarray, length: float, turn: tuple, taper: float) -> np.ndarray:
    """Corners of the tip of a cell on a base, shape (4, 3)."""
    heading, left, up = _frame(quad)
    pitch, yaw, roll = turn
    ahead = np.cos(pitch) * np.cos(yaw) * heading + np.cos(pitch) * np.sin(yaw) * left
    ahead = ahead + np.sin(pitch) * up
    side = _unit(_cross(up, ahead))
    above = _cross(ahead, side)
    side, above = (
        np.cos(roll) * side + np.sin(roll) * above,
        np.cos(roll) * above - np.sin(roll) * side,
    )
    middle = quad.mean(axis=0)
    around = quad - middle
    across, over = taper * (around @ left), taper * (around @ up)
    centre = middle + 0.5 * length * (heading + ahead)
    return centre + across[:, None] * side + over[:, None] * above


def _unit(vector: np.ndarray) -> np.ndarray:
    # A base that a simulation squeezed flat has no direction; any will do.
    length = np.sqrt((vector * vector).sum())
    return vector / length if length > 1e-12 else np.array([1.0, 0.0, 0.0])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors: np.cross takes ten times as long for one."""
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
