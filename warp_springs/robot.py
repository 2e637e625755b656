"""Robot: masses, springs and faces as read-only NumPy arrays, and what one does with them."""

from __future__ import annotations

import hashlib
import math
import numbers
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from warp_springs.variants import Variants

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True)
class Field:
    """What one array of a robot holds: a row for each mass, spring or face."""

    per: str
    """What a row belongs to: ``"mass"``, ``"spring"``, ``"face"``, or ``"robot"`` (no row axis)."""
    row: tuple[int, ...]
    """Shape of one row."""
    rule: str
    """Values allowed: ``"positive"``, ``"non-negative"``, ``"finite"`` or ``"index"``."""
    unit: str
    """SI unit, empty for indices."""

    @cached_property
    def dtype(self) -> np.dtype:
        """Element type: int32 for indices, float64 for everything else."""
        return _INT32 if self.rule == "index" else _FLOAT64


_INT32, _FLOAT64 = np.dtype(np.int32), np.dtype(np.float64)

FIELDS: dict[str, Field] = {
    "masses": Field("mass", (), "positive", "kg"),
    "positions": Field("mass", (3,), "finite", "m"),
    "velocities": Field("mass", (3,), "finite", "m/s"),
    "springs": Field("spring", (2,), "index", ""),
    "stiffness": Field("spring", (), "positive", "N/m"),
    "rest_length": Field("spring", (), "non-negative", "m"),
    "amplitude": Field("spring", (), "finite", "m"),
    "phase": Field("spring", (), "finite", "rad"),
    "omega": Field("robot", (), "finite", "rad/s"),
    "faces": Field("face", (3,), "index", ""),
}
"""The fields of a robot, in the order in which `Robot` takes and keeps them."""

_NAMES = frozenset(FIELDS)
_KEPT_ITEMS = 4096
_LOW_ENOUGH: dict[str, Callable[[Any], Any]] = {
    "positive": lambda low: low > 0.0,
    "non-negative": lambda low: low >= 0.0,
    "finite": lambda low: low > -math.inf,
}
_ALLOWED = {
    "positive": "must be finite and greater than 0",
    "non-negative": "must be finite and at least 0",
    "finite": "must be finite",
}


