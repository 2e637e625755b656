from __future__ import annotations

import shutil
import sqlite3

import numpy as np
import pytest

from evolve import tidying
from evolve.errors import StoreError
from evolve.judging.scores import Scores
from evolve.judging.second_look import SecondLook
from evolve.lock import Lock
from evolve.optimizers import NOBODY, Candidates
from evolve.record import Finalist, Timing
from evolve.schema import APPLICATION_ID, VERSION
from evolve.store import Store

DESCRIPTORS = ("height", "a name with spaces")


def make_scores() -> Scores:
    return Scores(
        fitness=np.array([0.1, 3.0, 2.0 / 3.0]),
        status=np.array([0, 2, 0]),
        descriptors={name: np.array([1.5, np.nan, -0.25]) for name in DESCRIPTORS},
        spring_evaluations=np.array([10, 4, 10]),
    )


def add(store: Store, number: int, genomes: list[bytes] | None = None) -> Candidates:
    ids = np.arange(3, dtype=np.int64) + 1 + 3 * number
    parents = np.full((3, 2), NOBODY)
    if number:
        parents[0] = ids[0] - 3, ids[0] - 1
        parents[1, 0] = ids[0] - 3
    candidates = Candidates(ids, None, parents)
    blobs = genomes or [bytes([number, i]) for i in range(3)]
    state = {"counters": ids, "matrix": np.eye(2) * number, "empty": np.empty(0, np.int64)}
    store.add_generation(number, candidates, blobs, make_scores(), state, Timing(1.0, 0.5))
    return candidates


@pytest.fixture
def store(tmp_path):
    with Store.create(tmp_path / "run.sqlite", {"config": "x = 1"}, DESCRIPTORS) as store:
        add(store, 0)
        add(store, 1)
        yield store


