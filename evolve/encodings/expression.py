"""An expression: the rest length as a formula of place and time, grown by genetic programming."""

from __future__ import annotations

import random as standard_random
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from evolve.encodings.actuation import ActuationSettings, FixedBody
from evolve.encodings.base import EncodingSettings, ListGenomes

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ExpressionEncoding", "ExpressionSettings", "Formulas"]

CONSTANT = "constant"
OPERATIONS = {
    "add": (2, np.add),
    "subtract": (2, np.subtract),
    "multiply": (2, np.multiply),
    "smaller": (2, np.minimum),
    "larger": (2, np.maximum),
    "negative": (1, np.negative),
    "absolute": (1, np.abs),
    "sine": (1, lambda x: np.sin(np.pi * x)),
    "tanh": (1, np.tanh),
    "square": (1, np.square),
}
"""Name -> how many operands, and the function."""
VARIABLES = ("x", "y", "z", "r", "sin_wt", "cos_wt")
"""Place of the spring, its distance from the middle, and the time of the cycle."""
CODES = (*OPERATIONS, *VARIABLES, CONSTANT)
"""Everything a node can be; its place here is its code in a stored genome."""
SAMPLES = 24
"""Instants of a cycle at which a formula is evaluated."""


class Formulas(NamedTuple):
    """A genome: two formulas as flat lists of nodes, operators before their operands."""

    length: Any
    """The strain of the rest length, of place and time (a `deap.gp.PrimitiveTree`)."""
    stiffness: Any
    """The logarithm of the stiffness, of the place."""


class ExpressionSettings(ActuationSettings):
    """How large formulas may grow."""

    type: Literal["expression"] = "expression"
    nodes: int = Field(40, ge=3, le=200)
    """Most nodes of a formula."""
    harmonics: int = Field(3, ge=1, le=8)
    """How many harmonics of the formula's course in time the springs follow."""


