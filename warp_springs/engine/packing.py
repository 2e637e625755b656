"""Robots laid end to end, and the flat arrays the kernels read, as pure NumPy functions."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warp_springs.body.elements import NONE, Elements
from warp_springs.body.variants import Variants
from warp_springs.engine.curve import ranges
from warp_springs.engine.element_packing import element_fields
from warp_springs.robot import Robot

if TYPE_CHECKING:
    from warp_springs.engine.merging import Union

__all__ = [
    "Strip",
    "breathes",
    "coefficients",
    "fastest_actuation",
    "largest",
    "largest_change",
    "local_frames",
    "longest_springs",
    "not_finite",
    "rests",
    "row_pairs",
    "sort_rows",
]

MASS_FIELDS = ("masses", "positions", "velocities")
SPRING_FIELDS = ("stiffness", "rest_length", "amplitude", "phase")
ALL_FIELDS = (*MASS_FIELDS, *SPRING_FIELDS, "omega")


@dataclass(frozen=True)
class Strip:
    """Robots that one kernel steps in bundles of one width, their arrays laid end to end.

    Attributes:
        ids: Index of each robot in the batch, shape (n,).
        masses: Number of masses of each robot, shape (n,).
        counts: Number of springs of each robot, shape (n,).
        springs: Ends of the springs, counted within the robot; of all robots (sum of counts, 2),
            or, where they share one topology, of one of them (S, 2).
        shared: Whether all robots share that topology.
        fields: Flat arrays over all masses or all springs, and ``omega`` (n,).
        elements: Elements whose structure all robots share; their values are in ``fields``.
        union: How robots of different topologies share bundles, if they do.
        bodies: The robots as they were given, or one of whose shape all are; not of a union.
    """

    ids: np.ndarray
    masses: np.ndarray
    counts: np.ndarray
    springs: np.ndarray
    shared: bool
    fields: dict[str, np.ndarray]
    elements: Elements = NONE
    union: Union | None = None
    bodies: Sequence[Robot] = ()

    @classmethod
    def stacked(
        cls,
        ids: np.ndarray,
        fields: dict[str, np.ndarray],
        body: Robot,
    ) -> Strip:
        """Robots of the topology and structure of a body, from arrays with axis 0 the robot."""
        n, masses = fields["masses"].shape
        flat = {name: values.reshape(-1, *values.shape[2:]) for name, values in fields.items()}
        counts = np.full(n, masses), np.full(n, body.n_springs)
        return cls(ids, *counts, body.springs, True, flat, body.elements, bodies=(body,))

    @classmethod
    def variants(cls, robots: Variants) -> Strip:
        """All variants of one body."""
        fields = {name: robots.array(name) for name in ALL_FIELDS}
        fields |= element_fields(robots, fields)
        body = robots[0]  # whose elements have the structure of all
        return cls.stacked(np.arange(len(robots)), fields, body)

    @classmethod
    def alike(cls, ids: Sequence[int], robots: Sequence[Robot]) -> Strip:
        """Robots of one topology and structure, from a list."""
        fields = {name: np.stack([getattr(r, name) for r in robots]) for name in ALL_FIELDS}
        fields |= element_fields(robots, fields)
        return cls.stacked(np.asarray(ids), fields, robots[0])

    @classmethod
    def ragged(cls, ids: Sequence[int], robots: Sequence[Robot]) -> Strip:
        """Robots of any topologies."""
        fields = {
            name: np.concatenate([getattr(robot, name) for robot in robots])
            for name in MASS_FIELDS + SPRING_FIELDS
        }
        fields["omega"] = np.array([robot.omega for robot in robots])
        masses = np.array([robot.n_masses for robot in robots])
        counts = np.array([robot.n_springs for robot in robots])
        springs = np.concatenate([robot.springs for robot in robots])
        return cls(np.asarray(ids), masses, counts, springs, False, fields, bodies=tuple(robots))

    def take(self, members: np.ndarray) -> Strip:
        """Some robots of a strip, in the order of `members`."""
        if len(members) == len(self.ids) and (np.diff(members) > 0).all():
            return self
        if not self.shared:
            return self._take_ragged(members)
        n, masses, counts = len(self.ids), self.masses[members], self.counts[members]
        fields = {
            name: values.reshape(n, -1, *values.shape[1:])[members].reshape(-1, *values.shape[1:])
            for name, values in self.fields.items()
        }
        ids = self.ids[members]
        return replace(self, ids=ids, masses=masses, counts=counts, fields=fields)

    def _take_ragged(self, members: np.ndarray) -> Strip:
        masses, counts = self.masses[members], self.counts[members]
        of_mass = ranges((np.cumsum(self.masses) - self.masses)[members], masses)
        of_spring = ranges((np.cumsum(self.counts) - self.counts)[members], counts)
        fields = {name: self.fields[name][of_mass] for name in MASS_FIELDS}
        fields |= {name: self.fields[name][of_spring] for name in SPRING_FIELDS}
        fields["omega"] = self.fields["omega"][members]
        bodies = tuple(self.bodies[i] for i in members.tolist())
        springs = self.springs[of_spring]
        return Strip(self.ids[members], masses, counts, springs, False, fields, bodies=bodies)

    @functools.cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the springs of all robots, counted over the masses of all robots."""
        first = np.repeat(np.cumsum(self.masses) - self.masses, self.counts)
        springs = self.all_springs
        return springs[:, 0] + first, springs[:, 1] + first

    @property
    def all_springs(self) -> np.ndarray:
        """Ends of the springs of all robots, counted within the robot, (sum of counts, 2)."""
        return np.tile(self.springs, (len(self.ids), 1)) if self.shared else self.springs