def test_everything_comes_back_exactly(store):
    scores, expected = store.scores([3, 1, 2, 6]), make_scores().take(np.array([2, 0, 1, 2]))
    np.testing.assert_array_equal(scores.fitness, expected.fitness)
    np.testing.assert_array_equal(scores.status, expected.status)
    np.testing.assert_array_equal(scores.spring_evaluations, expected.spring_evaluations)
    assert list(scores.descriptors) == list(DESCRIPTORS)
    for name in DESCRIPTORS:
        np.testing.assert_array_equal(scores.descriptors[name], expected.descriptors[name])
    assert store.genomes([5, 2]) == [b"\x01\x01", b"\x00\x01"]
    assert store.meta == {"config": "x = 1"}
    assert store.generations == 2
    assert store.totals() == (48, 2.0, 1.0)
    record = store.record()
    np.testing.assert_array_equal(record.ids, np.arange(1, 7))
    np.testing.assert_array_equal(record.generations, [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(record.fitness, np.tile(make_scores().fitness, 2))


def test_the_state_of_the_optimizer_is_the_latest(store):
    state = store.optimizer_state()
    np.testing.assert_array_equal(state["counters"], [4, 5, 6])
    np.testing.assert_array_equal(state["matrix"], np.eye(2))
    assert state["empty"].shape == (0,)


def test_an_empty_record(tmp_path):
    with Store.create(tmp_path / "run.sqlite", {}, DESCRIPTORS) as store:
        assert store.optimizer_state() == {}
        assert store.generations == 0 and len(store.record().ids) == 0
        assert store.best(9) == [] and store.finalists() == []
        assert store.totals() == (0, 0.0, 0.0)


def test_a_generation_is_recorded_whole_or_not_at_all(store):
    before = store.digest()
    with pytest.raises(sqlite3.Error):
        add(store, 2, genomes=[b"x", b"y", object()])
    assert store.digest() == before and store.generations == 2
    add(store, 2)
    assert store.generations == 3


def test_parents_are_found_in_sql(store):
    with sqlite3.connect(store.path) as connection:
        query = """
            WITH RECURSIVE line(id) AS (
                SELECT 4 UNION SELECT parent FROM parent JOIN line ON child = line.id)
            SELECT id, generation, fitness FROM individual JOIN line USING (id) ORDER BY id"""
        rows = connection.execute(query).fetchall()
    assert rows == [(1, 0, 0.1), (3, 0, 2.0 / 3.0), (4, 1, 0.1)]


def test_the_best_are_different_and_have_a_fitness(store):
    assert store.best(9) == [3, 6, 1, 4], "equal fitness: the older first; 2 and 5 were stopped"
    assert store.best(1) == [3]
    add(store, 2, genomes=[b"\x00\x00", b"new", b"\x00\x02"])
    assert store.best(9) == [3, 6, 1, 4], "7 and 9 repeat the genomes of 1 and 3"


def test_finalists_are_ordered_champion_first(store):
    look = SecondLook(
        dt=np.array([1e-4, 1e-4, 5e-5]),
        halved=np.array([0.1, np.nan, 0.1]),
        halved_kept=np.array([0.15, np.nan, 1.0]),
        perturbed=np.array([0.5, 0.6, 0.09]),
        perturbed_kept=np.array([0.75, 0.9, 0.9]),
        survives=np.array([False, False, True]),
    )
    store.put_second_look([3, 6, 1], look)
    finalists = store.finalists()
    assert [f.id for f in finalists] == [1, 3, 6]
    assert finalists[0] == Finalist(1, 0, 0.1, 5e-5, 0.1, 1.0, 0.09, 0.9, True)
    assert np.isnan([finalists[2].halved, finalists[2].halved_kept]).all()
    assert finalists[2].perturbed == 0.6 and not finalists[2].survives


def test_a_second_look_replaces_the_one_before_and_decides_nothing(store):
    before = store.digest()
    figures = np.ones(2)
    look = SecondLook(figures, figures, figures, figures, figures, figures > 0.0)
    store.put_second_look([3, 6], look)
    store.put_second_look([4, 1], look)
    assert [f.id for f in store.finalists()] == [1, 4]
    assert store.digest() == before


def test_the_digest_changes_with_every_decision_and_with_nothing_else(store):
    before = store.digest()
    with sqlite3.connect(store.path) as connection:
        connection.execute("UPDATE generation SET driver_time = 99, finished = 'now'")
        connection.execute("UPDATE individual SET spring_evaluations = 0")
        connection.commit()
        assert store.digest() == before
        for change in (
            "UPDATE individual SET genome = x'00' WHERE id = 5",
            "UPDATE individual SET fitness = 0.1000000001 WHERE id = 1",
            "UPDATE individual SET status = 1 WHERE id = 2",
            "UPDATE parent SET parent = 2 WHERE child = 5",
            "UPDATE descriptor SET height = 0 WHERE individual = 3",
        ):
            connection.execute(change)
            connection.commit()
            assert store.digest() != before
            before = store.digest()


def test_files_that_are_no_records_are_refused(tmp_path):
    path = tmp_path / "run.sqlite"
    with pytest.raises(StoreError, match="there is no record"):
        Store.open(path)
    path.write_bytes(b"this is no database, although it has some length" * 100)
    for open_it in (Store.open, lambda p: Store.create(p, {}, ())):
        with pytest.raises(StoreError, match=r"run\.sqlite cannot be read: file is not"):
            open_it(path)
    path.unlink()
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE something (x)")
    with pytest.raises(StoreError, match="is not the record of an evolution"):
        Store.open(path)


@pytest.mark.parametrize(("version", "age"), [(99, "a newer"), (1, "an older")])
def test_a_record_of_another_format_is_refused(store, version, age):
    store.close()
    Store.check_format(store.path)
    with sqlite3.connect(store.path) as connection:
        connection.execute(f"PRAGMA user_version = {version}")
    words = rf"{age} version of evolve \(format {version}, this one reads format {VERSION}\)"
    for refuse in (Store.open, Store.check_format):
        with pytest.raises(StoreError, match=words):
            refuse(store.path)
    with sqlite3.connect(store.path) as connection:
        assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION_ID,)


def test_only_records_have_a_format(tmp_path):
    path = tmp_path / "run.sqlite"
    Store.check_format(path)
    assert not path.exists()
    path.write_bytes(b"no database" * 1000)
    Store.check_format(path)


def test_a_damaged_record_is_refused(store):
    for number in range(2, 40):
        add(store, number, genomes=[bytes([number, i]) * 4000 for i in range(3)])
    store.close()
    data = bytearray(store.path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 40000] = b"\xa5" * 40000
    store.path.write_bytes(data)
    with pytest.raises(StoreError, match=r"run.sqlite (is damaged|cannot be read)"):
        Store.open(store.path, write=True)


def test_a_start_that_was_cut_short_is_started_again(tmp_path):
    path = tmp_path / "run.sqlite"
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
    with Store.create(path, {"a": "b"}, DESCRIPTORS) as store:
        assert store.meta == {"a": "b"}
    with Store.create(path, {"other": "meta"}, DESCRIPTORS) as store:
        assert store.meta == {"a": "b"}, "what exists is opened, not made anew"


def test_readers_do_not_write(store):
    with Store.open(store.path) as reader, pytest.raises(StoreError, match="cannot be written"):
        add(reader, 2)


def test_a_lock_is_exclusive_until_it_is_released(tmp_path):
    lock = Lock(tmp_path / "run.lock")
    with pytest.raises(StoreError, match="is being evolved by another process"):
        Lock(tmp_path / "run.lock")
    lock.release()
    Lock(tmp_path / "run.lock").release()


def test_the_log_is_folded_into_the_file_while_it_is_open(tmp_path, monkeypatch):
    monkeypatch.setattr(tidying, "LOG_SIZE", 0)
    path = tmp_path / "run.sqlite"
    with Store.create(path, {}, DESCRIPTORS) as store:
        for number in range(3):
            add(store, number)
            store._tidying.end()
        shutil.copy(path, tmp_path / "alone.sqlite")  # without the log beside it
        with Store.open(tmp_path / "alone.sqlite") as alone:
            assert alone.generations == 3
            assert alone.digest() == store.digest()


def test_a_full_disk_is_said_with_the_name_of_the_record(store):
    pages = store._connection.execute("PRAGMA page_count").fetchone()[0]
    store._connection.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(StoreError, match=r"run\.sqlite cannot be written: .*full"):
        for number in range(store.generations, 9):
            add(store, number, [bytes(20_000)] * 3)
    assert store.generations == number  # what fitted is kept
