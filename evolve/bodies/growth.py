"""Growth: a body adds cell after cell where a local rule wants one most, while material lasts."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evolve.bodies.cells import TIP, Cells, Tissue

__all__ = ["INPUTS", "Bud", "Light", "Wish", "folded_pose", "grow", "growing_springs"]

INPUTS = 9
"""What a rule senses at a side of a cell: `Bud.senses`."""
SIDES = 5
"""Of a cell on which others may grow."""


@dataclass(frozen=True)
class Light:
    """A lamp, in the frame of the body."""

    place: tuple[float, float, float]
    """[m]"""
    far: float = 1.0
    """Distance at which its light is half as bright [m]."""


@dataclass(frozen=True)
class Bud:
    """A side of a cell on which another may grow: all that the rule knows of it."""

    cell: int
    side: int
    depth: int
    """Cells between it and the first."""
    state: float
    """What the rule said to the cell, -1 to 1."""
    phase: float
    """When the cell breathes [cycles]."""
    facing: float
    """Cosine between outward and the lamp."""
    level: float
    """Of the light, 0 to 1."""
    outward: tuple[float, float, float]

    @property
    def aside(self) -> float:
        """1 on the left, -1 on the right, 0 in the middle."""
        sideways = self.outward[1]
        return float(np.sign(sideways)) if abs(sideways) > 0.1 else 0.0

    @property
    def senses(self) -> np.ndarray:
        """Light, direction, whether it is the tip, place in the line, state, and 1: shape (9,).

        Left and right feel alike, so that a rule makes a body that is its own mirror image.
        """
        ahead, left, above = self.outward
        parity = 1.0 if self.depth % 2 else -1.0
        place = self.depth / 4.0 - 1.0
        values = (self.facing, self.level, ahead, abs(left), above, place, parity, self.state)
        return np.array([*values, 1.0 if self.side == TIP else -1.0])


@dataclass(frozen=True)
class Wish:
    """What a rule wants at a bud."""

    urge: float
    """The largest of all is granted first; 0 and less: nothing."""
    tissue: Tissue
    length: float = 1.0
    """[edges]"""
    turn: tuple[float, float] = (0.0, 0.0)
    """How far the tip is turned up, and away from the middle of the body [rad]."""
    taper: float = 1.0
    state: float = 0.0
    """What the cell is told."""


Rule = Callable[[list[Bud]], list[Wish]]


def grow(
    cells: Cells, seed: Tissue, rule: Rule, light: Light, material: float, least: int = 1
) -> Cells:
    """Let a body grow from a first cell, one cell at a time.

    At every side of a cell the rule is asked once, when the cell appears; the side that wants most
    gets the next cell, if there is room for it. A side on the left and one on the right that want
    the same get one together or none. Growth ends when nobody wants, when the cells are as many as
    may be, or when the material is used up; with few cells those that want least badly must.

    Args:
        cells: An empty body, which is filled and returned.
        seed: What the first cell is made of.
        rule: What buds want.
        light: Where the lamp is.
        material: Sum of the lengths of all cells but the first [edges].
        least: Cells up to which a body grows even if nobody wants.
    """
    depths, states, phases = [0], [0.0], [seed.phase]
    waiting: list[tuple[float, int, Bud, Wish]] = []

    def ask(cell: int) -> None:
        buds = [
            _bud(cells, cell, side, depths[cell], states[cell], phases[cell], light)
            for side in range(SIDES)
        ]
        for bud, wish in zip(buds, rule(buds), strict=True):
            heapq.heappush(waiting, (-wish.urge, cell * SIDES + bud.side, bud, wish))

    ask(cells.seed(seed))
    while waiting and len(cells) < cells.most:
        if waiting[0][0] >= 0.0 and len(cells) >= least:
            break
        equals = _strongest(waiting)
        needed = sum(wish.length for _, wish in equals)
        if needed > material or len(cells) + len(equals) > cells.most:
            continue
        for bud, wish in equals:
            up, away = wish.turn
            turn = (up, away * bud.aside, 0.0)
            new = cells.grow(bud.cell, bud.side, wish.tissue, wish.length, turn, wish.taper)
            if new is not None:
                material -= wish.length
                depths.append(bud.depth + 1)
                states.append(wish.state)
                phases.append(wish.tissue.phase)
                ask(new)
    return cells


def _strongest(waiting: list[tuple[float, int, Bud, Wish]]) -> list[tuple[Bud, Wish]]:
    """Take the strongest wish from a heap, and that of its mirror image if it is next."""
    first, _, bud, wish = heapq.heappop(waiting)
    if bud.aside and waiting and waiting[0][0] <= first + 1e-9:
        other = waiting[0][2]
        if other.aside == -bud.aside and other.depth == bud.depth:
            return [(bud, wish), heapq.heappop(waiting)[2:]]
    return [(bud, wish)]


def _bud(
    cells: Cells, cell: int, side: int, depth: int, state: float, phase: float, light: Light
) -> Bud:
    place, outward = cells.side(cell, side)
    way = np.asarray(light.place) - place
    distance = float(np.sqrt(way @ way))
    return Bud(
        cell=cell,
        side=side,
        depth=depth,
        state=state,
        phase=phase,
        facing=float(outward @ way) / max(distance, 1e-9),
        level=1.0 / (1.0 + (distance / light.far) ** 2),
        outward=tuple(outward.tolist()),
    )


def folded_pose(positions: np.ndarray, root: int, share: float) -> np.ndarray:
    """A body as a seedling: everything but its root small, shape (M, 3).

    Args:
        positions: Of the full-grown body [m], shape (M, 3), the masses of the root first.
        root: How many masses the root has.
        share: Size of the rest, as a part of what it will be.
    """
    middle = positions[:root].mean(axis=0)
    small = middle + share * (positions - middle)
    return np.concatenate([positions[:root], small[root:]])


def growing_springs(springs: np.ndarray, root: int) -> tuple[np.ndarray, np.ndarray]:
    """Springs that lengthen as their two masses grow, each by the mean of both.

    The masses of the root do not grow; a spring from there obeys its other mass alone.

    Args:
        springs: Shape (S, 2).
        root: How many masses the root has; they come first.

    Returns:
        Which springs grow, shape (G,), and the two masses that each obeys, counted without those
        of the root, shape (G, 2).
    """
    own = springs - root
    growing = np.flatnonzero((own >= 0).any(axis=1))
    pairs = own[growing]
    return growing, np.where(pairs < 0, pairs.max(axis=1, keepdims=True), pairs)
