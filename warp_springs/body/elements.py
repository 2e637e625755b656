"""What a robot may have beyond masses and plain springs; a robot without it pays nothing."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.bonds import Bonds
from warp_springs.body.control import Controller
from warp_springs.geometry import FloatArray

__all__ = ["NEUTRAL", "NONE", "PER_MASS", "PER_SPRING", "Elements", "Push", "Tether", "Timetable"]

#: Arrays with a row for each spring: shape of a row (None: any), neutral value, smallest value.
PER_SPRING: dict[str, tuple[tuple[int | None, ...], float, float]] = {
    "harmonics": ((None, 2), 0.0, -math.inf),
    "omegas": ((), math.nan, -math.inf),  # what is neutral is the robot's own omega
    "cubic": ((), 0.0, 0.0),
    "slope": ((), 1.0, 0.0),
    "hinges": ((None, 2), 0.0, -math.inf),
    "dashpot": ((), 0.0, 0.0),
    "breaks": ((), math.inf, 0.0),
    "yields": ((), math.inf, 0.0),
}
#: The same with a row for each mass; NaN is neutral and allowed.
PER_MASS = {"contact": ((3,), math.nan, 0.0)}
NEUTRAL = {name: neutral for name, (_, neutral, _) in (PER_SPRING | PER_MASS).items()}


@dataclass(frozen=True)
class Push:
    """A force on some masses during a window of time.

    Attributes:
        masses: Indices of the masses; each of them feels the whole force.
        force: Force [N], shape (3,).
        start: When it begins [s].
        end: When it ends [s]; may be infinite. Its impulse is force * (end - start) for every dt.
    """

    masses: tuple[int, ...]
    force: tuple[float, float, float]
    start: float = 0.0
    end: float = math.inf


@dataclass(frozen=True)
class Tether:
    """A temporary spring between a mass and a point in space: a soft constraint.

    Attributes:
        mass: Index of the mass.
        point: The point [m], shape (3,).
        stiffness: [N/m].
        rest_length: [m].
        start: When it appears [s].
        end: When it vanishes [s]; may be infinite.
    """

    mass: int
    point: tuple[float, float, float]
    stiffness: float
    rest_length: float = 0.0
    start: float = 0.0
    end: float = math.inf


@dataclass(frozen=True, eq=False)
class Timetable:
    """Springs that change in time: piecewise linear between the times, constant outside.

    Attributes:
        times: Increasing times [s], shape (T,).
        factors: Factor of the stiffness of each spring, not negative, shape (S, T).
        offsets: What is added to each rest length [m], shape (S, T).
        period: After so many seconds the table begins again [s]; 0: never.
    """

    times: FloatArray
    factors: FloatArray
    offsets: FloatArray
    period: float = 0.0

    def at(self, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Factors and offsets at a time, shape (S,), or at times (F,), shape (F, S)."""
        t = np.asarray(t, np.float64)
        t = np.mod(t, self.period) if self.period else t
        index = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        step = self.times[index + 1] - self.times[index]
        part = np.clip((t - self.times[index]) / step, 0.0, 1.0)[..., None]
        tables = [np.moveaxis(table, 0, -1) for table in (self.factors, self.offsets)]
        factors, offsets = ((1 - part) * table[index] + part * table[index + 1] for table in tables)
        return factors, offsets


