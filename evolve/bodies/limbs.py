"""Bodies of parts: the cells of a tree that a graph grammar made, mirrored limbs on both sides."""

from __future__ import annotations

from dataclasses import dataclass

from evolve.bodies.cells import (
    BEND,
    DOWN,
    LEFT,
    RIGHT,
    SWELL,
    SWING_SIDEWAYS,
    TIP,
    UP,
    Cells,
    Tissue,
)
from evolve.bodies.derivation import Node, Tree
from evolve.bodies.graph_grammar import NO_JOINT, Grammar, Part

__all__ = ["GENES", "PHASES", "build"]

GENES = ("phase", "lag", "twin", "swing", "size", "pitch", "yaw", "stiffness")
"""Genes of a part, in [0, 1]: when its joint moves, how much later it moves itself, how much later
its mirrored twin does [cycles]; how far, how long, how it is turned, how stiff."""
PHASES = ("phase", "lag", "twin")
"""Those that go round."""

_SIDES = {"up": UP, "right": RIGHT, "down": DOWN, "left": LEFT, "tip": TIP}
_KINDS = {"not": SWELL, "swell": SWELL, "bend": BEND, "swing": SWING_SIDEWAYS}


@dataclass(frozen=True)
class _Place:
    """Where a part will grow, and how."""

    cell: int = -1
    side: int = TIP
    mirrored: bool = False
    later: float = 0.0
    """Phase of the limb [cycles]."""


def build(tree: Tree, grammar: Grammar, cells: Cells) -> Cells:
    """Build the cells of all parts, joints before their child; what does not fit is left out.

    An unfinished part builds nothing, and so does what hangs on it.

    Args:
        tree: The parts.
        grammar: What their labels mean.
        cells: An empty body, which is filled and returned; it has one cell at least.
    """
    root = tree.nodes[0]
    part = grammar.cells.get(root.label)
    if part is None:
        cells.seed(Tissue())
        return cells
    genes = _named(root)
    cells.seed(_tissue(part, genes, genes["phase"], False), _within(part.length, genes["size"]))
    waiting = [(0, [_Place(cell=0)])]
    for number, places in waiting:
        for child in tree.children(number):
            grown = _grow_at_all(tree.nodes[child], grammar, cells, places)
            waiting.append((child, grown))
    return cells


def _grow_at_all(node: Node, grammar: Grammar, cells: Cells, parents: list[_Place]) -> list[_Place]:
    """Grow a part on each of its parents, where there is material for all; where the cells are.

    A limb that grows on one side alone would not be a mirrored pair.
    """
    if node.label not in grammar.cells:
        return []
    parts = [grammar.cells[node.label]]
    if node.joint != NO_JOINT:
        parts.insert(0, grammar.joints[node.joint])
    side, found = _SIDES[node.side], []
    twins = (False, True) if node.mirror else (False,)
    if len(cells) + len(parents) * len(twins) * len(parts) > cells.most:
        return []
    for at in parents:
        for twin in twins:
            flipped = at.mirrored != twin
            here = {LEFT: RIGHT, RIGHT: LEFT}.get(side, side) if flipped else side
            later = at.later + twin * _named(node)["twin"]
            cell = _grow_part(node, parts, cells, _Place(at.cell, here, flipped, later))
            if cell is not None:
                found.append(_Place(cell, TIP, flipped, later))
    return found


def _grow_part(node: Node, parts: list[Part], cells: Cells, at: _Place) -> int | None:
    """Grow the joint of a part, if it has one, and the part; the cell of the part."""
    cell, side, genes = at.cell, at.side, _named(node)
    for place, part in enumerate(parts):
        # The last is the part itself; a joint before it moves earlier.
        later = genes["lag"] if place == len(parts) - 1 else 0.0
        phase = genes["phase"] + at.later + later
        yaw = _within(part.yaw, genes["yaw"]) * (-1.0 if at.mirrored else 1.0)
        grown = cells.grow(
            cell,
            side,
            _tissue(part, genes, phase, at.mirrored),
            _within(part.length, genes["size"]),
            (_within(part.pitch, genes["pitch"]), yaw, 0.0),
            part.taper,
        )
        if grown is None:
            return None
        cell, side = grown, TIP
    return cell


def _tissue(part: Part, genes: dict[str, float], phase: float, mirrored: bool) -> Tissue:
    """What a cell is made of; the mirror image of left is right, half a cycle from it."""
    kind = _KINDS[part.moves]
    opposite = 0.5 if mirrored and kind == SWING_SIDEWAYS else 0.0
    return Tissue(
        swing=0.0 if part.moves == "not" else _within(part.swing, genes["swing"]),
        phase=(phase + opposite) % 1.0,
        stiffness=_within(part.stiffness, genes["stiffness"]),
        kind=kind,
    )


def _named(node: Node) -> dict[str, float]:
    """The genes of a part by name; of one that no step made, the middle."""
    return dict(zip(GENES, node.genes or (0.5,) * len(GENES), strict=True))


def _within(interval: tuple[float, float], gene: float) -> float:
    low, high = interval
    return low + (high - low) * gene