class Robot:
    """A body of point masses and springs, with a sinusoidal rest length for every spring.

    Immutable: every array is read-only and C-contiguous, every method returns a new robot that
    shares what it did not change. The rest length in time is
    ``L0(t) = rest_length + amplitude * sin(omega * t + phase)``.

    Args:
        masses: Mass of each point [kg], shape (M,) or one number, positive.
        positions: Initial positions [m], shape (M, 3), M >= 1; z is up.
        springs: Indices of the two masses that each spring joins, shape (S, 2), S >= 0.
        stiffness: Spring stiffness [N/m], shape (S,) or one number, positive.
        rest_length: Mean rest length [m], shape (S,) or one number, not negative; the initial
            lengths when left out.
        velocities: Initial velocities [m/s], shape (M, 3); zero when left out.
        amplitude: Amplitude of the rest length [m], shape (S,) or one number; zero when left out.
        phase: Phase of the rest length [rad], shape (S,) or one number; zero when left out.
        omega: Angular frequency of the actuation [rad/s], one number for the robot.
        faces: Corners of the exterior triangles, counter-clockwise seen from outside, shape
            (T, 3); none when left out.

    Raises:
        ValueError: An array is malformed: the message names the field, the first bad index, what
            was given and what is allowed. Unwise bodies (coincident masses, two springs between
            one pair, an amplitude above the rest length) are allowed.
    """

    __slots__ = (*FIELDS, "_connections")

    masses: FloatArray
    positions: FloatArray
    velocities: FloatArray
    springs: IntArray
    stiffness: FloatArray
    rest_length: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    omega: float
    faces: IntArray

    def __init__(
        self,
        *,
        masses: ArrayLike,
        positions: ArrayLike,
        springs: ArrayLike,
        stiffness: ArrayLike,
        rest_length: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        phase: ArrayLike | None = None,
        omega: float = 0.0,
        faces: ArrayLike | None = None,
    ) -> None:
        given = {
            "masses": masses,
            "positions": positions,
            "velocities": velocities,
            "springs": springs,
            "stiffness": stiffness,
            "rest_length": rest_length,
            "amplitude": amplitude,
            "phase": phase,
            "omega": omega,
            "faces": faces,
        }
        _assign(self, _settled(given, _NAMES))

    # -- what a robot is ---------------------------------------------------------------------

    @property
    def n_masses(self) -> int:
        """Number of masses M."""
        return len(self.masses)

    @property
    def n_springs(self) -> int:
        """Number of springs S."""
        return len(self.springs)

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(self.masses.sum())

    @property
    def center_of_mass(self) -> FloatArray:
        """Centre of mass [m], shape (3,)."""
        return self.masses @ self.positions / self.masses.sum()

    @property
    def lengths(self) -> FloatArray:
        """Initial length of each spring [m], shape (S,)."""
        return _lengths(self.positions, self.springs)

    @property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the bounding box [m], shape (2, 3)."""
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)])

    @property
    def diameter(self) -> float:
        """Largest distance between two masses [m]."""
        return _diameter(self.positions)

    @property
    def is_actuated(self) -> bool:
        """Whether any spring has an amplitude other than zero."""
        return bool(self.amplitude.any())

    @property
    def topology(self) -> bytes:
        """Key of the number of masses and of the springs in their order.

        Two robots have the same key exactly when they have as many masses and the same springs
        in the same order. Computed once for all robots that share a springs array.
        """
        return self._connections.key

    def rest_length_at(self, t: ArrayLike) -> FloatArray:
        """Rest lengths at a time [m]: shape (S,) for one time [s], (F, S) for times (F,)."""
        angle = np.asarray(t, np.float64)[..., None] * self.omega + self.phase
        return self.rest_length + self.amplitude * np.sin(angle)

    def tension(self, positions: ArrayLike, t: ArrayLike) -> FloatArray:
        """Force in each spring [N], positive where stretched: Hooke's law k (L - L0(t)).

        Args:
            positions: Positions [m], shape (M, 3) with one time, (F, M, 3) with times (F,).
            t: The time [s] or the times of the frames, shape (F,).

        Returns:
            Forces, shape (S,) or (F, S).

        Raises:
            ValueError: The shapes of the positions and of the times do not fit.
        """
        positions, t = np.asarray(positions, np.float64), np.asarray(t, np.float64)
        expected = (*t.shape, self.n_masses, 3)
        if positions.shape != expected:
            raise ValueError(
                f"positions: shape {positions.shape} given, {expected} expected for times of "
                f"shape {t.shape} and {self.n_masses} masses"
            )
        return self.stiffness * (_lengths(positions, self.springs) - self.rest_length_at(t))

    # -- new robots from this one ------------------------------------------------------------

    def replace(self, **fields: Any) -> Robot:
        """The same robot with some fields replaced; None asks for the default of the field.

        Replaced positions do not change the rest lengths: give ``rest_length=None`` for the new
        initial lengths.

        Raises:
            TypeError: A robot has no such field.
            ValueError: A new array is malformed or no longer fits the others.
        """
        for name in fields:
            if name not in _NAMES:
                raise TypeError(f"a robot has no field {name!r}; it has {', '.join(FIELDS)}")
        kept = {name: getattr(self, name) for name in FIELDS}
        # Kept arrays are known to be good unless the counts or the springs under them change.
        same_body = "springs" not in fields and (
            "positions" not in fields or np.shape(fields["positions"]) == self.positions.shape
        )
        robot = object.__new__(Robot)
        settled = _settled(kept | fields, fields.keys() if same_body else _NAMES)
        _assign(robot, settled, self._connections if same_body else None)
        return robot

    def moved(self, offset: ArrayLike) -> Robot:
        """The robot shifted by an offset [m], shape (3,)."""
        return self.replace(positions=self.positions + _vector("offset", offset))

    def rotated(self, axis: ArrayLike, angle: float, about: ArrayLike | None = None) -> Robot:
        """The robot turned about an axis, its velocities with it.

        Args:
            axis: Direction of the axis, shape (3,), of any length but zero.
            angle: Angle [rad], counter-clockwise seen from the tip of the axis.
            about: A point on the axis [m], shape (3,); the centre of mass when left out.

        Raises:
            ValueError: The axis is zero, or a value is not finite.
        """
        turn = _rotation(axis, angle)
        centre = self.center_of_mass if about is None else _vector("about", about)
        changed = {"positions": centre + (self.positions - centre) @ turn.T}
        if self.velocities.any():
            changed["velocities"] = self.velocities @ turn.T
        return self.replace(**changed)

    def scaled(self, factor: float) -> Robot:
        """The robot with positions, rest lengths and amplitudes multiplied by a factor > 0.

        Positions scale about the origin, so a body that stands on the ground still stands there.
        Masses, stiffness and velocities stay.

        Raises:
            ValueError: The factor is not finite or not positive.
        """
        factor = require_positive("factor", factor)
        return self.replace(
            positions=self.positions * factor,
            rest_length=self.rest_length * factor,
            amplitude=self.amplitude * factor,
        )

    def moving(self, velocity: ArrayLike) -> Robot:
        """The robot with a velocity [m/s], shape (3,), added to every mass."""
        return self.replace(velocities=self.velocities + _vector("velocity", velocity))

    def spinning(self, angular_velocity: ArrayLike) -> Robot:
        """The robot with a rigid rotation w x r about its centre of mass added.

        Args:
            angular_velocity: w [rad/s], shape (3,); r is measured from the centre of mass.
        """
        w = _vector("angular_velocity", angular_velocity)
        arms = self.positions - self.center_of_mass
        return self.replace(velocities=self.velocities + arms @ _cross_matrix(w).T)

    def joined(self, other: Robot, merge: bool = False, tolerance: float = 1e-9) -> Robot:
        """This robot and another as one body: this one's masses and springs come first.

        With ``merge`` the two bodies grow together. A mass of the other that lies within the
        tolerance of a mass of this one becomes that mass: it keeps this one's position and
        velocity and the LARGER of the two masses, not their sum, as a vertex shared by the
        voxels of a lattice exists once. Of the springs between one pair of masses the first
        stays, this robot's before the other's. Two coincident triangles with opposite winding,
        one of each body, are interior now and vanish; of two with the same winding one stays.
        Springs and faces that the tolerance collapses to a point or a line vanish too.

        Args:
            other: The other body.
            merge: Whether coincident masses become one.
            tolerance: Largest distance [m] at which two masses coincide, at least 0.

        Raises:
            ValueError: Both robots are actuated with different omegas (a robot has one), or the
                tolerance is negative or not finite.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0.0):
            raise ValueError(f"tolerance = {tolerance!r}: must be finite and at least 0 m")
        omega = _common_omega(self, other)
        index = np.arange(self.n_masses, self.n_masses + other.n_masses)
        if merge:
            index = _merged_index(self.positions, other.positions, tolerance)
        return _concatenated(self, other, index, omega, unique=merge)

    def variants(self, **stacked: ArrayLike) -> Variants:
        """N robots that share this body and differ in some fields: see `Variants`."""
        from warp_springs.variants import Variants

        return Variants(self, stacked)

    # -- a value among values ----------------------------------------------------------------

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Robot is immutable: use robot.replace({name}=...)")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a Robot is immutable: {name!r} cannot be deleted")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Robot):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in FIELDS)

    def __hash__(self) -> int:
        # Adding 0 turns -0.0 into 0.0: the two are equal, so they must hash alike.
        return hash(tuple((getattr(self, name) + np.zeros(1)).tobytes() for name in FIELDS))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, ({name: getattr(self, name) for name in FIELDS},)

    def __repr__(self) -> str:
        actuated = f", actuated at {self.omega:.4g} rad/s" if self.is_actuated else ""
        return (
            f"Robot({self.n_masses} masses, {self.n_springs} springs, {len(self.faces)} faces, "
            f"{self.mass:.4g} kg{actuated})"
        )