def sort_rows(strip: Strip) -> tuple[np.ndarray | slice, np.ndarray, np.ndarray]:
    """Springs in rows by their lower mass, in each row by the higher one.

    Returns:
        ``order``: all springs of all robots, sorted into rows, robot by robot; a slice if they are;
        ``row``: for each topology its M + 1 row starts, counted from 0;
        ``partner``: for each topology the higher mass of each sorted spring.
    """
    if not strip.shared:
        return _sorted_rows(strip.masses, strip.counts, strip.springs)
    order, row, partner = _rows_of_one(
        int(strip.masses[0]), strip.springs.shape, strip.springs.tobytes()
    )
    if isinstance(order, np.ndarray):
        order = (order + np.arange(len(strip.ids))[:, None] * len(order)).ravel()
    return order, row, partner


@functools.lru_cache(maxsize=64)
def _rows_of_one(
    masses: int, shape: tuple[int, int], springs: bytes
) -> tuple[np.ndarray | slice, np.ndarray, np.ndarray]:
    """The rows of one topology, which many generations of robots have."""
    found = np.frombuffer(springs, np.int32).reshape(shape)
    return _sorted_rows(np.array([masses]), np.array([len(found)]), found)


def _sorted_rows(
    masses: np.ndarray, counts: np.ndarray, springs: np.ndarray
) -> tuple[np.ndarray | slice, np.ndarray, np.ndarray]:
    """As `sort_rows`, of robots end to end with so many masses and springs each."""
    mass_start, spring_start = np.cumsum(masses) - masses, np.cumsum(counts) - counts
    lower = np.minimum(*springs.T) + np.repeat(mass_start, counts)
    higher = np.maximum(*springs.T)
    step, along = np.diff(lower), np.diff(higher)
    in_rows = ((step > 0) | ((step == 0) & (along >= 0))).all()  # as the shapes make them
    order = slice(None) if in_rows else np.lexsort((higher, lower))
    partner = higher[order]

    ends = np.cumsum(np.bincount(lower, minlength=masses.sum()))  # where the row of a mass ends
    row = np.zeros((masses + 1).sum(), np.int64)
    inner = np.ones(len(row), bool)
    inner[mass_start + np.arange(len(masses))] = False
    row[inner] = ends - np.repeat(spring_start, masses)
    return order, row.astype(np.int32), partner.astype(np.int32)