@dataclass(frozen=True, eq=False)
class Elements:
    """The elements of one robot: made by its verbs (`Robot.with_cables`, `Robot.pushed`, ...).

    Arrays are read-only float64; what a robot lacks is ``None`` or empty, and not compiled in.

    Attributes:
        harmonics: Amplitude [m] and phase [rad] of the harmonics 2, 3, ... of the rest length,
            shape (S, H, 2).
        omegas: Angular frequency of each spring [rad/s], shape (S,); NaN: the robot's.
        cubic: Cubic stiffness k3 [N/m^3], shape (S,): tension k s + k3 s^3 at a stretch s.
        slope: Stiffness below the first hinge, as a part of k, shape (S,).
        hinges: Stretch [m] at which the stiffness changes, and by which part of k, shape
            (S, J, 2).
        dashpot: Damping of each spring as a part of critical damping, shape (S,): a force
            2 ratio sqrt(k m) times the speed of stretching, 1/m = 1/m_i + 1/m_j.
        breaks: Tension or compression [N] at which a spring breaks, shape (S,); inf: never.
        yields: Tension or compression [N] that a spring does not exceed: it flows instead, and
            its rest length changes for good, shape (S,); inf: never.
        timetable: Stiffness and rest length in time, or ``None``.
        contact: Static and kinetic friction and stiffness [N/m] that each mass brings to every
            surface in place of the surface's own, shape (M, 3); NaN: the surface's own.
        pushes: Forces in windows of time.
        tethers: Temporary springs to points.
        bonds: Masses that are fixed or held to a plane, a line, a circle or a sphere.
        controllers: Closed loops that set rest lengths; see `Robot.controlled`.
    """

    harmonics: FloatArray | None = None
    omegas: FloatArray | None = None
    cubic: FloatArray | None = None
    slope: FloatArray | None = None
    hinges: FloatArray | None = None
    dashpot: FloatArray | None = None
    breaks: FloatArray | None = None
    yields: FloatArray | None = None
    timetable: Timetable | None = None
    contact: FloatArray | None = None
    pushes: tuple[Push, ...] = ()
    tethers: tuple[Tether, ...] = ()
    bonds: Bonds = field(default_factory=Bonds)
    controllers: tuple[Controller, ...] = ()

    @property
    def arrays(self) -> dict[str, FloatArray]:
        """The arrays with a row for each spring or mass that the robot has."""
        names = (*PER_SPRING, *PER_MASS)
        found = {name: getattr(self, name) for name in names}
        return {name: value for name, value in found.items() if value is not None}

    def replace(self, **changes: Any) -> Elements:
        """The same elements with some replaced."""
        return replace(self, **changes)

    def check(self, masses: int, springs: int) -> None:
        """Refuse, with a ValueError, elements that do not fit a body of so many of each."""
        for name, value in self.arrays.items():
            check_rows(name, value, springs if name in PER_SPRING else masses)
        table = self.timetable
        if table is not None and table.factors.shape[0] != springs:
            raise ValueError(f"timetable: {len(table.factors)} springs given, {springs} expected")
        for controller in self.controllers:
            controller.check(masses, springs)
        used = [i for push in self.pushes for i in push.masses] + [t.mass for t in self.tethers]
        used += self.bonds.masses.tolist()
        for index in used:
            if not 0 <= index < masses:
                raise ValueError(f"elements: mass {index} named, there are {masses} masses")

    @cached_property
    def structure(self) -> bytes:
        """Key of all that robots which are stepped together must have in common."""
        if self is NONE:
            return b""  # so that plain robots cost nothing
        table = self.timetable
        parts = [(name, value.shape[1:]) for name, value in self.arrays.items()]
        parts += [push.masses for push in self.pushes], [t.mass for t in self.tethers]
        parts += [self.bonds.masses.tolist()]
        parts += [None if table is None else (table.times.tobytes(), table.period)]
        return hashlib.blake2b(repr(parts).encode(), digest_size=16).digest()

    @cached_property
    def _values(self) -> tuple:
        table = self.timetable
        timed = () if table is None else (table.times, table.factors, table.offsets)
        arrays = (*self.arrays.items(), *enumerate(timed), *enumerate(self.bonds.arrays))
        lists = (self.pushes, self.tethers, self.controllers, table.period if table else None)
        return (*((name, value.shape, (value + 0.0).tobytes()) for name, value in arrays), lists)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Elements) and self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    # -- with the body ------------------------------------------------------------------------

    def moved(self, offset: FloatArray) -> Elements:
        """Where the body goes, its bonds and tethers go."""
        tethers = tuple(
            replace(t, point=tuple((np.asarray(t.point) + offset).tolist())) for t in self.tethers
        )
        return self.replace(tethers=tethers, bonds=self.bonds.moved(offset))

    def turned(self, turn: FloatArray, centre: FloatArray) -> Elements:
        """Bonds, tethers and forces turned with the body about a centre (3,) by a matrix (3, 3)."""

        def turned(point: tuple, about: FloatArray) -> tuple:
            return tuple((about + turn @ (np.asarray(point) - about)).tolist())

        return self.replace(
            tethers=tuple(replace(t, point=turned(t.point, centre)) for t in self.tethers),
            pushes=tuple(replace(p, force=turned(p.force, np.zeros(3))) for p in self.pushes),
            bonds=self.bonds.turned(turn, centre),
        )

    def scaled(self, factor: float) -> Elements:
        """All lengths multiplied by a factor, about the origin; stiffness and forces stay."""
        changes: dict[str, Any] = {"bonds": self.bonds.scaled(factor)}
        for name in ("harmonics", "hinges"):
            value = getattr(self, name)
            if value is not None:
                column = 0  # amplitude of a harmonic, stretch of a hinge
                scaled = value.copy()
                scaled[..., column] *= factor
                changes[name] = frozen(scaled)
        if self.timetable is not None:
            offsets = frozen(self.timetable.offsets * factor)
            changes["timetable"] = replace(self.timetable, offsets=offsets)
        changes["tethers"] = tuple(
            replace(
                t,
                point=tuple((np.asarray(t.point) * factor).tolist()),
                rest_length=t.rest_length * factor,
            )
            for t in self.tethers
        )
        return self.replace(**changes)

    def __repr__(self) -> str:
        present = [f.name for f in fields(self) if _has(getattr(self, f.name))]
        return f"Elements({', '.join(present)})"


