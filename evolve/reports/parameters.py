"""Every parameter of a configuration, with what it means."""

from __future__ import annotations

from collections.abc import Iterator

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
            meaning = type(section).model_fields[name].description or ""
            yield prefix + name, _words(value), " ".join(meaning.split())


def _words(value: object) -> str:
    if value is None:
        return "not set"
    if isinstance(value, BaseModel):
        return ", ".join(f"{name} {_words(item)}" for name, item in value)
    if isinstance(value, tuple):
        return "[" + ", ".join(_words(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)
