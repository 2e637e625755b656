"""Objects of this package as JSON and pools of numbers, and back; nothing is pickled."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections import defaultdict
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from warp_springs.body.variants import Variants
from warp_springs.robot import Robot

__all__ = ["Reader", "Writer", "check_header", "format_of"]

_PACKAGE = __name__.partition(".")[0]


class Writer:
    """Turns values into trees; arrays and objects that are met again are kept once.

    Attributes:
        objects: Trees of the robots and data classes met, each before whatever holds it.
    """

    def __init__(self) -> None:
        self.objects: list[Any] = []
        self._arrays: dict[str, list[np.ndarray]] = defaultdict(list)
        self._sizes: dict[str, int] = defaultdict(int)
        self._places: dict[int, Any] = {}
        self._kept: list[Any] = []  # an id is its owner's only while the owner lives

    def pools(self) -> dict[str, np.ndarray]:
        """All arrays of one type, flat, by the names of the types."""
        return {dtype: np.concatenate(parts) for dtype, parts in self._arrays.items()}

    def tree(self, value: Any, where: str) -> Any:
        """A value as what JSON can hold.

        Raises:
            TypeError: There is something else in it than numbers, texts, arrays, sequences, dicts,
                robots and data classes of this package; ``where`` says in which part.
        """
        if isinstance(value, np.generic):
            value = value.item()
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, tuple):
            return {"tuple": [self.tree(v, f"{where}[{i}]") for i, v in enumerate(value)]}
        if isinstance(value, list):
            return [self.tree(v, f"{where}[{i}]") for i, v in enumerate(value)]
        if isinstance(value, Mapping):
            return {"dict": [[k, self.tree(v, f"{where}[{k!r}]")] for k, v in value.items()]}
        if id(value) not in self._places:
            place = self._array if isinstance(value, np.ndarray) else self._object
            self._places[id(value)] = place(value, where)
            self._kept.append(value)
        return self._places[id(value)]

    def _array(self, array: np.ndarray, where: str) -> Any:
        if array.dtype.kind not in "biufU":
            raise TypeError(f"{where}: an array of {array.dtype} cannot be kept in a file")
        dtype = array.dtype.name
        place = {"array": [dtype, self._sizes[dtype], list(array.shape)]}
        self._arrays[dtype].append(array.ravel())
        self._sizes[dtype] += array.size
        return place

    def _object(self, value: Any, where: str) -> Any:
        if isinstance(value, (Robot, Variants)):  # they say themselves what they are made from
            content = {"arguments": self.tree(value.__reduce__()[1], where)}
        elif dataclasses.is_dataclass(value) and _known(type(value)):
            fields = [f.name for f in dataclasses.fields(value) if f.init]
            content = {"fields": {n: self.tree(getattr(value, n), f"{where}.{n}") for n in fields}}
        else:
            raise TypeError(f"{where}: a {type(value).__name__} cannot be kept in a file")
        self.objects.append({"type": _name(type(value)), **content})
        return {"object": len(self.objects) - 1}


class Reader:
    """Turns trees back into values.

    Args:
        pools: The arrays that a `Writer` kept.
        objects: The trees of objects that it kept.

    Raises:
        ValueError: A tree names something that this package has not.
        KeyError: The pool of an array is missing.
        IndexError: An object is missing.
    """

    def __init__(self, pools: Mapping[str, np.ndarray], objects: Sequence[Any]) -> None:
        self._pools = pools
        self._objects: list[Any] = []
        for tree in objects:
            self._objects.append(self._made(tree))

    def value(self, tree: Any) -> Any:
        """What a tree stands for."""
        if isinstance(tree, list):
            return [self.value(item) for item in tree]
        if not isinstance(tree, dict):
            return tree
        (kind, content) = next(iter(tree.items()))
        if kind == "array":
            dtype, first, shape = content
            count = math.prod(shape)
            values = self._pools[dtype][first : first + count] if count else []
            return np.array(values, dtype).reshape(shape)
        if kind == "object":
            return self._objects[content]
        if kind == "tuple":
            return tuple(self.value(item) for item in content)
        return {key: self.value(item) for key, item in content}

    def _made(self, tree: Mapping[str, Any]) -> Any:
        made_of = _class(tree["type"])
        if made_of is Robot:
            return Robot(**self.value(tree["arguments"])[0])
        if made_of is Variants:
            return Variants(*self.value(tree["arguments"]))
        fields = {name: self.value(item) for name, item in tree["fields"].items()}
        made = made_of(**fields)
        # It has been checked. What was normalised twice may have changed in its last bit.
        for name, value in fields.items():
            if not isinstance(value, np.ndarray):
                object.__setattr__(made, name, value)
        return made


def format_of(path: str | os.PathLike[str]) -> str:
    """What a saved file says that it is.

    Raises:
        OSError: It cannot be read.
        ValueError: It is none of ours; the message names it.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return json.loads(file["header"].item())["format"]
    except OSError:
        raise
    except Exception as error:  # whatever a damaged file makes of its contents
        raise ValueError(f"{path}: this is neither a saved robot nor a saved result") from error


def check_header(header: Mapping[str, Any], form: str, version: int) -> None:
    """Refuse, with a ValueError, a file of another form or of another version of its layout."""
    if header.get("format") != form:
        raise ValueError(f"format {header.get('format')!r}, expected {form!r}")
    if header["version"] != version:
        raise ValueError(
            f"version {header['version']} of the layout, written by warp_springs "
            f"{header['warp_springs']}; this one reads version {version}"
        )


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
