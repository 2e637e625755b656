"""A seed gives the same record on threads, on workers, and across kills, of every kind of run."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from evolve.config import RunConfig
from evolve.run import Run
from evolve.store import Store
from evolve.toml import load
from tests.evolve.conftest import command, environment, flags
from tests.evolve.test_run import digest, evolved

SHORT = {"simulation.threads": 1, "task.measure": 1.0}
RUNS = {
    "cube": SHORT | {"population": 64, "generations": 14},
    "seeker": SHORT | {"population": 16, "generations": 6},
    "arms-race": SHORT | {"population": 12, "optimizer.opponents": 3, "generations": 6},
    "critter": SHORT | {"population": 24, "generations": 6},
}
"""Changes to presets: a fixed body, a closed loop, two populations, bodies that evolve."""
KILLS = {"cube": 10, "seeker": 3, "arms-race": 3, "critter": 3}
"""Real processes, killed at random moments."""


def configured(preset: str, more: dict[str, object]) -> RunConfig:
    return load(preset, RUNS[preset] | more)


@pytest.fixture(scope="module", params=RUNS)
def undisturbed(request, tmp_path_factory) -> Run:
    folder = tmp_path_factory.mktemp("runs") / request.param
    return evolved(configured(request.param, {}), folder)


@pytest.mark.parametrize("more", [{"simulation.threads": 2}, {"simulation.devices": ["cpu"] * 2}])
def test_neither_threads_nor_workers_change_a_bit(undisturbed, more, tmp_path):
    config = configured(undisturbed.config.name, more)
    assert digest(evolved(config, tmp_path / "run")) == digest(undisturbed)


def test_sigkill_at_random_moments_changes_nothing(undisturbed, tmp_path):
    # The first kill comes between the making of the folder and the end of the first generation,
    # the others whenever, possibly while the exports are written.
    folder, preset = tmp_path / "run", undisturbed.config.name
    rng = np.random.Generator(np.random.Philox(os.getpid()))
    arguments = command("run", preset, *flags(RUNS[preset]), "--out", folder)
    kills = 0
    for attempt in range(KILLS[preset]):
        process = subprocess.Popen(
            arguments, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        wait_for_folder(folder, process)
        time.sleep(rng.uniform(0.0, 0.05 if attempt == 0 else 2.0))
        process.send_signal(signal.SIGKILL)
        output = process.communicate()[0].decode()
        kills += process.returncode == -signal.SIGKILL
        assert process.returncode in (0, -signal.SIGKILL), output
        arguments = command("resume", folder)
    last = subprocess.run(arguments, env=environment(), capture_output=True, text=True, check=False)
    assert last.returncode == 0, last.stderr
    assert kills
    assert digest(Run.open(folder)) == digest(undisturbed)
    names = {path.name for path in folder.iterdir()}
    assert {"champion.usdc", "zoo.usdc", "zoo.png", "learning_curve.png", "dot_plot.png"} <= names
    assert not [name for name in names if name.startswith((".draft-", ".usd-"))]
    with Store.open(folder / "run.sqlite") as store:
        assert store.finalists()


def wait_for_folder(folder: Path, process: subprocess.Popen) -> None:
    """Wait until there is something to kill: before that a run has not begun."""
    until = time.monotonic() + 60.0
    while not (folder / "run.toml").exists() and process.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.001)
