"""All keys of a configuration with their defaults and what they mean, in the form of TOML."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from warp_springs.config.text import in_toml

__all__ = ["reference"]

COLUMN = 34
"""Where the explanations begin."""


def reference(model: type[BaseModel]) -> str:
    """Every table that a configuration may hold, each once, with all its keys."""
    return "\n".join(_tables(model, "", set())) + "\n"


def _tables(model: type[BaseModel], path: str, seen: set[type]) -> Iterator[str]:
    seen.add(model)
    about = " ".join((model.__doc__ or "").split("\n\n")[0].split())
    if path:
        yield ""
        yield f"# {about}"
        yield path
    else:
        yield f"# {about}"
    inner = []
    for key, field in model.model_fields.items():
        models, several = _models(field.annotation)
        if models:
            inner.append((key, models, several))
        else:
            yield _line(key, field)
    bare = path.strip("[]")
    for key, models, several in inner:
        name = f"{bare}.{key}" if bare else key
        table = f"[[{name}]]" if several else f"[{name}]"
        if seen.issuperset(models):
            yield f"\n# {table}: {model.model_fields[key].description} Keys as above."
        for other in models:
            if other not in seen:
                yield from _tables(other, table, seen)


def _line(key: str, field: FieldInfo) -> str:
    kinds = [arg for arg in get_args(field.annotation) if isinstance(arg, str)]
    value = "..." if field.is_required() else in_toml(field.default)
    if len(kinds) == 1 and get_origin(field.annotation) is Literal:
        value = in_toml(kinds[0])
    words = " ".join((field.description or "").split())
    if field.is_required() and len(kinds) != 1:
        words = f"required. {words}".strip()
    elif field.default is None:
        value, words = "", f"nothing by default. {words}".strip()
    if len(kinds) > 1:
        words = f"{words} One of {', '.join(kinds)}.".strip()
    line = f"{key} = {value}".rstrip()
    return f"{line:<{COLUMN - 1}} # {words}" if words else line


def _models(annotation: Any) -> tuple[list[type[BaseModel]], bool]:
    """The models that a value may be, and whether it is a list of them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation], False
    origin, found, several = get_origin(annotation), [], False
    if origin in (Annotated, Union, types.UnionType, tuple):
        for argument in get_args(annotation):
            models, nested = _models(argument)
            found += models
            several |= nested
    return found, bool(found) and (several or origin is tuple)
