"""Variants: many robots of one body, held as stacked arrays instead of as many objects."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.body.elements import PER_MASS, PER_SPRING, check_rows, frozen
from warp_springs.body.fields import FIELDS, check_labels, checked, freeze
from warp_springs.robot import Robot

STACKABLE = tuple(name for name, field in FIELDS.items() if field.rule not in ("index", "table"))
"""The fields in which variants of one body may differ: all but springs, faces and materials."""
ELEMENTS = (*PER_SPRING, *PER_MASS)
"""The arrays of its elements in which they may differ too."""
WEIGHTS = "weights"
"""Those of the network of its controller, likewise."""


class Variants(Sequence[Robot]):
    """N robots that share one body and differ in the fields given; made by `Robot.variants`.

    A sequence of robots: ``variants[i]`` is built when asked for, a slice is again `Variants`,
    and no array is copied on the way. Immutable, like the robots.

    Args:
        body: The robot that gives every field which is not stacked. Rest lengths too: stacked
            positions do not change them.
        stacked: Field name -> array with one row a robot on axis 0 and then the shape of the
            field: (N, M) masses, (N, M, 3) positions or velocities, (N, S) stiffness,
            rest_length, amplitude, phase or material, (N,) omega; or arrays of `ws.Elements`,
            such as (N, S, H, 2) harmonics or (N, S) dashpot; or the (N, n_weights) weights of
            its controller. At least one.
        copy: Whether arrays are copied, rather than made read-only where they are.

    Raises:
        TypeError: A field cannot be stacked.
        ValueError: An array is malformed (the rules of `Robot`), the arrays are of different
            numbers of robots, or none is given.
    """

    __slots__ = ("_body", "_count", "_stacked")

    def __init__(self, body: Robot, stacked: Mapping[str, ArrayLike], copy: bool = True) -> None:
        if not stacked:
            raise ValueError(f"variants need at least one stacked field of {', '.join(STACKABLE)}")
        arrays: dict[str, NDArray[Any]] = {}
        count = None
        for name, value in stacked.items():
            if name == WEIGHTS:
                arrays[name] = _checked_weights(body, value, count)
            elif name in ELEMENTS:
                arrays[name] = _checked_element(body, name, value, count)
            elif name in STACKABLE:
                shape = (count, *np.shape(getattr(body, name)))
                arrays[name] = checked(name, value, shape, spread=False, copy=copy)
            else:
                known = ", ".join((*STACKABLE, *ELEMENTS, WEIGHTS))
                raise TypeError(f"variants cannot stack {name!r}, only {known}")
            count = len(arrays[name])
        if "material" in arrays:
            check_labels(arrays["material"], len(body.materials))
        self._keep(body, arrays, count or 0)

    def _keep(self, body: Robot, arrays: dict[str, NDArray[Any]], count: int) -> None:
        for name, value in zip(self.__slots__, (body, count, arrays), strict=True):
            object.__setattr__(self, name, value)

    @property
    def body(self) -> Robot:
        """The robot that gives every field which is not stacked."""
        return self._body

    @property
    def stacked(self) -> Mapping[str, NDArray[Any]]:
        """The stacked fields: name -> read-only array (N, ...)."""
        return MappingProxyType(self._stacked)

    def array(self, name: str) -> NDArray[Any]:
        """A field of all robots, shape (N, ...), read-only.

        The stacked array, or a view of the body's own that repeats it without copying.

        Raises:
            ValueError: A robot has no such array.
        """
        if name in self._stacked:
            return self._stacked[name]
        if name not in FIELDS:
            raise ValueError(f"a robot has no field {name!r}; it has {', '.join(FIELDS)}")
        if FIELDS[name].rule == "table":
            raise ValueError(f"{name} are no array: all variants have those of the body")
        value = getattr(self._body, name)
        return np.broadcast_to(value, (self._count, *np.shape(value)))

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> Robot: ...
    @overload
    def __getitem__(self, index: slice) -> Variants: ...
    def __getitem__(self, index: int | slice) -> Robot | Variants:
        if isinstance(index, slice):
            part = object.__new__(Variants)
            arrays = {name: freeze(array[index]) for name, array in self._stacked.items()}
            part._keep(self._body, arrays, len(range(*index.indices(self._count))))
            return part
        i = operator.index(index)
        if not -self._count <= i < self._count:
            raise IndexError(f"robot {i} asked for, there are {self._count} variants")
        rows = {name: array[i] for name, array in self._stacked.items()}
        changed = {name: frozen(rows.pop(name)) for name in list(rows) if name in ELEMENTS}
        if WEIGHTS in rows:
            (controller,) = self._body.elements.controllers
            changed["controllers"] = (controller.replace(weights=rows.pop(WEIGHTS)),)
        if changed:
            rows["elements"] = self._body.elements.replace(**changed)
        return self._body.replace(**rows)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("Variants are immutable: make new ones with body.variants(...)")

    def __reduce__(self) -> tuple[Any, ...]:
        return Variants, (self._body, self._stacked)

    def __repr__(self) -> str:
        return f"Variants({self._count} of {self._body!r} in {', '.join(self._stacked)})"


def _checked_weights(body: Robot, value: ArrayLike, count: int | None) -> NDArray[np.float64]:
    controllers = body.elements.controllers
    if len(controllers) != 1:
        raise ValueError(f"weights: the body has {len(controllers)} controllers, 1 expected")
    rows = len(value) if count is None else count
    return controllers[0].checked(value, (rows,))


def _checked_element(
    body: Robot, name: str, value: ArrayLike, count: int | None
) -> NDArray[np.float64]:
    array = frozen(value)
    rows = body.n_springs if name in PER_SPRING else body.n_masses
    check_rows(name, array, rows, leading=2)
    if count is not None and len(array) != count:
        raise ValueError(f"{name}: {len(array)} robots given, {count} expected")
    return array
