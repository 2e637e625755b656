"""Every parameter of a configuration, with what it means."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

from pydantic import BaseModel

from evolve.config import RunConfig

__all__ = ["parameters"]


def parameters(config: RunConfig) -> Iterator[tuple[str, str, str]]:
    """Name, value and meaning of every parameter: ("task.settle", "1", "How long they ...")."""
    yield from _walk(config, "")


def _walk(section: BaseModel, prefix: str) -> Iterator[tuple[str, str, str]]:
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            yield from _walk(value, f"{prefix}{name}.")
        else:
            meaning = _meaning(type(section), name)
            yield prefix + name, _words(value), meaning


def _words(value: object) -> str:
    if value is None:
        return "not set"
    if isinstance(value, tuple):
        return "[" + ", ".join(_words(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _meaning(model: type[BaseModel], name: str) -> str:
    """The text below a field in the class that declares it; empty where there is none."""
    for cls in model.__mro__:
        if name in vars(cls).get("__annotations__", {}):
            return _texts(cls).get(name, "")
    return ""


@cache
def _texts(cls: type) -> dict[str, str]:
    """The texts that stand below the fields of a class."""
    body = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0].body
    texts = {}
    for field, below in pairwise(body):
        named = isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        if named and text and isinstance(below.value.value, str):
            texts[field.target.id] = " ".join(below.value.value.split())
    return texts
