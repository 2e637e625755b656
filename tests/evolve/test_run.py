from __future__ import annotations

import math
import shutil
import subprocess
import sys

import numpy as np
import pytest

from evolve.errors import RunError, StoreError
from evolve.lock import Lock
from evolve.run import Run
from evolve.search import Search
from evolve.toml import load
from tests.evolve.conftest import TINY, environment


def digest(run: Run) -> str:
    with run.read() as store:
        return store.digest()


def evolved(config, folder) -> Run:
    run = Run.create(config, folder)
    assert run.evolve()
    return run


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Run:
    """A tiny run that nobody interrupted; not to be changed."""
    return evolved(load("cube", TINY), tmp_path_factory.mktemp("runs") / "tiny")


def test_the_record_holds_what_the_search_saw(finished):
    search = Search(finished.config)
    with finished.read() as store:
        for number in range(finished.config.generations):
            seen = search.step()
            assert seen.number == number
            ids = seen.candidates.ids
            np.testing.assert_array_equal(store.scores(ids).fitness, seen.scores.fitness)
            blobs = search.encoding.to_bytes(seen.candidates.genomes)
            assert store.genomes(ids) == blobs
        record = store.record()
    assert search.finished
    assert len(record.ids) == 24 * 4 == search.optimizer.evaluations
    assert np.nanmax(record.fitness) == search.optimizer.best_fitness


def test_the_digest_does_not_depend_on_threads_or_folders(finished, tmp_path):
    config = load("cube", TINY | {"simulation.threads": 2})
    assert digest(evolved(config, tmp_path / "elsewhere")) == digest(finished)


def test_another_seed_is_another_run(finished, tmp_path):
    other = evolved(load("cube", TINY | {"seed": 2, "generations": 1}), tmp_path / "other")
    assert digest(other) != digest(finished)


@pytest.mark.parametrize("optimizer", ["genetic", "hill_climber", "random"])
def test_a_run_stopped_after_every_generation_ends_the_same(optimizer, tmp_path):
    config = load("cube", TINY | {"optimizer.type": optimizer})
    whole = evolved(config, tmp_path / "whole")
    pieces = Run.create(config, tmp_path / "pieces")
    sessions = 0
    while True:
        told = []
        # Each session stops when it has done one generation.
        complete = pieces.evolve(told.append, lambda told=told: len(told) > 1)
        sessions += 1
        if complete:
            break
        pieces = Run.open(pieces.directory)
    assert sessions == config.generations
    assert digest(pieces) == digest(whole)


def test_progress_is_told_after_every_generation(tmp_path, tiny):
    told = []
    Run.create(tiny, tmp_path / "run").evolve(told.append)
    assert [p.generation for p in told] == [0, 1, 2, 3, 4]
    assert [p.evaluations for p in told] == [0, 24, 48, 72, 96]
    assert math.isnan(told[0].best_fitness) and math.isnan(told[0].remaining)
    last = told[-1]
    assert last.generations == 4 and last.failures == 0 and last.remaining == 0.0
    assert last.best_fitness >= last.median > 0.0
    assert last.springs_per_second > 1e6 and last.elapsed > 0.0
    assert [p.best_fitness for p in told[1:]] == sorted(p.best_fitness for p in told[1:])


def test_a_longer_run_begins_like_the_shorter_one(finished, tmp_path):
    config = load("cube", TINY | {"generations": 2})
    run = evolved(config, tmp_path / "run")
    assert digest(run) != digest(finished)
    run = Run.open(run.directory)
    run.change(generations=4, threads=2)
    assert Run.open(run.directory).config.generations == 4
    run.evolve()
    assert digest(run) == digest(finished)


def test_a_changed_configuration_is_not_continued(tmp_path, tiny):
    run = evolved(tiny, tmp_path / "run")
    path = run.directory / "run.toml"
    path.write_text(path.read_text().replace("tournament = 4", "tournament = 5"))
    with pytest.raises(RunError, match=r"was changed .* optimizer.tournament was 4, is 5;"):
        Run.open(run.directory).evolve()


def test_nothing_is_overwritten(finished, tmp_path, tiny):
    with pytest.raises(RunError, match=r"already holds a run; continue it with evolve resume"):
        Run.create(tiny, finished.directory)
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(RunError, match=r"is not empty \(thesis.txt\)"):
        Run.create(tiny, tmp_path)
    with pytest.raises(RunError, match=r"thesis.txt is a file"):
        Run.create(tiny, tmp_path / "thesis.txt")
    with pytest.raises(RunError, match=r"holds no run \(it has no run.toml\)"):
        Run.open(tmp_path)
    with pytest.raises(RunError, match=r"there is no folder .*nowhere"):
        Run.open(tmp_path / "nowhere")


def test_a_run_is_evolved_by_one_process_only(tmp_path, tiny):
    run = Run.create(tiny, tmp_path / "run")
    lock = Lock(run.directory / "run.lock")
    program = "import sys; from evolve.cli import main; main(['resume', sys.argv[1]])"
    other = subprocess.run(
        [sys.executable, "-c", program, str(run.directory)],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert other.returncode == 1
    assert other.stderr == f"evolve: {run.directory} is being evolved by another process\n"
    with pytest.raises(StoreError, match="by another process"):
        run.evolve()
    lock.release()
    assert run.evolve()


def test_what_a_killed_drawing_left_is_removed(tmp_path, tiny):
    run = Run.create(tiny, tmp_path / "run")

    def leave() -> None:
        (run.directory / ".draft-0123abcd").mkdir()
        (run.directory / ".draft-0123abcd/zoo.png").write_bytes(b"half a picture")
        (run.directory / ".usd-x1y2").mkdir()
        (run.directory / ".usd-x1y2/robots.usdc").write_bytes(b"half an animation")
        (run.directory / ".mine").write_text("not ours")

    def hidden() -> list[str]:
        return [path.name for path in run.directory.iterdir() if path.name.startswith(".")]

    leave()
    with run.exporting():
        assert hidden() == [".mine"]
        leave()
        with pytest.raises(StoreError, match="is being exported by another process"):
            run.exporting().__enter__()
        run.evolve(should_stop=lambda: True)
        assert len(hidden()) == 3, "they may belong to the one who is exporting"
    run.evolve(should_stop=lambda: True)
    assert hidden() == [".mine"]


def test_the_second_look_may_be_configured_afterwards(finished, tmp_path):
    folder = shutil.copytree(finished.directory, tmp_path / "run")
    path = folder / "run.toml"
    path.write_text(path.read_text().replace("trials = 16", "trials = 3"))
    run = Run.open(folder)
    assert run.config.task.second_look.trials == 3
    assert run.evolve()
    assert digest(run) == digest(finished)
