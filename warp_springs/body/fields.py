"""Fields of a robot: what each array holds, and how given values become checked, frozen arrays.

Everything malformed is refused here, with the field, the first bad index, what was given and
what is allowed.
"""

from __future__ import annotations

import math
import numbers
import operator
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.geometry import FloatArray, IntArray, spring_lengths

__all__ = [
    "FIELDS",
    "Field",
    "check_labels",
    "check_masses_named",
    "checked",
    "filled",
    "freeze",
    "is_frozen",
    "require_positive",
    "require_vector",
    "require_whole",
    "settled",
]


@dataclass(frozen=True)
class Field:
    """What one array of a robot holds: a row for each mass, spring or face."""

    per: str
    """What a row belongs to: ``"mass"``, ``"spring"``, ``"face"``, or ``"robot"`` (no row axis)."""
    row: tuple[int, ...]
    """Shape of one row."""
    rule: str
    """Values allowed: ``"positive"``, ``"non-negative"``, ``"finite"``, ``"index"``, ``"label"``
    (-1 for none, or a row of the table of materials) or ``"table"`` (that table)."""
    unit: str
    """SI unit, empty for indices."""

    @cached_property
    def dtype(self) -> np.dtype:
        """Element type: int32 for indices and labels, float64 for everything else."""
        return _INT32 if self.rule in ("index", "label") else _FLOAT64


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
    "material": Field("spring", (), "label", ""),
    "materials": Field("robot", (), "table", ""),
}
"""The fields of a robot, in the order in which `Robot` takes and keeps them."""

# Arrays of one value are shared up to this size: larger ones would cost memory to keep.
_KEPT_ITEMS = 4096
_LOW_ENOUGH: dict[str, Callable[[Any], Any]] = {
    "positive": lambda low: low > 0.0,
    "non-negative": lambda low: low >= 0.0,
    "finite": lambda low: low > -math.inf,
}
_FILLS = {"velocities": 0, "amplitude": 0, "phase": 0, "faces": 0, "material": -1}
"""What fills the fields that may be left out."""
_ALLOWED = {
    "positive": "must be finite and greater than 0",
    "non-negative": "must be finite and at least 0",
    "finite": "must be finite",
}


def settled(given: Mapping[str, Any], to_check: Container[str]) -> dict[str, Any]:
    """Every field of a robot as a frozen array (omega as a float), those to check checked.

    Args:
        given: A value for each of `FIELDS`; None where the default is wanted.
        to_check: Names of the fields to convert and check; the others are settled already.

    Raises:
        ValueError: A value is malformed or does not fit the others.
    """
    done = {name: given[name] for name in FIELDS if name not in to_check}
    if "positions" in to_check:
        done["positions"] = checked("positions", given["positions"], (None, 3))
        if len(done["positions"]) == 0:
            raise ValueError("positions: shape (0, 3) given, at least one mass expected")
    if "springs" in to_check:
        done["springs"] = checked("springs", given["springs"], (None, 2))
        check_masses_named("springs", done["springs"], len(done["positions"]))
    counts = {"mass": len(done["positions"]), "spring": len(done["springs"]), "face": None}
    for name, field in FIELDS.items():
        if name in done:
            continue
        value = given[name]
        if name == "omega":
            number = value if type(value) is float else float(checked(name, value, ()))
            done[name] = _checked_number(name, number)
        elif value is None and name == "rest_length":
            initial = spring_lengths(done["positions"], done["springs"])
            done[name] = checked(name, initial, initial.shape)
        elif name == "materials":
            done[name] = _checked_table(value)
        elif value is None and name in _FILLS:
            done[name] = filled(name, (counts[field.per] or 0, *field.row))
        else:
            done[name] = checked(name, value, (counts[field.per], *field.row))
    if "faces" in to_check:
        check_masses_named("faces", done["faces"], counts["mass"])
    if "material" in to_check or "materials" in to_check:
        check_labels(done["material"], len(done["materials"]))
    return done


