"""The record as Parquet, the course for TensorBoard, and how a champion came about."""

from __future__ import annotations

import sqlite3
import struct
import sys
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest
from tensorboardX.proto.event_pb2 import Event

from evolve.errors import RunError, StoreError
from evolve.reports.tables import write_table
from evolve.reports.tensorboard import FOLDER, Curves
from evolve.run import Run
from evolve.toml import load
from tests.evolve.conftest import TINY, shell_in


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Run:
    made = Run.create(load("cube", TINY), tmp_path_factory.mktemp("runs") / "cube")
    with Curves([made]) as curves:
        assert made.evolve(watch=curves.update)
    return made


def test_parquet_says_what_csv_says(run, tmp_path):
    table = pq.read_table(write_table(run, tmp_path / "record.parquet"))
    rows = write_table(run, tmp_path / "record.csv").read_text().splitlines()
    assert table.column_names == rows[0].split(",") and table.num_rows == len(rows) - 1
    read = [["" if x is None else str(x) for x in row.values()] for row in table.to_pylist()]
    assert [",".join(row) for row in read] == rows[1:]


def test_large_records_are_written_in_pieces(run, tmp_path, monkeypatch):
    monkeypatch.setattr("evolve.reports.tables.ROWS_AT_ONCE", 10)
    table = pq.read_table(write_table(run, tmp_path / "record.parquet"))
    assert table["id"].to_pylist() == list(range(1, 97))


def test_other_formats_and_missing_packages_are_one_clear_line(run, tmp_path, monkeypatch):
    with pytest.raises(RunError, match=r"record\.xls: expected a name in \.csv or \.parquet"):
        write_table(run, tmp_path / "record.xls")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RunError, match=r"warp-springs\[parquet\]"):
        write_table(run, tmp_path / "record.parquet")
    assert not (tmp_path / "record.parquet").exists()
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(RunError, match=r"warp-springs\[tensorboard\]"):
        Curves([run])


def test_tensorboard_gets_the_curve(run):
    (path,) = (run.directory / FOLDER).iterdir()
    data, at, curve = path.read_bytes(), 0, {}
    while at < len(data):  # records: length, its checksum, that many bytes, their checksum
        (length,) = struct.unpack_from("<Q", data, at)
        event = Event.FromString(data[at + 12 : at + 12 + length])
        at += 16 + length
        for value in event.summary.value:
            curve.setdefault(value.tag, {})[event.step] = value.simple_value
    with run.read() as store:
        fitness = np.fmax.accumulate(store.record().fitness)[[23, 47, 71, 95]]
    assert list(curve["fitness/best"]) == [24, 48, 72, 96]
    np.testing.assert_allclose(list(curve["fitness/best"].values()), fitness, rtol=1e-6)
    assert min(curve["speed/springs_per_second"].values()) > 0.0


def test_ancestors_are_found_as_by_walking_up_the_tree(run):
    with sqlite3.connect(run.record_path) as connection:
        parents = {}
        for child, parent in connection.execute("SELECT child, parent FROM parent ORDER BY place"):
            parents.setdefault(child, []).append(parent)
    waiting, found = [96], set()
    while waiting:
        if (one := waiting.pop()) not in found:
            found.add(one)
            waiting += parents.get(one, [])
    assert len(found) > 2
    with run.read() as store:
        line = store.ancestors(96)
        with pytest.raises(StoreError, match="has no individual 97"):
            store.ancestors(97)
    assert [one.id for one in line] == sorted(found, reverse=True)
    assert all(list(one.parents) == parents.get(one.id, []) for one in line)


def test_lineage_ends_with_the_fittest(run):
    shell = shell_in(run.directory.parent)
    done = shell("lineage", "cube", "--whole")
    assert done.returncode == 0, done.stderr
    with run.read() as store:
        (best,) = store.best(1)
        rows = [line.split() for line in done.stdout.splitlines() if line.startswith(" ")]
        rows = [row for row in rows if row and row[0].startswith("#")]
        assert rows[-1][0] == f"#{best}" and rows[0][-1] == "unrelated"
        numbers = [int(row[0][1:]) for row in rows]
        for parent, child in pairwise(numbers):
            assert parent in store.parents_of(child)
    nobody = shell("lineage", "cube", "--of", "1000")
    assert nobody.returncode == 1 and "has no individual 1000" in nobody.stderr