class _Connections:
    """The springs of one body, shared by all robots derived from it, with their key."""

    def __init__(self, n_masses: int, springs: IntArray) -> None:
        self.n_masses, self.springs = n_masses, springs

    @cached_property
    def key(self) -> bytes:
        digest = hashlib.blake2b(self.springs.tobytes(), digest_size=16)
        digest.update(self.n_masses.to_bytes(8, "little"))
        return digest.digest()


def _assign(robot: Robot, settled: dict[str, Any], same: _Connections | None = None) -> None:
    for name, value in settled.items():
        object.__setattr__(robot, name, value)
    connections = same or _Connections(len(settled["masses"]), settled["springs"])
    object.__setattr__(robot, "_connections", connections)


def _rebuilt(fields: dict[str, Any]) -> Robot:
    return Robot(**fields)


# -- checked, frozen arrays ------------------------------------------------------------------


def _settled(given: Mapping[str, Any], to_check: Any) -> dict[str, Any]:
    """Every field as a frozen array (omega as a float); those `to_check` converted and checked."""
    done = {name: given[name] for name in FIELDS if name not in to_check}
    if "positions" in to_check:
        done["positions"] = checked("positions", given["positions"], (None, 3))
        if len(done["positions"]) == 0:
            raise ValueError("positions: shape (0, 3) given, at least one mass expected")
    if "springs" in to_check:
        done["springs"] = checked("springs", given["springs"], (None, 2))
        _check_indices("springs", done["springs"], len(done["positions"]))
    counts = {"mass": len(done["positions"]), "spring": len(done["springs"]), "face": None}
    for name, field in FIELDS.items():
        if name in done:
            continue
        value = given[name]
        if name == "omega":
            number = value if type(value) is float else float(checked(name, value, ()))
            done[name] = _checked_number(name, number)
        elif value is None and name == "rest_length":
            lengths = _lengths(done["positions"], done["springs"])
            done[name] = checked(name, lengths, lengths.shape)
        elif value is None and name in ("velocities", "amplitude", "phase", "faces"):
            done[name] = _filled((counts[field.per] or 0, *field.row), 0, field.dtype)
        else:
            done[name] = checked(name, value, (counts[field.per], *field.row))
    if "faces" in to_check:
        _check_indices("faces", done["faces"], counts["mass"])
    return done