def checked(
    name: str,
    value: ArrayLike,
    shape: tuple[int | None, ...],
    spread: bool = True,
    copy: bool = True,
) -> NDArray[Any]:
    """A value as the frozen array of a field; None in the shape stands for any count.

    With `spread` one number fills a field that has one number a row. Whether indices are in
    range is not checked here. Without `copy` a contiguous array is made read-only where it is.

    Raises:
        ValueError: The value is no array of numbers, its shape or one of its values is wrong.
    """
    field = FIELDS[name]
    if spread and type(value) is float and len(shape) == 1 and field.rule in _LOW_ENOUGH:
        return _filled(shape, _checked_number(name, value), field.dtype)
    ready = is_frozen(value, field.dtype)
    array = value if ready else _converted(name, value, field)
    if spread and array.ndim == 0 and len(shape) == 1:
        number = float(array)
        good = _checked_number(name, number) if field.rule in _LOW_ENOUGH else number
        return _filled(shape, good, field.dtype)
    if array.shape == (0,) and shape[:1] in ((0,), (None,)):
        array = array.reshape(0, *shape[1:])  # an empty list does not know the shape of its rows
    expected = (array.shape[:1] + shape[1:]) if shape[:1] == (None,) else shape
    if array.shape != expected or array.ndim != len(shape):
        raise ValueError(f"{name}: shape {array.shape} given, {_text(shape)} expected")
    if field.rule in _LOW_ENOUGH:
        _check_values(name, array, field.rule)
    if not copy and array.flags.c_contiguous:
        array.flags.writeable = False
        return array
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
    if field.dtype == _INT32:
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


def check_masses_named(name: str, array: IntArray, n_masses: int | IntArray) -> None:
    """Refuse rows that do not name different masses, of so many, or of so many in each row."""
    if array.size == 0:
        return
    each = np.broadcast_to(n_masses, len(array))
    low, high = np.minimum.reduce(array, axis=None), np.maximum.reduce(array, axis=None)
    columns = array.T
    repeated = columns[0] == columns[1]
    for a, b in ((1, 2), (2, 0)) if len(columns) == 3 else ():
        repeated = repeated | (columns[a] == columns[b])
    below = high < n_masses if np.ndim(n_masses) == 0 else (array < each[:, None]).all()
    if low >= 0 and below and not np.logical_or.reduce(repeated):
        return
    outside = ((array < 0) | (array >= each[:, None])).any(axis=1)
    row = int(np.argmax(outside | repeated))
    what = "two" if name == "springs" else "three"
    raise ValueError(
        f"{name}[{row}] = {tuple(array[row].tolist())}: must name {what} different masses, "
        f"each from 0 to {each[row] - 1}"
    )


def _checked_table(value: Any) -> tuple[Any, ...]:
    from warp_springs.materials import Material

    table = () if value is None else tuple(value)
    for index, material in enumerate(table):
        if not isinstance(material, Material):
            raise ValueError(f"materials[{index}]: got {material!r}, expected a Material")
    return table


def check_labels(labels: IntArray, n_materials: int) -> None:
    """Refuse labels, of any shape, that are neither -1 nor a row of the table of materials."""
    if labels.size == 0 or (labels.min() >= -1 and labels.max() < n_materials):
        return
    at = tuple(int(i) for i in np.argwhere((labels < -1) | (labels >= n_materials))[0])
    raise ValueError(
        f"material{list(at)} = {labels[at]}: must be -1 (none) or a row of the {n_materials} "
        "materials"
    )


def filled(name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """What a field holds that was left out, such as no velocities."""
    return _filled(shape, _FILLS[name], FIELDS[name].dtype)


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


def require_vector(name: str, value: ArrayLike) -> FloatArray:
    """A parameter as an array (3,), refused with a ValueError unless it is three finite numbers."""
    array = np.asarray(value, np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} = {value!r}: must be three finite numbers")
    return array


def require_whole(name: str, value: int, least: int) -> int:
    """A parameter as an int, refused with a ValueError unless whole and not below `least`."""
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        raise ValueError(f"{name} = {value!r}: must be a whole number of {least} or more")
    return number