def _has(value: Any) -> bool:
    return value is not None and len(getattr(value, "masses", value if _sized(value) else "x")) > 0


def _sized(value: Any) -> bool:
    return hasattr(value, "__len__")


def frozen(values: ArrayLike) -> FloatArray:
    """A read-only float64 copy."""
    array = np.array(values, np.float64)
    array.flags.writeable = False
    return array


def check_rows(name: str, value: FloatArray, rows: int | None, leading: int = 1) -> None:
    """Refuse an array of an element whose shape or values are malformed, with a ValueError.

    ``leading`` axes come before those of a row; the last of them has ``rows`` entries.
    """
    row, neutral, least = (PER_SPRING | PER_MASS)[name]
    fits = value.ndim == leading + len(row) and (rows is None or value.shape[leading - 1] == rows)
    fits = fits and all(
        n is None or n == m for n, m in zip(row, value.shape[leading:], strict=False)
    )
    if not fits:
        wanted = ("any" if rows is None else rows, *("any" if n is None else n for n in row))
        raise ValueError(f"{name}: shape {value.shape} given, rows of {wanted} expected")
    with np.errstate(invalid="ignore"):
        good = (value >= least) & np.isfinite(value)
    if not math.isfinite(neutral):
        good |= np.isnan(value) if math.isnan(neutral) else value == neutral
    if name in ("breaks", "yields"):
        good &= value > 0.0
    if not good.all():
        at = tuple(int(i) for i in np.argwhere(~good)[0])
        place = f"{name}[{', '.join(map(str, at))}]"
        allowed = "greater than 0" if name in ("breaks", "yields") else f"finite and >= {least:g}"
        raise ValueError(f"{place} = {value[at]}: must be {allowed}")


NONE = Elements()
"""The elements of a robot that has none."""


def spread(elements: Elements, name: str, rows: int, like: Mapping[str, int] | None = None):
    """The array of an element, or a neutral one of so many rows; ``like`` gives free sizes."""
    value = getattr(elements, name)
    if value is not None:
        return value
    row = (PER_SPRING | PER_MASS)[name][0]
    shape = tuple((like or {}).get(name, 0) if n is None else n for n in row)
    return np.full((rows, *shape), NEUTRAL[name])