class ExpressionEncoding(FixedBody, ListGenomes):
    """L0 = L (1 + amplitude tanh f(x, y, z, sin wt, cos wt)), k from tanh g(x, y, z).

    Trees are varied by `deap.gp` and evaluated as flat lists on a stack, for all springs and
    instants at once; the course in time becomes its first harmonics.
    """

    Settings: ClassVar[type[EncodingSettings]] = ExpressionSettings
    settings: ExpressionSettings

    def __init__(self, body: ws.Robot, settings: ExpressionSettings) -> None:
        super().__init__(body, settings)
        angle = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
        distance = np.linalg.norm(self.places, axis=1)
        columns = [*self.places.T[:, :, None], distance[:, None]]
        values = [*columns, np.sin(angle), np.cos(angle)]
        self._variables = dict(zip(VARIABLES, values, strict=True))

    def random(self, n: int, rng: np.random.Generator) -> list[Formulas]:
        """Grow n pairs of formulas of two to four levels."""
        with _seeded(rng):
            return [Formulas(_grown("length", 2, 4), _grown("stiffness", 1, 3)) for _ in range(n)]

    def mutate(self, genomes: Sequence[Formulas], rng: np.random.Generator) -> list[Formulas]:
        """Replace a branch, a node, or the constants of one of the two formulas of each genome."""
        with _seeded(rng):
            return [self._mutated(genome) for genome in genomes]

    def _mutated(self, genome: Formulas) -> Formulas:
        which = "length" if standard_random.random() < 0.75 else "stiffness"
        old = getattr(genome, which)
        for _ in range(8):
            tree = _copy(old)
            dice = standard_random.random()
            if dice < 0.45:
                _gp().mutUniform(tree, lambda pset, type_: _branch(pset), _primitives(which))
            elif dice < 0.7:
                _gp().mutNodeReplacement(tree, _primitives(which))
            else:
                self._shift_constants(tree)
            if len(tree) <= self.settings.nodes and _codes(tree) != _codes(old):
                return genome._replace(**{which: tree})
        return genome._replace(**{which: _grown(which, 1, 3)})

    def _shift_constants(self, tree: Any) -> None:
        for index, node in enumerate(tree):
            if _name(node) == CONSTANT:
                step = standard_random.gauss(0.0, 4.0 * self.settings.mutation_step)
                tree[index] = _constant(node.value + step)

    def cross(
        self, a: Sequence[Formulas], b: Sequence[Formulas], rng: np.random.Generator
    ) -> list[Formulas]:
        """Put a branch of b[i] into a[i], in both formulas."""
        with _seeded(rng):
            return [
                Formulas(*(self._crossed(*trees) for trees in zip(*pair, strict=True)))
                for pair in zip(a, b, strict=True)
            ]

    def _crossed(self, ours: Any, theirs: Any) -> Any:
        for _ in range(4):
            child, _ = _gp().cxOnePoint(_copy(ours), _copy(theirs))
            if len(child) <= self.settings.nodes:
                return child
        return _copy(ours)

    def express(self, genomes: Sequence[Formulas]) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        settings, n = self.settings, len(genomes)
        waves = np.empty((n, len(self.own), SAMPLES))
        stiffness = np.empty((n, len(self.own)))
        with np.errstate(all="ignore"):
            for i, genome in enumerate(genomes):
                waves[i] = self._evaluated(genome.length)
                stiffness[i] = np.broadcast_to(
                    self._evaluated(genome.stiffness), (len(self.own), 1)
                )[:, 0]
        spectrum = np.fft.rfft(np.tanh(np.nan_to_num(waves)), axis=2) / SAMPLES
        (low, high), amplitude = settings.rest_length, settings.amplitude
        rest = (1.0 + amplitude * spectrum[:, :, 0].real - low) / max(high - low, 1e-12)
        # A cosine with coefficient p and a sine with q: 2 (p cos - q' sin) of the complex c.
        swing, turn = 2.0 * np.abs(spectrum), np.angle(spectrum) / (2.0 * np.pi) + 0.25
        more = {}
        if settings.harmonics > 1:
            table = np.empty((n, self.body.n_springs, settings.harmonics - 1, 2))
            for order in range(2, settings.harmonics + 1):
                reach = amplitude * self.body.lengths
                table[:, :, order - 2, 0] = reach * self.spread(swing[:, :, order])
                phase = self.spread_phase(turn[:, :, order], order)
                table[:, :, order - 2, 1] = 2.0 * np.pi * phase
            more["harmonics"] = table
        stiff = 0.5 + 0.5 * np.tanh(np.nan_to_num(stiffness))
        return self.actuated(np.clip(rest, 0.0, 1.0), swing[:, :, 1], turn[:, :, 1], stiff, **more)

    def _evaluated(self, tree: Any) -> np.ndarray:
        """A formula at every spring and instant, (R, 1), (SAMPLES,) or (R, SAMPLES)."""
        stack: list[Any] = []
        for node in reversed(tree):
            name = _name(node)
            if name == CONSTANT:
                stack.append(np.float64(node.value))
            elif name in OPERATIONS:
                arity, function = OPERATIONS[name]
                stack.append(function(*(stack.pop() for _ in range(arity))))
            else:
                stack.append(self._variables[name])
        return stack.pop()

    def distance(self, a: Sequence[Formulas], b: Sequence[Formulas]) -> np.ndarray:
        """Share of the branches that the two do not have in common, shape (n,)."""
        return np.array(
            [
                np.mean([_apart(x, y) for x, y in zip(one, other, strict=True)])
                for one, other in zip(a, b, strict=True)
            ]
        )

    def to_bytes(self, genomes: Sequence[Formulas]) -> list[bytes]:
        """Every formula as the codes of its nodes, constants as little-endian float64."""
        return [b"".join(map(_packed, genome)) for genome in genomes]

    def from_bytes(self, blobs: Sequence[bytes]) -> list[Formulas]:
        """The genomes of which `to_bytes` made the blobs; ValueError for other bytes."""
        genomes = []
        for i, blob in enumerate(blobs):
            length, at = _unpacked(blob, 0, "length", i)
            stiffness, at = _unpacked(blob, at, "stiffness", i)
            if at != len(blob):
                raise ValueError(f"genome {i} has {len(blob)} bytes, {at} expected")
            genomes.append(Formulas(length, stiffness))
        return genomes


