"""Morphology: bodies of masses and springs, varied directly by operators."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.bodies.build import fits, planned, robot
from evolve.bodies.operators import BODY, CONTROL, crossed, varied
from evolve.bodies.plan import PHASE, Plan, tidied
from evolve.encodings.base import EncodingSettings, ListGenomes
from evolve.encodings.evolving import BodySettings, EvolvingBody

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["MorphologyEncoding", "MorphologySettings"]

HEADER = struct.Struct("<3H")
"""Numbers of masses, springs and faces."""


class MorphologySettings(BodySettings):
    """How often body and behaviour change."""

    type: Literal["morphology"] = "morphology"
    first_changes: int = Field(12, ge=0)
    """Operators that are applied to the body of the configuration to make a first one."""
    body_rate: float = Field(0.3, ge=0.0, le=1.0)
    """Share of the mutations that change the body; the others leave it time to learn."""
    changes: int = Field(3, ge=1)
    """Most operators of one mutation."""


class MorphologyEncoding(EvolvingBody, ListGenomes):
    """A genome is a plan: every mass, spring and face, with the genes of every spring.

    All descend from one body by the operators of `evolve.bodies.operators`. Whatever these do, a
    genome is always one connected body within the limits.
    """

    Settings: ClassVar[type[EncodingSettings]] = MorphologySettings
    needs_body: ClassVar[bool] = True

    def __init__(self, body: ws.Robot, settings: MorphologySettings) -> None:
        self.settings = settings
        self.ancestor = tidied(planned(body))
        self._fits = partial(fits, settings=settings)
        if not self._fits(self.ancestor):
            plan = self.ancestor
            raise ValueError(
                f"body: what holds together of it has {plan.n_masses} masses, {plan.n_springs} "
                f"springs and an extent of {plan.extent:.3g} m; evolved bodies have 4 to "
                f"{settings.most_masses} masses, 6 to {settings.most_springs} springs and at most "
                f"{settings.largest_extent:g} m"
            )

    def random(self, n: int, rng: np.random.Generator) -> list[Plan]:
        """Make n descendants of the ancestor with springs of random genes, in smooth patches."""
        return [self._first(rng) for _ in range(n)]

    def _first(self, rng: np.random.Generator) -> Plan:
        plan = self.ancestor
        middles = plan.positions[plan.springs].mean(axis=1) / max(plan.extent, 1e-9)
        genes = 0.5 + 0.5 * np.sin(middles @ rng.normal(0.0, 4.0, (3, 4)) + 6.3 * rng.random(4))
        genes[:, PHASE] = middles @ rng.normal(0.0, 0.5, 3) + rng.random()
        genes[:, PHASE] -= np.floor(genes[:, PHASE])
        plan = Plan(plan.positions, plan.shares, plan.springs, genes.astype(np.float32), plan.faces)
        for _ in range(self.settings.first_changes):
            plan = varied(plan, BODY, self._fits, rng)
        return plan

    def mutate(self, genomes: Sequence[Plan], rng: np.random.Generator) -> list[Plan]:
        """Apply a few operators to every body, or to its springs alone."""
        return [self._mutated(genome, rng, self.settings.body_rate) for genome in genomes]

    def tune(self, genomes: Sequence[Plan], rng: np.random.Generator) -> list[Plan]:
        """Apply a few operators to the springs of every body."""
        return [self._mutated(genome, rng, body_rate=0.0) for genome in genomes]

    def _mutated(self, plan: Plan, rng: np.random.Generator, body_rate: float) -> Plan:
        changes = rng.integers(1, self.settings.changes + 1)
        if rng.random() < body_rate:
            plan, changes = varied(plan, BODY, self._fits, rng), changes - 1
        for _ in range(changes):
            plan = varied(plan, CONTROL, self._fits, rng)
        return plan

    def cross(self, a: Sequence[Plan], b: Sequence[Plan], rng: np.random.Generator) -> list[Plan]:
        """Join what lies on one side of a plane of a[i] to what lies on the other of b[i].

        As often as the body rate says; otherwise, and where both have the same springs, those of
        a[i] on one side of a plane take the genes of springs in the same place of b[i].
        """
        return [self._crossed(*pair, rng) for pair in zip(a, b, strict=True)]

    def _crossed(self, one: Plan, other: Plan, rng: np.random.Generator) -> Plan:
        same = np.array_equal(one.springs, other.springs)
        if same or rng.random() >= self.settings.body_rate:
            return _taught(one, other, same, rng)
        return varied(one, (lambda plan, r: crossed(plan, other, r),), self._fits, rng, 4)

    def express(self, genomes: Sequence[Plan]) -> list[ws.Robot]:
        """Build the robots."""
        return [robot(genome, self.settings) for genome in genomes]

    def distance(self, a: Sequence[Plan], b: Sequence[Plan]) -> np.ndarray:
        """How little the springs of two bodies coincide, and how differently they behave, (n,)."""
        return np.array([_apart(one, other) for one, other in zip(a, b, strict=True)])

    def to_bytes(self, genomes: Sequence[Plan]) -> list[bytes]:
        """The three counts, then places, weights, springs, genes and faces, little-endian."""
        return [
            HEADER.pack(genome.n_masses, genome.n_springs, len(genome.faces))
            + b"".join(
                np.ascontiguousarray(array, dtype).tobytes()
                for array, dtype in zip(_arrays(genome), _DTYPES, strict=True)
            )
            for genome in genomes
        ]

    def from_bytes(self, blobs: Sequence[bytes]) -> list[Plan]:
        """The genomes of which `to_bytes` made the blobs; ValueError for other bytes."""
        return [_unpacked(blob, i) for i, blob in enumerate(blobs)]


_DTYPES = ("<f4", "<f4", "<u2", "<f4", "<u2")


def _arrays(plan: Plan) -> tuple[np.ndarray, ...]:
    return plan.positions, plan.shares, plan.springs, plan.genes, plan.faces


def _unpacked(blob: bytes, genome: int) -> Plan:
    if len(blob) < HEADER.size:
        raise ValueError(f"genome {genome} has {len(blob)} bytes, {HEADER.size} or more expected")
    masses, springs, faces = HEADER.unpack_from(blob)
    shapes = ((masses, 3), (masses,), (springs, 2), (springs, 4), (faces, 3))
    sizes = [int(np.prod(s)) * int(t[-1]) for s, t in zip(shapes, _DTYPES, strict=True)]
    if len(blob) != HEADER.size + sum(sizes):
        raise ValueError(
            f"genome {genome} has {len(blob)} bytes, {HEADER.size + sum(sizes)} expected of "
            f"{masses} masses, {springs} springs and {faces} faces"
        )
    arrays, at = [], HEADER.size
    for shape, size, dtype in zip(shapes, sizes, _DTYPES, strict=True):
        kind = np.float32 if dtype == "<f4" else np.int32
        arrays.append(np.frombuffer(blob[at : at + size], dtype).astype(kind).reshape(shape))
        at += size
    return Plan(*arrays)


def _apart(one: Plan, other: Plan) -> float:
    """Mean of what their springs have not in common: places, then genes of those in common."""
    size = max(one.extent, other.extent, 1e-9)
    (ours, genes), (theirs, others) = (_keyed(plan, size) for plan in (one, other))
    common, here, there = np.intersect1d(ours, theirs, assume_unique=True, return_indices=True)
    shape = 1.0 - len(common) / max(len(ours) + len(theirs) - len(common), 1)
    if not len(common):
        return shape
    gap = np.abs(genes[here] - others[there])
    gap[:, PHASE] = 2.0 * np.minimum(gap[:, PHASE], 1.0 - gap[:, PHASE])
    return shape + (1.0 - shape) * min(float(2.0 * gap.mean()), 1.0)


def _taught(one: Plan, other: Plan, same: bool, rng: np.random.Generator) -> Plan:
    """A plan whose springs on one side of a plane do what those of another do in their place."""
    middles = one.positions[one.springs].mean(axis=1)
    along = middles @ rng.standard_normal(3)
    beyond = along > along[rng.integers(len(along))]
    theirs = np.arange(one.n_springs)
    if not same:
        size = max(one.extent, other.extent, 1e-9)
        keys, places, others = _cells(one, size), *np.unique(_cells(other, size), return_index=True)
        found = np.minimum(np.searchsorted(places, keys), len(places) - 1)
        beyond &= places[found] == keys
        theirs = others[found]
    genes = np.where(beyond[:, None], other.genes[theirs], one.genes)
    return Plan(one.positions, one.shares, one.springs, genes, one.faces)


def _keyed(plan: Plan, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Where springs are, on a grid of a tenth of the size, as different numbers; their genes."""
    code, first = np.unique(_cells(plan, size), return_index=True)
    return code, plan.genes[first].astype(np.float64)


def _cells(plan: Plan, size: float) -> np.ndarray:
    """Numbers of the cells of that grid in which the middles of springs are, shape (S,)."""
    places = plan.positions - [*plan.positions[:, :2].mean(axis=0), plan.positions[:, 2].min()]
    middles = np.floor(places[plan.springs].mean(axis=1) / (0.1 * size)).astype(np.int64) + 512
    return (middles[:, 0] * 1024 + middles[:, 1]) * 1024 + middles[:, 2]
