"""Configurations as text: reading TOML files and presets, overriding keys, writing run.toml."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from evolve.config import RunConfig
from evolve.encodings import ENCODINGS
from evolve.errors import ConfigError
from warp_springs import config as configs

__all__ = ["dump", "load", "parse", "parse_settings", "preset_names", "validate"]

dump = configs.dump


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
        with _our_errors():
            text = configs.read_text(path)
        return parse(text, str(source), overrides, path.parent)
    names = preset_names()
    if str(source) not in names:
        raise ConfigError(
            f"there is no preset {str(source)!r}{configs.suggest(str(source), names)}; "
            f"presets are {', '.join(names)}, and files end in .toml"
        )
    preset = resources.files("evolve") / "presets" / f"{source}.toml"
    return parse(preset.read_text(encoding="utf-8"), f"preset {source}", overrides)


def parse(
    text: str,
    source: str,
    overrides: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> RunConfig:
    """Read TOML text; `source` names it in errors, files lie in `folder`. Errors as of `load`."""
    with _our_errors():
        return configs.parse(RunConfig, text, source, overrides, kept=_common_keys, folder=folder)


def validate(data: Mapping[str, Any], source: str) -> RunConfig:
    """Check a configuration given as nested tables. Raises ConfigError like `load`."""
    with _our_errors():
        return configs.validate(RunConfig, data, source)


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Read "key=value" pairs, the values as TOML; a bare word is a string."""
    with _our_errors():
        return configs.parse_settings(settings)


def _common_keys(key: str, value: Any) -> Container[str]:
    """A new encoding keeps what it has in common with the one before."""
    if key == "encoding.type" and value in ENCODINGS:
        return ENCODINGS[value].Settings.model_fields
    return ()


@contextmanager
def _our_errors() -> Iterator[None]:
    try:
        yield
    except configs.ConfigError as error:
        raise ConfigError(str(error)) from None
