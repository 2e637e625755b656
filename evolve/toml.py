"""Configurations as text: reading TOML files and presets, overriding keys, writing run.toml."""

from __future__ import annotations

import difflib
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from evolve.config import RunConfig
from evolve.encodings import ENCODINGS
from evolve.errors import ConfigError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["dump", "load", "parse", "parse_settings", "preset_names", "validate"]


def preset_names() -> list[str]:
    """Names of the packaged presets, sorted."""
    folder = resources.files("evolve") / "presets"
    return sorted(p.name[:-5] for p in folder.iterdir() if p.name.endswith(".toml"))


def load(source: str | Path, overrides: Mapping[str, Any] | None = None) -> RunConfig:
    """Read a preset or a TOML file.

    Args:
        source: Name of a preset, or path of a TOML file.
        overrides: Dotted key -> value, e.g. {"optimizer.elites": 0.1}; replaces what was read.

    Raises:
        ConfigError: There is no such preset or file, or it does not describe a run.
    """
    path = Path(source)
    if path.suffix == ".toml" or path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise ConfigError(f"there is no file {source}") from None
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"cannot read {source}: {error}") from None
        return parse(text, str(source), overrides)
    names = preset_names()
    if str(source) not in names:
        raise ConfigError(
            f"there is no preset {str(source)!r}{_suggest(str(source), names)}; "
            f"presets are {', '.join(names)}, and files end in .toml"
        )
    preset = resources.files("evolve") / "presets" / f"{source}.toml"
    return parse(preset.read_text(encoding="utf-8"), f"preset {source}", overrides)


def parse(text: str, source: str, overrides: Mapping[str, Any] | None = None) -> RunConfig:
    """Read TOML text; `source` names it in errors. Raises ConfigError like `load`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source} is not valid TOML: {error}") from None
    for key, value in (overrides or {}).items():
        _override(data, key, value)
    return validate(data, source)


def validate(data: Mapping[str, Any], source: str) -> RunConfig:
    """Check a configuration given as nested tables. Raises ConfigError like `load`."""
    try:
        return RunConfig.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{source}: {_explain(error)}") from None


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Read "key=value" pairs, the values as TOML; a bare word is a string."""
    overrides = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f"--set takes KEY=VALUE such as task.measure=6, not {setting!r}")
        try:
            overrides[key.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            overrides[key.strip()] = value.strip()
    return overrides


def dump(config: RunConfig) -> str:
    """Write a configuration as TOML that `parse` reads back unchanged."""
    return "\n".join(_lines(config.model_dump(mode="json", exclude_none=True), ())) + "\n"


def _override(data: dict[str, Any], dotted: str, value: Any) -> None:
    """Set a key in nested tables, in place.

    A new kind of a section starts from its defaults; a new encoding keeps what it has in common
    with the one before.
    """
    *path, key = dotted.split(".")
    table = data
    for step in path:
        table = table.setdefault(step, {})
        if not isinstance(table, dict):
            raise ConfigError(f"{dotted}: {step} is a value, not a table")
    if key in ("type", "shape") and table.get(key) != value:
        kept = ENCODINGS[value].Settings.model_fields if _is_encoding(dotted, value) else ()
        for other in [name for name in table if name not in kept]:
            del table[other]
    table[key] = value


def _is_encoding(dotted: str, value: Any) -> bool:
    return dotted == "encoding.type" and value in ENCODINGS


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """The lines of a table: its values first, then the tables within."""
    if path:
        yield f"\n[{'.'.join(path)}]"
    # What a section is comes before what it is told.
    for key, value in sorted(table.items(), key=lambda item: item[0] not in ("shape", "type")):
        if not isinstance(value, Mapping):
            yield f"{key} = {_value(value)}"
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _lines(value, (*path, key))


def _value(value: Any) -> str:
    """A value in TOML. Strings need JSON's escapes and one more."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value).lower() if isinstance(value, bool) else repr(value)


def _explain(error: ValidationError) -> str:
    """The first of the errors of a configuration, in one line, and how many there are more."""
    errors = error.errors()
    first = errors[0]
    # Where a section may be one of several models, the path contains the name of the model.
    path = [str(step) for step in first["loc"]]
    if path and _is_tag(first["loc"]):
        del path[1]
    where, kind = ".".join(path), first["type"]
    if kind == "extra_forbidden":
        line = f"unknown key {where}{_suggest(path[-1], _known_keys())}"
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
        line = f"{where}: {message}, not {first['input']!r}" if where else message
    more = len(errors) - 1
    return line + (f" (and {more} more error{'s' * (more > 1)})" if more else "")


def _is_tag(location: tuple[Any, ...]) -> bool:
    """Whether the second step of an error's path is the name of a model, not a key."""
    section = RunConfig.model_fields.get(str(location[0]))
    return len(location) > 1 and section is not None and hasattr(section.annotation, "__args__")


def _known_keys() -> set[str]:
    """Every key of every section."""
    keys, waiting = set(), [RunConfig]
    while waiting:
        for key, field in waiting.pop().model_fields.items():
            keys.add(key)
            options = getattr(field.annotation, "__args__", (field.annotation,))
            waiting += [m for m in options if isinstance(m, type) and issubclass(m, BaseModel)]
    return keys


def _suggest(word: str, known: Iterable[str]) -> str:
    """A remark on the most similar known word, empty when none is similar."""
    close = difflib.get_close_matches(word, sorted(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