# Trees of deap.gp, whose nodes name themselves by CODES.


@cache
def _gp() -> Any:
    from deap import gp

    return gp


@cache
def _primitives(which: str) -> Any:
    """The set of nodes that a formula may have."""
    variables = VARIABLES if which == "length" else VARIABLES[:4]
    pset = _gp().PrimitiveSet(which, len(variables))
    pset.renameArguments(**{f"ARG{i}": name for i, name in enumerate(variables)})
    for name, (arity, function) in OPERATIONS.items():
        pset.addPrimitive(function, arity, name=name)
    pset.addEphemeralConstant(f"{CONSTANT}_{which}", _draw_constant)
    return pset


def _draw_constant() -> float:
    return standard_random.uniform(-2.0, 2.0)


def _constant(value: float) -> Any:
    return _gp().Terminal(float(value), False, object)


def _name(node: Any) -> str:
    """What a node is, one of CODES."""
    name = node.name if node.arity else node.value
    return name if isinstance(name, str) else CONSTANT


def _branch(pset: Any) -> list[Any]:
    return _gp().genFull(pset, 0, 2)


def _grown(which: str, low: int, high: int) -> Any:
    gp = _gp()
    return gp.PrimitiveTree(gp.genHalfAndHalf(_primitives(which), low, high))


def _copy(tree: Any) -> Any:
    return _gp().PrimitiveTree(list(tree))


def _codes(tree: Any) -> list[Any]:
    return [(_name(node), node.value if _name(node) == CONSTANT else None) for node in tree]


def _apart(one: Any, other: Any) -> float:
    """Jaccard distance of the branches of two trees, constants taken as alike."""
    ours, theirs = (
        Counter(
            tuple(_name(node) for node in tree[tree.searchSubtree(i)]) for i in range(len(tree))
        )
        for tree in (one, other)
    )
    return 1.0 - (ours & theirs).total() / (ours | theirs).total()


def _packed(tree: Any) -> bytes:
    names = [_name(node) for node in tree]
    constants = [node.value for node, name in zip(tree, names, strict=True) if name == CONSTANT]
    codes = bytes(CODES.index(name) for name in names)
    return struct.pack("<H", len(tree)) + codes + struct.pack(f"<{len(constants)}d", *constants)


def _unpacked(blob: bytes, at: int, which: str, genome: int) -> tuple[Any, int]:
    """A tree from its bytes, and where the next begins."""
    known = {arg.value: arg for arg in _primitives(which).terminals[object] if _is_variable(arg)}
    known |= {primitive.name: primitive for primitive in _primitives(which).primitives[object]}
    try:
        (count,) = struct.unpack_from("<H", blob, at)
        names = [CODES[code] for code in blob[at + 2 : at + 2 + count]]
        at += 2 + count
        constants = struct.unpack_from(f"<{names.count(CONSTANT)}d", blob, at)
        at += 8 * len(constants)
        values = iter(constants)
        nodes = [_constant(next(values)) if n == CONSTANT else known[n] for n in names]
    except (struct.error, IndexError, KeyError):
        raise ValueError(f"genome {genome}: these bytes are no formula of {which}") from None
    if len(nodes) != count or sum(node.arity - 1 for node in nodes) != -1:
        raise ValueError(f"genome {genome}: these bytes are no formula of {which}")
    return _gp().PrimitiveTree(nodes), at


def _is_variable(terminal: Any) -> bool:
    return isinstance(getattr(terminal, "value", None), str)


@contextmanager
def _seeded(rng: np.random.Generator) -> Iterator[None]:
    """Within, the standard generator that deap draws from is ours; outside, it is untouched."""
    state = standard_random.getstate()
    standard_random.seed(int(rng.integers(2**63)))
    try:
        yield
    finally:
        standard_random.setstate(state)
