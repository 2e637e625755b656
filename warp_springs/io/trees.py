"""Objects of this package as JSON and pools of numbers, and back; nothing is pickled."""

from __future__ import annotations

import dataclasses
import math
from collections import defaultdict
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from warp_springs.robot import Robot
from warp_springs.variants import Variants

__all__ = ["Pools", "decoded", "encoded"]

_PACKAGE = __name__.partition(".")[0]


class Pools:
    """All arrays of a tree, those of one type in one pool; an array met again is kept once."""

    def __init__(self) -> None:
        self._arrays: dict[str, list[np.ndarray]] = defaultdict(list)
        self._sizes: dict[str, int] = defaultdict(int)
        self._places: dict[int, list[Any]] = {}
        self._kept: list[np.ndarray] = []  # an id is its array's only while the array lives

    def place(self, array: np.ndarray) -> list[Any]:
        """Keep an array; returns its type, its first value in the pool, and its shape."""
        if id(array) not in self._places:
            dtype = array.dtype.name
            self._places[id(array)] = [dtype, self._sizes[dtype], list(array.shape)]
            self._kept.append(array)
            self._arrays[dtype].append(array.ravel())
            self._sizes[dtype] += array.size
        return self._places[id(array)]

    def joined(self) -> dict[str, np.ndarray]:
        """The pools, flat, by the names of their types."""
        return {dtype: np.concatenate(parts) for dtype, parts in self._arrays.items()}


def encoded(value: Any, pools: Pools, where: str) -> Any:
    """A value as what JSON can hold; its arrays go to the pools.

    Raises:
        TypeError: There is something else in it than numbers, texts, arrays, sequences, dicts,
            robots and data classes of this package; ``where`` says in which part.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufU":
        return {"array": pools.place(value)}
    if isinstance(value, tuple):
        return {"tuple": [encoded(v, pools, f"{where}[{i}]") for i, v in enumerate(value)]}
    if isinstance(value, list):
        return [encoded(v, pools, f"{where}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, Mapping):
        pairs = [[k, encoded(v, pools, f"{where}[{k!r}]")] for k, v in value.items()]
        return {"dict": pairs}
    if isinstance(value, (Robot, Variants)):  # they say themselves what they are made from
        arguments = encoded(value.__reduce__()[1], pools, where)
        return {"type": _name(type(value)), "arguments": arguments}
    if dataclasses.is_dataclass(value) and _known(type(value)):
        fields = {
            f.name: encoded(getattr(value, f.name), pools, f"{where}.{f.name}")
            for f in dataclasses.fields(value)
            if f.init
        }
        return {"type": _name(type(value)), "fields": fields}
    raise TypeError(f"{where}: a {type(value).__name__} cannot be kept in a file")


def decoded(tree: Any, pools: Mapping[str, np.ndarray]) -> Any:
    """What was encoded; the arrays are read from the pools.

    Raises:
        ValueError: The tree names something that this package has not.
        KeyError: An array's pool is missing.
    """
    if isinstance(tree, list):
        return [decoded(item, pools) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        dtype, first, shape = tree["array"]
        values = pools[dtype][first : first + math.prod(shape)] if math.prod(shape) else []
        return np.array(values, dtype).reshape(shape)
    if "tuple" in tree:
        return tuple(decoded(item, pools) for item in tree["tuple"])
    if "dict" in tree:
        return {key: decoded(item, pools) for key, item in tree["dict"]}
    kind = _class(tree["type"])
    if kind is Robot:
        return Robot(**decoded(tree["arguments"], pools)[0])
    if kind is Variants:
        return Variants(*decoded(tree["arguments"], pools))
    return kind(**{name: decoded(item, pools) for name, item in tree["fields"].items()})


def _known(kind: type) -> bool:
    return kind.__module__.partition(".")[0] == _PACKAGE


def _name(kind: type) -> str:
    """The public name of a class, or where it stands if it has none."""
    public = vars(import_module(_PACKAGE)).get(kind.__name__) is kind
    return kind.__name__ if public else f"{kind.__module__}.{kind.__qualname__}"


def _class(name: str) -> type:
    """The class of a name; only robots and data classes of this package have one."""
    module, _, short = name.rpartition(".")
    kind = None
    if not module or module.startswith(f"{_PACKAGE}."):
        kind = getattr(import_module(module or _PACKAGE), short, None)
    if not isinstance(kind, type) or not (
        kind in (Robot, Variants) or (dataclasses.is_dataclass(kind) and _known(kind))
    ):
        raise ValueError(f"it holds a {name!r}, which this version has not")
    return kind