def checked(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], spread: bool = True
) -> NDArray[Any]:
    """A value as the frozen array of a field; None in the shape stands for any count.

    With `spread` one number fills a field that has one number a row. Whether indices are in
    range is not checked here.

    Raises:
        ValueError: The value is no array of numbers, its shape or one of its values is wrong.
    """
    field = FIELDS[name]
    if spread and type(value) is float and len(shape) == 1:
        return _filled(shape, _checked_number(name, value), field.dtype)
    ready = is_frozen(value, field.dtype)
    array = value if ready else _converted(name, value, field)
    if spread and array.ndim == 0 and len(shape) == 1:
        return _filled(shape, _checked_number(name, float(array)), field.dtype)
    if array.shape == (0,) and shape[:1] in ((0,), (None,)):
        array = array.reshape(0, *shape[1:])  # an empty list does not know the shape of its rows
    expected = (array.shape[:1] + shape[1:]) if shape[:1] == (None,) else shape
    if array.shape != expected or array.ndim != len(shape):
        raise ValueError(f"{name}: shape {array.shape} given, {_text(shape)} expected")
    if field.rule != "index":
        _check_values(name, array, field.rule)
    return array if ready else _frozen_copy(array)


def is_frozen(value: Any, dtype: np.dtype) -> bool:
    """Whether nobody can write to an array any more: its memory is that of a bytes object."""
    if type(value) is not np.ndarray or value.dtype != dtype or not value.flags.c_contiguous:
        return False
    owner = value.base
    return type(owner) is bytes or type(getattr(owner, "base", None)) is bytes


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    """A C-contiguous copy that nobody can write to; the array itself where it is one already."""
    return array if is_frozen(array, array.dtype) else _frozen_copy(array)


def _frozen_copy(array: NDArray[Any]) -> NDArray[Any]:
    return np.ndarray(array.shape, array.dtype, buffer=array.tobytes())


def _text(shape: tuple[int | None, ...]) -> str:
    return str(shape).replace("None", "any")


def _converted(name: str, value: ArrayLike, field: Field) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{name}: cannot be read as an array: {error}") from None
    if array.size == 0:
        return array.astype(field.dtype)
    if field.rule == "index":
        if array.dtype.kind not in "iu":
            raise ValueError(f"{name}: {array.dtype} given, indices (whole numbers) expected")
        if array.dtype != _INT32 and (array.min() < -(2**31) or array.max() >= 2**31):
            raise ValueError(f"{name}: an index beyond 32 bits given")
    elif array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: {array.dtype} given, real numbers expected")
    return array.astype(field.dtype, copy=False)


def _check_values(name: str, array: FloatArray, rule: str) -> None:
    if array.size == 0:
        return
    # The minimum and the maximum are NaN where any value is, and NaN passes no comparison.
    low, high = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
    if _LOW_ENOUGH[rule](low) and high < math.inf:
        return
    bad = ~np.isfinite(array) | ~_LOW_ENOUGH[rule](array)
    at = tuple(int(i) for i in np.argwhere(bad)[0])
    place = f"{name}[{', '.join(map(str, at))}]" if at else name
    raise ValueError(f"{place} = {array[at]}: {_ALLOWED[rule]} ({FIELDS[name].unit})")