def join_elements(
    first: Elements, second: Elements, counts: tuple[int, int], index: np.ndarray, **how: Any
) -> Elements:
    """The elements of two bodies as one body's.

    Args:
        first: Of the body whose masses and springs come first.
        second: Of the other.
        counts: Springs of each.
        index: Which mass of the whole each mass of the second is.
        how: ``keep`` of the springs laid end to end, ``masses`` of the first, ``fresh`` masses of
            the second that are not also the first's, shape (M2,) bool.

    Raises:
        ValueError: Both have timetables and their periods differ.
    """
    if first is NONE and second is NONE:
        return NONE
    keep, n_first, fresh = how["keep"], how["masses"], how["fresh"]
    changes: dict[str, Any] = {}
    for name in first.arrays | second.arrays:
        if name in PER_SPRING:
            parts = _padded(name, first, second, counts)
            changes[name] = frozen(np.concatenate(parts)[keep])
        else:
            ours, theirs = spread(first, name, n_first), spread(second, name, len(index))
            changes[name] = frozen(np.concatenate([ours, theirs[fresh]]))
    changes["timetable"] = _joined_tables(first, second, counts, keep)
    moved = [replace(p, masses=tuple(index[list(p.masses)].tolist())) for p in second.pushes]
    changes["pushes"] = (*first.pushes, *moved)
    moved_tethers = [replace(t, mass=int(index[t.mass])) for t in second.tethers]
    changes["tethers"] = (*first.tethers, *moved_tethers)
    changes["bonds"] = first.bonds.joined(second.bonds.renamed(index))
    changes["controllers"] = _joined_controllers(first, second, counts, index, **how)
    return Elements(**changes)


def _joined_controllers(first, second, counts, index, keep, masses, fresh) -> tuple:
    """The controllers of both, by the numbers of masses and springs in the whole."""
    place = np.full(sum(counts), -1)
    kept = np.arange(sum(counts))[keep]
    place[kept] = np.arange(len(kept))
    whole = masses + int(fresh.sum())
    ours = [c.renamed(np.arange(masses), place[: counts[0]], whole) for c in first.controllers]
    theirs = [c.renamed(index, place[counts[0] :], whole) for c in second.controllers]
    return (*ours, *theirs)


def _padded(name: str, first: Elements, second: Elements, counts: tuple[int, int]) -> list:
    """The arrays of both, with as many harmonics or hinges a spring."""
    given = [getattr(e, name) for e in (first, second)]
    sizes = [value.shape[1] for value in given if value is not None and value.ndim == 3]
    widest = {name: max(sizes, default=0)}
    parts = []
    for elements, rows in zip((first, second), counts, strict=True):
        part = spread(elements, name, rows, widest)
        if part.ndim == 3 and part.shape[1] < widest[name]:
            part = np.pad(part, ((0, 0), (0, widest[name] - part.shape[1]), (0, 0)))
        parts.append(part)
    return parts


def _joined_tables(first, second, counts, keep) -> Timetable | None:
    tables = [first.timetable, second.timetable]
    present = [table for table in tables if table is not None]
    if not present:
        return None
    if len({table.period for table in present}) > 1:
        raise ValueError("timetable: joined robots must share one period")
    times = np.unique(np.concatenate([table.times for table in present]))
    factors, offsets = [], []
    for table, n in zip(tables, counts, strict=True):
        factors.append(np.ones((n, len(times))) if table is None else table.at(times)[0].T)
        offsets.append(np.zeros((n, len(times))) if table is None else table.at(times)[1].T)
    return Timetable(
        frozen(times),
        frozen(np.concatenate(factors)[keep]),
        frozen(np.concatenate(offsets)[keep]),
        present[0].period,
    )