def row_pairs(row: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """How two rows at a time share their partners: what ``kernels.lanes`` steps through.

    For the masses 0 and 1, 2 and 3, ... of one topology: a number of runs, and for each run how
    many springs of the first mass alone, of both masses to the same partners, and of the second
    mass alone follow each other. Springs between the two masses come first and are not counted.
    """
    return np.frombuffer(_pairs(row.tobytes(), partner.tobytes()), np.int32)


@functools.lru_cache(maxsize=64)
def _pairs(row: bytes, partner: bytes) -> bytes:
    """As `row_pairs`, of int32: those of a topology are the same in many generations."""
    code: list[int] = []
    ends, partners = (
        np.frombuffer(row, np.int32).tolist(),
        np.frombuffer(partner, np.int32).tolist(),
    )
    rows = [partners[a:b] for a, b in itertools.pairwise(ends)]
    for i in range(0, len(rows) - 1, 2):
        first, second = [j for j in rows[i] if j != i + 1], rows[i + 1]
        kinds, a, b = [], 0, 0
        while a < len(first) or b < len(second):
            of_first, of_second = _at(first, a), _at(second, b)
            # Of several springs to one partner the last is shared: all of the first row come first.
            kind = 2 if of_first > of_second else int(of_first == of_second != _at(first, a + 1))
            kinds.append(kind)
            a, b = a + (kind < 2), b + (kind > 0)
        runs = []
        for at, kind in enumerate(kinds):
            if at == 0 or kind < kinds[at - 1]:
                runs.append([0, 0, 0])
            runs[-1][kind] += 1
        code += [len(runs), *itertools.chain.from_iterable(runs)]
    return np.array(code, np.int32).tobytes()


def _at(values: Sequence[int], index: int) -> float:
    return values[index] if index < len(values) else math.inf


def coefficients(
    fields: dict[str, np.ndarray], order: np.ndarray | slice, actuated: bool
) -> np.ndarray:
    """Coefficients of the sorted springs: k and h = k L0 / 2, shape (total, 2), or, if they
    breathe, k, ha, hs, hc with h(t) = ha + hs sin(wt) + hc cos(wt), shape (total, 4).

    From L0(t) = a + b sin(wt + c) = a + (b cos c) sin(wt) + (b sin c) cos(wt). The half belongs to
    the Newton step of the inverse square root, see ``kernels.law``.
    """
    k = fields["stiffness"][order]
    table = np.empty((4 if actuated else 2, len(k))).T  # each column in one piece
    table[:, 0] = k
    half = 0.5 * k
    np.multiply(half, fields["rest_length"][order], out=table[:, 1])
    if actuated:
        kb = half * fields["amplitude"][order]
        # cos c and sin c by the tangent of half the angle, which NumPy computes in vectors: a tenth
        # of the time, the same to the last bit or two.
        t = 0.5 * fields["phase"][order]
        np.tan(t, out=t)
        square = t * t
        kb /= 1.0 + square
        np.subtract(1.0, square, out=square)
        np.multiply(kb, square, out=table[:, 2])
        t *= 2.0
        np.multiply(kb, t, out=table[:, 3])
    return table


def local_frames(strip: Strip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions about an origin near each robot, for mixed precision.

    The origin is a multiple of the robot's quantum, a power of two no smaller than the robot, in
    which the origin follows it later.

    Returns:
        Origins [m], shape (n, 3); quanta [m], (n,); and local positions [m], (total masses, 3).
    """
    positions, start = strip.fields["positions"], np.cumsum(strip.masses) - strip.masses
    center = np.add.reduceat(positions, start) / strip.masses[:, None]
    way = np.abs(positions - np.repeat(center, strip.masses, axis=0)).max(axis=1)
    size = np.clip(2.0 * largest(np.nan_to_num(way), strip.masses), 2.0**-40, 2.0**60)
    quanta = 2.0 ** np.ceil(np.log2(size))
    origins = np.nan_to_num(np.rint(center / quanta[:, None]) * quanta[:, None])
    return origins, quanta, positions - np.repeat(origins, strip.masses, axis=0)


def rests(values: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """What values lose when they are rounded to ``dtype``."""
    return values - values.astype(dtype)


def longest_springs(strip: Strip) -> np.ndarray:
    """The longest each robot's springs are meant to be [m], shape (n,); 0 without springs.

    The largest of the initial lengths and of the rest lengths plus amplitudes.
    """
    fields = strip.fields
    meant = largest_change(fields)
    meant += fields["rest_length"]
    meant = largest(meant, strip.counts)
    positions, counts, springs = fields["positions"], strip.counts, strip.springs
    if strip.shared:
        poses = positions.reshape(len(counts), -1, 3)
        if (poses == poses[0]).all():  # the controllers of one body
            counts = counts[:1]
        else:
            springs = strip.all_springs
    masses = strip.masses[: len(counts)]
    first_mass = np.repeat(np.cumsum(masses) - masses, counts)
    start, end = springs.T.astype(np.intp) + first_mass
    d = positions.take(end, axis=0)
    d -= positions.take(start, axis=0)
    return np.maximum(np.sqrt(largest(np.einsum("ij,ij->i", d, d), counts)), meant)


def largest_change(fields: dict[str, np.ndarray]) -> np.ndarray:
    """The most that actuation and winches add to the rest length of each spring [m]."""
    change = np.abs(fields["amplitude"])
    if "harmonics" in fields:
        change = change + np.abs(fields["harmonics"][..., 0]).sum(axis=-1)
    if "offsets" in fields:
        change = change + np.abs(fields["offsets"]).max(axis=-1)
    return change


def fastest_actuation(strip: Strip) -> np.ndarray:
    """The largest angular frequency of each robot's springs, harmonics too [rad/s], shape (n,)."""
    omega = np.abs(strip.fields["omega"])
    if "omegas" in strip.fields:
        own = np.nan_to_num(np.abs(strip.fields["omegas"]), nan=0.0)
        omega = np.maximum(omega, largest(own, strip.counts))
    harmonics = strip.fields.get("harmonics")
    return omega * (1 if harmonics is None else harmonics.shape[1] + 1)


def breathes(strip: Strip) -> np.ndarray:
    """Whether a robot has springs that oscillate, shape (n,) bool."""
    size = np.abs(strip.fields["amplitude"])
    if "harmonics" in strip.fields:
        size = size + np.abs(strip.fields["harmonics"][..., 0]).sum(axis=-1)
    return largest(size, strip.counts) > 0.0


def largest(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The largest of each run of ``counts`` non-negative values; 0 for an empty run."""
    if len(counts) and (counts == counts[0]).all():  # as of robots of one topology
        return values.reshape(len(counts), counts[0]).max(axis=1, initial=0).astype(np.float64)
    found = np.zeros(len(counts))
    some = counts > 0
    if some.any():
        found[some] = np.maximum.reduceat(values, (np.cumsum(counts) - counts)[some])
    return found


def not_finite(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Robots with an infinity or a NaN in their ``counts`` rows of ``values``, shape (n,) bool."""
    if np.isfinite(values.sum()):  # as it is of numbers that are all finite, if none is immense
        return np.zeros(len(counts), bool)
    good = np.isfinite(values)
    rows = ~good.reshape(len(values), -1).all(axis=1)
    return largest(rows.astype(float), counts) > 0.0