def _checked_number(name: str, value: float) -> float:
    rule = FIELDS[name].rule
    if _LOW_ENOUGH[rule](value) and value < math.inf:
        return value
    raise ValueError(f"{name} = {value}: {_ALLOWED[rule]} ({FIELDS[name].unit})")


def _check_indices(name: str, array: IntArray, n_masses: int) -> None:
    if array.size == 0:
        return
    low, high = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
    columns = array.T
    repeated = columns[0] == columns[1]
    for a, b in ((1, 2), (2, 0)) if len(columns) == 3 else ():
        repeated = repeated | (columns[a] == columns[b])
    if low >= 0 and high < n_masses and not np.logical_or.reduce(repeated):
        return
    outside = ((array < 0) | (array >= n_masses)).any(axis=1)
    row = int(np.argmax(outside | repeated))
    what = "two" if name == "springs" else "three"
    raise ValueError(
        f"{name}[{row}] = {tuple(array[row].tolist())}: must name {what} different masses, "
        f"each from 0 to {n_masses - 1}"
    )


def _filled(shape: tuple[int, ...], value: float, dtype: np.dtype) -> NDArray[Any]:
    """A frozen array of one value, shared by all bodies of moderate size that ask for it."""
    make = _kept_filled if math.prod(shape) <= _KEPT_ITEMS else _kept_filled.__wrapped__
    return make(shape, value, dtype)


@lru_cache(maxsize=256)
def _kept_filled(shape: tuple[int, ...], value: float, dtype: np.dtype) -> NDArray[Any]:
    return _frozen_copy(np.full(shape, value, dtype))


def require_positive(name: str, value: float) -> float:
    """A parameter as a float, refused with a ValueError unless finite and greater than 0."""
    if isinstance(value, numbers.Real) and math.isfinite(value) and value > 0.0:
        return float(value)
    raise ValueError(f"{name} = {value!r}: must be a finite number greater than 0")


def _vector(name: str, value: ArrayLike) -> FloatArray:
    array = np.asarray(value, np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} = {value!r}: must be three finite numbers")
    return array


# -- geometry --------------------------------------------------------------------------------


def _lengths(positions: FloatArray, springs: IntArray) -> FloatArray:
    """Distance between the ends of each spring, (..., M, 3) -> (..., S)."""
    d = positions.take(springs[:, 1], axis=-2) - positions.take(springs[:, 0], axis=-2)
    d *= d
    return np.sqrt(d[..., 0] + d[..., 1] + d[..., 2])


def _cross_matrix(v: FloatArray) -> FloatArray:
    """The matrix K with K r = v x r."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _rotation(axis: ArrayLike, angle: float) -> FloatArray:
    """Rodrigues' formula: 1 + sin(angle) K + (1 - cos(angle)) K^2, K of the unit axis."""
    direction = _vector("axis", axis)
    length = math.hypot(*direction)
    if length == 0.0:
        raise ValueError("axis = (0, 0, 0): an axis of rotation needs a direction")
    if not math.isfinite(angle):
        raise ValueError(f"angle = {angle!r}: must be finite (rad)")
    k = _cross_matrix(direction / length)
    # 1 - cos written as 2 sin^2 of the half angle keeps its digits at small angles.
    return np.eye(3) + math.sin(angle) * k + 2.0 * math.sin(angle / 2.0) ** 2 * (k @ k)


