"""What the tests of the driver share: tiny configurations, and the shell as a real process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from evolve.config import RunConfig
from evolve.toml import load

ROOT = Path(__file__).parents[2]

TINY = {"population": 24, "generations": 4, "task.measure": 1.0, "simulation.threads": 1}
"""Changes to the cube preset that make a whole run last less than a second."""


@pytest.fixture
def tiny() -> RunConfig:
    return load("cube", TINY)


def environment() -> dict[str, str]:
    """The environment of a process that finds this source tree from any folder."""
    return os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "120"}


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "evolve.cli", *map(str, arguments)]


Shell = Callable[..., subprocess.CompletedProcess[str]]


def shell_in(folder: Path) -> Shell:
    """Run `evolve` in a folder: shell_in(folder)("run", "cube", "--seed", 3)."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command(*arguments),
            cwd=folder,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    return run


@pytest.fixture
def shell(tmp_path: Path) -> Shell:
    """Run `evolve` in an empty folder."""
    return shell_in(tmp_path)


def flags(config: dict[str, object] = TINY) -> list[str]:
    """Overrides of a configuration as arguments of `evolve run`."""
    return ["--set", *(f"{key}={value}" for key, value in config.items())]
