"""L-systems: strings that rewrite themselves, and a turtle that builds cells along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evolve.bodies.cells import DOWN, LEFT, RIGHT, TIP, UP, Cells, Tissue

__all__ = [
    "CLOSE",
    "OPEN",
    "PITCH",
    "ROLL",
    "TWIN",
    "YAW",
    "Module",
    "Production",
    "build",
    "rewrite",
]

PITCH, YAW, ROLL, OPEN, TWIN, CLOSE = "^", "+", "/", "[", "{", "]"
"""Turn up, left, about the heading; branch off to a side, to that and its mirror image; end."""

MOST_MOVES = 1024
"""Modules that a turtle passes, branches and their twins counted, before it stops."""


@dataclass(frozen=True)
class Module:
    """A symbol with its parameters.

    Anything but the turtle's commands ``^ + / [ { ]`` is a cell of that name. In a production the
    phase is added to that of the symbol it replaces, and the size multiplied with its size.
    """

    symbol: str
    phase: float = 0.0
    """When the cell, or all cells of the branch, breathe [cycles]."""
    size: float = 1.0
    """Length of the cell [edges]."""
    amount: float = 0.0
    """Of a turn: its angle [rad]. Of a branch: the side, as a whole number."""


@dataclass(frozen=True)
class Production:
    """What a symbol becomes: one of several, each with its chance; those need not add up to 1."""

    chances: tuple[float, ...]
    becomes: tuple[tuple[Module, ...], ...]

    @classmethod
    def always(cls, *symbols: str) -> Production:
        """A production without choice and without parameters."""
        return cls((1.0,), (tuple(map(Module, symbols)),))

    def choose(self, draw: float) -> tuple[Module, ...]:
        """The successors that a number in [0, 1) selects."""
        edges = np.cumsum(self.chances)
        place = int(np.searchsorted(edges, draw * edges[-1], side="right"))
        return self.becomes[min(place, len(self.becomes) - 1)]


def rewrite(
    axiom: Sequence[Module],
    productions: Mapping[str, Production],
    steps: int,
    draw: Callable[[], float] = lambda: 0.0,
    most: int = 256,
) -> list[Module]:
    """Replace all symbols at once, as often as there are steps.

    Args:
        axiom: What is there at first.
        productions: Symbols that have none stay.
        steps: How often.
        draw: Gives the numbers in [0, 1) that choose among alternatives.
        most: A step that would give more modules than this is not taken, and is the last.
    """
    string = list(axiom)
    for _ in range(steps):
        longer: list[Module] = []
        for module in string:
            rule = productions.get(module.symbol)
            if rule is None:
                longer.append(module)
                continue
            longer += [_inherits(child, module) for child in rule.choose(draw())]
            if len(longer) > most:
                return string
        string = longer
    return string


def _inherits(child: Module, parent: Module) -> Module:
    size = min(max(child.size * parent.size, 0.6), 1.6)
    return replace(child, phase=child.phase + parent.phase, size=size)


@dataclass(frozen=True)
class _Turtle:
    """Where the next cell will be, and how."""

    cell: int = -1
    side: int = TIP
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mirrored: bool = False
    later: float = 0.0
    """Phase of the branch [cycles]."""

    def turned(self, symbol: str, angle: float) -> _Turtle:
        axis = (PITCH, YAW, ROLL).index(symbol)
        angle = -angle if self.mirrored and axis else angle
        turn = [*self.turn]
        turn[axis] = float(np.clip(turn[axis] + angle, -0.9, 0.9))
        return replace(self, turn=(turn[0], turn[1], turn[2]))

    def branched(self, side: int, later: float, mirrored: bool = False) -> _Turtle:
        """At a side of its cell; `mirrored` at the mirror image of that, as a mirror image."""
        flipped = self.mirrored != mirrored
        swap = {LEFT: RIGHT, RIGHT: LEFT} if flipped else {}
        return replace(
            self, side=swap.get(side, side), turn=(0.0, 0.0, 0.0), mirrored=flipped, later=later
        )


def build(string: Sequence[Module], tissues: Mapping[str, Tissue], cells: Cells) -> Cells:
    """Let a turtle walk along a string and build cells; it passes over those that do not fit.

    Args:
        string: The modules. A branch that nothing closes lasts to the end.
        tissues: What the cells of each name are made of.
        cells: An empty body, which is filled and returned; it has one cell at least.
    """
    _walk(list(string), _Turtle(), tissues, cells, iter(range(MOST_MOVES)))
    if not len(cells):
        cells.seed(next(iter(tissues.values())))
    return cells


def _walk(
    string: list[Module], turtle: _Turtle, tissues, cells: Cells, moves: Iterator[int]
) -> None:
    """Walk along a string, as long as there are moves left: twins within twins double them."""
    place = 0
    while place < len(string) and next(moves, None) is not None and len(cells) < cells.most:
        module = string[place]
        place += 1
        if module.symbol in (PITCH, YAW, ROLL):
            turtle = turtle.turned(module.symbol, module.amount)
        elif module.symbol in (OPEN, TWIN):
            if turtle.cell < 0:
                continue  # there is nothing to branch off from yet: this is the trunk
            end = _closing(string, place)
            inside, place = string[place:end], end + 1
            side = (UP, RIGHT, DOWN, LEFT)[int(module.amount) % 4]
            twins = module.symbol == TWIN and side in (LEFT, RIGHT)
            _walk(inside, turtle.branched(side, turtle.later), tissues, cells, moves)
            if twins:
                later = turtle.later + module.phase
                _walk(inside, turtle.branched(side, later, mirrored=True), tissues, cells, moves)
        elif module.symbol != CLOSE:
            turtle = _step(module, turtle, tissues[module.symbol], cells)


def _step(module: Module, turtle: _Turtle, tissue: Tissue, cells: Cells) -> _Turtle:
    """Build a cell if there is room for it; where the turtle is then."""
    phase = (tissue.phase + module.phase + turtle.later) % 1.0
    tissue = replace(tissue, phase=phase)
    if turtle.cell < 0:
        return replace(turtle, cell=cells.seed(tissue, module.size))
    grown = cells.grow(turtle.cell, turtle.side, tissue, module.size, turtle.turn, taper=0.95)
    if grown is None:
        return turtle
    return replace(turtle, cell=grown, side=TIP, turn=(0.0, 0.0, 0.0))


def _closing(string: Sequence[Module], place: int) -> int:
    """Where the branch that begins at a place ends."""
    depth = 1
    for at in range(place, len(string)):
        depth += {OPEN: 1, TWIN: 1, CLOSE: -1}.get(string[at].symbol, 0)
        if depth == 0:
            return at
    return len(string)
