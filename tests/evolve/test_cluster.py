"""Ray actors: the same bits as without, one of them killed in the middle of a generation."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest

from evolve.errors import ConfigError, RunError
from evolve.search import Search
from evolve.toml import load
from tests.evolve.conftest import TINY
from tests.evolve.test_judge import SLOWER

TWO = {"simulation.devices": ["cpu", "cpu"], "simulation.cluster": "local"}


def test_actors_change_no_bit_and_survive_a_kill():
    import ray

    alone, spread = Search(load("cube", SLOWER)), Search(load("cube", SLOWER | TWO))
    try:
        spread.prepare()
        pids = [ray.get(actor.__ray_call__.remote(_pid)) for actor in spread.simulator._actors]
        assert len({*pids, os.getpid()}) == 3
        killer = threading.Timer(0.05, os.kill, (pids[0], signal.SIGKILL))
        killer.start()
        for _ in range(2):
            ours, theirs = alone.step(), spread.step()
            np.testing.assert_array_equal(theirs.scores.fitness, ours.scores.fitness)
            assert theirs.blobs == ours.blobs
        killer.join()
        again = [ray.get(actor.__ray_call__.remote(_pid)) for actor in spread.simulator._actors]
        assert again[0] != pids[0] and again[1] == pids[1]
        with pytest.raises(RunError, match="an actor failed: ValueError: genome 0 has 3 bytes"):
            spread.simulator.submit([], [b"abc"])()
    finally:
        spread.close()
    assert not ray.is_initialized()


def _pid(workshop) -> int:
    return os.getpid()


def test_what_the_cluster_does_not_have_is_named():
    with pytest.raises(
        ConfigError, match=r"simulation: cluster: devices must say how many workers"
    ):
        load("cube", TINY | {"simulation.cluster": "local"})
    config = load("cube", TINY | TWO | {"simulation.cluster": "ray://127.0.0.1:1"})
    with pytest.raises(RunError, match=r"simulation\.cluster = 'ray://127\.0\.0\.1:1'"):
        Search(config)
