"""Nobody is simulated twice, and worker processes, killed ones too, change no bit."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

from evolve.errors import ConfigError, RunError
from evolve.judging.judge import Judge
from evolve.judging.pool import Pool
from evolve.judging.scores import Scores
from evolve.run import Run, evolve_together
from evolve.search import Search, judge_together
from evolve.toml import load
from tests.evolve.conftest import TINY
from tests.evolve.test_run import digest, evolved

SLOWER = TINY | {"task.measure": 40.0, "population": 64}
"""A generation lasts long enough for a worker to be killed in the middle of it."""


def scores(*fitness: float) -> Scores:
    n = len(fitness)
    return Scores(np.array(fitness), np.zeros(n), {"d": -np.array(fitness)}, np.full(n, 7))


def test_a_judge_asks_once_and_remembers():
    judge = Judge()
    blobs = [b"a", b"b", b"a", b"c"]
    new = judge.unknown(blobs)
    np.testing.assert_array_equal(new, [0, 1, 3])
    judge.learn([blobs[i] for i in new], scores(1.0, 2.0, 3.0))
    found = judge.recall(blobs, new)
    np.testing.assert_array_equal(found.fitness, [1.0, 2.0, 1.0, 3.0])
    np.testing.assert_array_equal(found.descriptors["d"], [-1.0, -2.0, -1.0, -3.0])
    np.testing.assert_array_equal(found.spring_evaluations, [7, 7, 0, 7])
    later = [b"d", b"c", b"b"]
    new = judge.unknown(later)
    np.testing.assert_array_equal(new, [0])
    judge.learn([b"d"], scores(4.0))
    judge.learn([b"a"], scores(9.0))  # known already: the first scores stay
    found = judge.recall([*later, b"a"], new)
    np.testing.assert_array_equal(found.fitness, [4.0, 3.0, 2.0, 1.0])
    np.testing.assert_array_equal(found.spring_evaluations, [7, 0, 0, 0])


def test_a_copy_is_not_simulated_again(tmp_path):
    # Without mutation, and with one parent, every child is a copy.
    changes = {"optimizer.crossover_rate": 1.0, "optimizer.mutation_rate": 0.0}
    config = load("cube", TINY | changes | {"optimizer.tournament": 24, "generations": 8})
    run = evolved(config, tmp_path / "run")
    with run.read() as store:
        costs = store.scores(range(1, 24 * 8 + 1)).spring_evaluations.reshape(8, 24)
        blobs = store.genomes(range(1, 24 * 8 + 1))
    assert (costs[0] > 0).all() and (costs[-1] == 0).any()
    assert (costs > 0).sum() == len(set(blobs))
    # A resumed run knows what the whole run knew.
    pieces = Run.create(config, tmp_path / "pieces")
    told = []
    pieces.evolve(told.append, lambda: len(told) > 3)
    Run.open(pieces.directory).evolve()
    with pieces.read() as store:
        again = store.scores(range(1, 24 * 8 + 1)).spring_evaluations.reshape(8, 24)
    np.testing.assert_array_equal(again, costs)


@pytest.mark.parametrize(
    ("budget", "generations"),
    [
        ({"budget.evaluations": 49}, 3),
        ({"budget.spring_evaluations": 24 * 28 * 2000.0 * 1.5}, 2),
        ({"budget.seconds": 1e-9}, 1),
    ],
)
def test_a_budget_ends_a_run(budget, generations):
    search = Search(load("cube", TINY | budget))
    while not search.finished:
        search.step()
    assert search.optimizer.generation == generations


# -- several seeds --------------------------------------------------------------------------------


def test_seeds_evolved_together_are_what_they_are_alone(tmp_path):
    configs = [load("cube", TINY | {"seed": seed}) for seed in (1, 2, 3)]
    alone = [digest(evolved(c, tmp_path / f"alone-{c.seed}")) for c in configs]
    runs = [Run.create(c, tmp_path / f"seed-{c.seed}") for c in configs]
    told = [[], [], []]
    started = time.monotonic()
    assert evolve_together(runs, [t.append for t in told])
    elapsed = time.monotonic() - started
    assert [digest(run) for run in runs] == alone
    spent = 0.0
    for run in runs:
        with run.read() as store:
            spent += sum(store.totals()[1:])
    assert 0.3 * elapsed < spent < elapsed, "each has its share of the time, none has all"
    assert [[p.generation for p in t] for t in told] == [[0, 1, 2, 3, 4]] * 3


def test_one_that_is_behind_catches_up(tmp_path):
    configs = [load("cube", TINY | {"seed": seed}) for seed in (1, 2)]
    alone = [digest(evolved(c, tmp_path / f"alone-{c.seed}")) for c in configs]
    runs = [Run.create(c, tmp_path / f"seed-{c.seed}") for c in configs]
    told = []
    runs[0].evolve(told.append, lambda: len(told) > 2)
    assert evolve_together(runs, [lambda progress: None] * 2)
    assert [digest(run) for run in runs] == alone


def test_perturbed_trials_of_several_seeds_stay_their_own(tmp_path):
    config = [load("cube", TINY | {"seed": s, "task.trials.count": 2}) for s in (1, 2)]
    alone = [digest(evolved(c, tmp_path / f"alone-{c.seed}")) for c in config]
    runs = [Run.create(c, tmp_path / f"seed-{c.seed}") for c in config]
    assert evolve_together(runs, [lambda progress: None] * 2)
    assert [digest(run) for run in runs] == alone


# -- worker processes -----------------------------------------------------------------------------


def test_worker_processes_change_no_bit(tmp_path):
    alone = digest(evolved(load("cube", TINY), tmp_path / "alone"))
    for count in (1, 2):
        config = load("cube", TINY | {"simulation.devices": ["cpu"] * count})
        assert digest(evolved(config, tmp_path / f"workers-{count}")) == alone


def test_a_killed_worker_is_replaced_and_changes_no_bit():
    alone, pooled = (
        Search(load("cube", SLOWER | {"simulation.devices": devices}))
        for devices in ([], ["cpu", "cpu"])
    )
    try:
        pooled.prepare()
        victims = pooled.simulator.processes
        killer = threading.Timer(0.05, os.kill, (victims[0], signal.SIGKILL))
        killer.start()
        pair = judge_together([alone])[0], judge_together([pooled])[0]
        killer.join()
        deadline = time.monotonic() + 20.0
        while victims[0] in pooled.simulator.processes and time.monotonic() < deadline:
            # It died after its work was done: the next generation will notice.
            pair = judge_together([alone])[0], judge_together([pooled])[0]
        assert victims[0] not in pooled.simulator.processes
        assert victims[1] in pooled.simulator.processes
        np.testing.assert_array_equal(pair[0].scores.fitness, pair[1].scores.fitness)
    finally:
        pooled.close()
    assert not any(_alive(pid) for pid in victims)


def test_a_worker_that_fails_says_why():
    config = load("cube", TINY | {"simulation.devices": ["cpu"]})
    pool = Pool(config)
    try:
        with pytest.raises(RunError, match=r"a worker on cpu failed: ValueError: genome 0 has 3"):
            pool.submit([], [b"abc"])()
        blobs = config.make_encoding().to_bytes(
            config.make_encoding().random(3, np.random.default_rng(1))
        )
        assert len(pool.submit([], blobs)()) == 3  # and works on
    finally:
        pool.close()


def test_devices_of_two_kinds_are_refused():
    with pytest.raises(ConfigError, match="are not all of the kind of device, cpu"):
        load("cube", {"simulation.devices": ["cpu", "cuda:0"]})


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


# -- steady state: asked ahead --------------------------------------------------------------------

STEADY = TINY | {"optimizer.type": "steady_state", "optimizer.living": 48, "generations": 6}


@pytest.mark.parametrize("ahead", [0, 1, 2])
def test_asking_ahead_changes_no_bit_on_any_number_of_workers_or_when_resumed(ahead, tmp_path):
    config = load("cube", STEADY | {"optimizer.ahead": ahead})
    whole = digest(evolved(config, tmp_path / "whole"))
    pieces = Run.create(config, tmp_path / "pieces")
    while True:
        told = []
        if pieces.evolve(told.append, lambda told=told: len(told) > 1):
            break
        pieces = Run.open(pieces.directory)
    assert digest(pieces) == whole
    if ahead == 1:
        two = load("cube", STEADY | {"simulation.devices": ["cpu", "cpu"]})
        assert digest(evolved(two, tmp_path / "two")) == whole


def test_children_descend_from_who_was_told_before_they_were_asked_for():
    search = Search(load("cube", STEADY | {"optimizer.ahead": 2, "generations": 8}))
    while not search.finished:
        generation = search.step()
        parents = generation.candidates.parents[generation.candidates.parents > 0]
        assert (parents <= 24 * max(generation.number - 2, 0)).all()
    assert len(parents) > 20 and not search.waiting
    assert search.optimizer.evaluations == 24 * 8