def _diameter(positions: FloatArray) -> float:
    centred = positions - positions.mean(axis=0)
    radius = np.sqrt(np.einsum("ij,ij->i", centred, centred))
    start = centred[np.argmax(radius)]
    least = np.sqrt(((centred - start) ** 2).sum(axis=1).max())
    # Two points are no further apart than the sum of their distances from the centre, so only
    # points this far out can beat the distance already found.
    outer = centred[radius + radius.max() >= least * (1.0 - 1e-12)]
    rows = max(1, 2**20 // len(outer))
    chunks = (outer[i : i + rows, None] - outer for i in range(0, len(outer), rows))
    return float(np.sqrt(max(np.einsum("abi,abi->ab", d, d).max() for d in chunks)))


# -- joining ---------------------------------------------------------------------------------


def _common_omega(first: Robot, second: Robot) -> float:
    if first.is_actuated and second.is_actuated and first.omega != second.omega:
        raise ValueError(
            f"omega: {first.omega} rad/s and {second.omega} rad/s given, but joined robots share "
            "one omega and both are actuated"
        )
    return second.omega if second.is_actuated else first.omega


def _merged_index(first: FloatArray, second: FloatArray, tolerance: float) -> NDArray[np.intp]:
    """Where each mass of the second body is found in the merged one, shape (M2,)."""
    match = _coincident(first, second, tolerance)
    fresh = match < 0
    return np.where(fresh, len(first) + np.cumsum(fresh) - 1, match)


def _coincident(first: FloatArray, second: FloatArray, tolerance: float) -> NDArray[np.intp]:
    """For each point of the second set the nearest of the first within a tolerance, or -1."""
    # Projected on a direction that no lattice plane is perpendicular to, only points that lie
    # close together have close images, so sorting finds all pairs without comparing all.
    direction = np.array([0.53768, 0.64121, 0.54739])
    size = max(np.abs(first).max(), np.abs(second).max())
    margin = 1.01 * tolerance + 1e-15 * 8 * size  # the projection's own rounding
    order = np.argsort(first @ direction, kind="stable")
    images, wanted = (first @ direction)[order], second @ direction
    start = np.searchsorted(images, wanted - margin, side="left")
    count = np.searchsorted(images, wanted + margin, side="right") - start
    point = np.repeat(np.arange(len(second)), count)
    ranks = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    candidate = order[np.repeat(start, count) + ranks]
    distance = np.sqrt(((second[point] - first[candidate]) ** 2).sum(axis=1))
    match = np.full(len(second), -1, np.intp)
    near = np.flatnonzero(distance <= tolerance)
    near = near[np.argsort(-distance[near], kind="stable")]  # the nearest is written last
    match[point[near]] = candidate[near]
    return match


def _concatenated(
    first: Robot, second: Robot, index: NDArray[np.intp], omega: float, unique: bool
) -> Robot:
    """Both robots as one, mass i of the second becoming mass index[i] of the whole."""
    fresh = index >= first.n_masses
    masses = np.concatenate([first.masses, second.masses[fresh]])
    np.maximum.at(masses, index, second.masses)
    springs = np.concatenate([first.springs, index[second.springs].astype(np.int32)])
    faces = [first.faces, index[second.faces].astype(np.int32)]
    keep: slice | NDArray[np.intp] = slice(None)
    if unique:
        keep = _first_of_each_pair(springs, len(masses))
        faces = _exterior(*faces)
    per_spring = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])[keep]
        for name in ("stiffness", "rest_length", "amplitude", "phase")
    }
    return Robot(
        masses=masses,
        positions=np.concatenate([first.positions, second.positions[fresh]]),
        velocities=np.concatenate([first.velocities, second.velocities[fresh]]),
        springs=springs[keep],
        omega=omega,
        faces=np.concatenate(faces),
        **per_spring,
    )


def _first_of_each_pair(springs: IntArray, n_masses: int) -> NDArray[np.intp]:
    """Rows of the first spring between each pair of different masses, in their order."""
    low, high = springs.min(axis=1).astype(np.int64), springs.max(axis=1).astype(np.int64)
    rows = np.unique(low * n_masses + high, return_index=True)[1]
    return np.sort(rows[low[rows] != high[rows]])


def _exterior(first: IntArray, second: IntArray) -> list[IntArray]:
    """The faces of two bodies without those that meet back to back, repeat or have collapsed."""
    corners = np.sort(second, axis=1)
    second = second[(corners[:, 1:] != corners[:, :-1]).all(axis=1)]
    every = np.concatenate([_cyclic(first), _cyclic(second), _cyclic(second[:, ::-1])])
    group = np.unique(every, axis=0, return_inverse=True)[1].reshape(-1)
    one, two, back = np.split(group, [len(first), len(first) + len(second)])
    return [first[~np.isin(one, back)], second[~np.isin(back, one) & ~np.isin(two, one)]]


def _cyclic(faces: IntArray) -> IntArray:
    """Each triangle written from its smallest corner on, its winding kept."""
    start = faces.argmin(axis=1)[:, None] if len(faces) else np.zeros((0, 1), np.intp)
    return np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
