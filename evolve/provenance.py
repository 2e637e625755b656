"""Where a run comes from: what of its configuration decides its bits, and what computed it."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from evolve.config import RunConfig

__all__ = ["decisive", "origin"]


def decisive(config: RunConfig) -> dict[str, Any]:
    """What decides the bits of a record: dotted key -> value."""
    left_out = {
        "name": True,
        "about": True,
        "generations": True,
        "budget": True,
        "simulation": {"threads", "devices", "cluster"},
        "task": {"second_look"},
    }
    flat: dict[str, Any] = {}
    _flatten(json.loads(config.model_dump_json(exclude=left_out)), "", flat)
    return flat


def _flatten(table: Mapping[str, Any], prefix: str, flat: dict[str, Any]) -> None:
    for key, value in table.items():
        if isinstance(value, Mapping):
            _flatten(value, f"{prefix}{key}.", flat)
        else:
            flat[prefix + key] = value


def origin() -> dict[str, str]:
    """What made a run: versions and machine."""
    packages = {name: _version(name) for name in ("warp-springs", "warp-lang", "numpy")}
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    return {**packages, "python": platform.python_version(), "machine": machine}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed as a package"
