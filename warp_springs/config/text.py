"""Configurations as text: reading TOML, overriding keys, explaining mistakes, writing TOML."""

from __future__ import annotations

import difflib
import json
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "ConfigError",
    "dump",
    "in_toml",
    "parse",
    "parse_settings",
    "read_text",
    "suggest",
    "tables",
    "validate",
]

Model = TypeVar("Model", bound=BaseModel)
_KINDS = ("shape", "type")
"""Keys that say which of several models a section is."""


class ConfigError(ValueError):
    """A configuration is wrong. The message is one line that says where and what."""


def read_text(path: Path) -> str:
    """The text of a file. Raises ConfigError where there is none."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"there is no file {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read {path}: {error}") from None


def parse(
    model: type[Model],
    text: str,
    source: str,
    overrides: Mapping[str, Any] | None = None,
    kept: Callable[[str, Any], Container[str]] = lambda key, value: (),
    folder: Path | None = None,
) -> Model:
    """Read TOML text.

    Args:
        model: What it describes.
        text: The text.
        source: Names it in errors.
        overrides: Dotted key -> value, e.g. {"scene.damping": 0.1, "robots.0.body.edge": 0.2};
            replaces what was read. A new kind of a section starts from its defaults.
        kept: Which keys of a section survive when a key, dotted, gives it another kind.
        folder: Where the files lie that it names by relative paths; where we are if left out.

    Raises:
        ConfigError: It is no TOML, or does not describe such a thing.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source} is not valid TOML: {error}") from None
    for key, value in (overrides or {}).items():
        _override(data, key, value, kept)
    return validate(model, data, source, folder)


def validate(
    model: type[Model], data: Mapping[str, Any], source: str, folder: Path | None = None
) -> Model:
    """Check a configuration given as nested tables. Arguments and errors as of `parse`."""
    try:
        return model.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise ConfigError(f"{source}: {_explain(error, model, data)}") from None


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Read "key=value" pairs, the values as TOML; a bare word is a string."""
    overrides = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f"--set takes KEY=VALUE such as scene.damping=2, not {setting!r}")
        try:
            overrides[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            overrides[key.strip()] = value.strip()
    return overrides


def dump(config: BaseModel) -> str:
    """Write a configuration as TOML that `parse` reads back unchanged."""
    return "\n".join(_lines(tables(config), ())) + "\n"


def tables(config: BaseModel) -> dict[str, Any]:
    """A configuration as nested tables of what TOML can hold; what is None is left out."""
    # pydantic would leave out what is None but written as something else, too.
    return _without_none(config.model_dump(mode="json"))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value


def suggest(word: str, known: Iterable[str]) -> str:
    """A remark on the most similar known word, empty when none is similar."""
    close = difflib.get_close_matches(word, sorted(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _override(data: dict[str, Any], dotted: str, value: Any, kept: Callable) -> None:
    """Set a key in nested tables, in place; see `parse`."""
    *path, key = dotted.split(".")
    table: Any = data
    for step in path:
        if isinstance(table, list):
            table = table[_index(dotted, step, table)]
        else:
            table = table.setdefault(step, {})
        if not isinstance(table, (dict, list)):
            raise ConfigError(f"{dotted}: {step} is a value, not a table")
    if isinstance(table, list):
        table[_index(dotted, key, table)] = value
        return
    if key in _KINDS and table.get(key) != value:
        stay = kept(dotted, value)
        for other in [name for name in table if name not in stay]:
            del table[other]
    table[key] = value


def _index(dotted: str, step: str, table: list) -> int:
    if not step.isdecimal() or int(step) >= len(table):
        raise ConfigError(f"{dotted}: {step} is not one of the {len(table)} entries, 0 the first")
    return int(step)


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """The lines of a table: its values first, then the tables within."""
    if path:
        yield f"\n[{'.'.join(path)}]"
    # What a section is comes before what it is told.
    for key, value in sorted(table.items(), key=lambda item: item[0] not in _KINDS):
        if not isinstance(value, Mapping):
            yield f"{_key(key)} = {in_toml(value)}"
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _lines(value, (*path, _key(key)))


def _key(key: str) -> str:
    bare = key and all(c.isascii() and (c.isalnum() or c in "_-") for c in key)
    return key if bare else in_toml(key)


def in_toml(value: Any) -> str:
    """A value in TOML. Strings need JSON's escapes and one more."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(in_toml, value))}]"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {in_toml(item)}" for key, item in value.items())
        return f"{{{inner}}}"
    return repr(value).lower() if isinstance(value, bool) else repr(value)


def _explain(error: ValidationError, model: type[BaseModel], data: Any) -> str:
    """The first of the errors of a configuration, in one line, and how many there are more."""
    errors = error.errors()
    first = errors[0]
    kind = first["type"]
    path = _keys(first["loc"], data, missing=kind == "missing")
    where = ".".join(path)
    if kind == "extra_forbidden":
        line = f"unknown key {where}{suggest(path[-1], _known_keys(model))}"
    elif kind == "missing":
        line = f"{where} is missing"
    elif kind.startswith("union_tag"):
        context = first["ctx"]
        key = context["discriminator"].strip("'")
        given = f"not {context['tag']!r}" if "tag" in context else "but there is none"
        choices = context.get("expected_tags", "a name")
        line = f"{where}.{key} must be one of {choices}, {given}"
    else:
        message = first["msg"].removeprefix("Value error, ")
        message = message[0].lower() + message[1:]
        value = first["input"]
        given = "" if isinstance(value, (Mapping, BaseModel)) else f", not {value!r}"
        line = f"{where}: {message}{given}" if where else message
    more = len(errors) - 1
    return line + (f" (and {more} more error{'s' * (more > 1)})" if more else "")


def _keys(location: tuple[Any, ...], data: Any, missing: bool) -> list[str]:
    """The keys on the way to an error, without the names of models and types among them."""
    path = []
    for number, step in enumerate(location):
        entries = dict(enumerate(data)) if isinstance(data, (list, tuple)) else data
        if isinstance(entries, Mapping) and step in entries:
            data = entries[step]
        elif not (missing and number == len(location) - 1):
            continue
        path.append(str(step))
    return path


def _known_keys(model: type[BaseModel]) -> set[str]:
    """Every key of every section."""
    keys: set[str] = set()
    waiting, seen = [model], set()
    while waiting:
        kind = waiting.pop()
        waiting += getattr(kind, "__args__", ())
        if isinstance(kind, type) and issubclass(kind, BaseModel) and kind not in seen:
            seen.add(kind)
            for key, field in kind.model_fields.items():
                keys.add(key)
                waiting.append(field.annotation)
    return keys
