"""The record of a run as tables that any program reads."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from evolve.errors import RunError
from evolve.run import Run

__all__ = ["write_table"]

ROWS_AT_ONCE = 65_536
"""Rows of a Parquet file that are held in memory together."""


def write_table(run: Run, path: Path) -> Path:
    """Write every evaluation as a row of a CSV or Parquet file and return its path.

    Columns: id, generation, fitness (empty: the robot was stopped), status (of
    ``warp_springs.Status``; 0 is OK), spring_evaluations, the ids of the parents (empty where
    there is none), and the descriptors.

    Args:
        run: A run, also one that is going on.
        path: File to write, ``.csv`` or ``.parquet`` (which needs the extra ``parquet``). It
            appears whole or not at all.

    Raises:
        RunError: The suffix is another, or the extra is not installed.
    """
    writers = {".csv": _write_csv, ".parquet": _write_parquet}
    if path.suffix not in writers:
        raise RunError(f"{path}: expected a name in {' or '.join(writers)}")
    draft = path.with_name(f".draft-{path.name}")
    with run.read() as store:
        names, rows = store.table()
        writers[path.suffix](draft, names, rows)
    draft.replace(path)
    return path


def _write_csv(path: Path, names: Sequence[str], rows: Iterator[tuple]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)


def _write_parquet(path: Path, names: Sequence[str], rows: Iterator[tuple]) -> None:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise RunError("Parquet needs pyarrow: pip install 'warp-springs[parquet]'") from None
    whole = {"id", "generation", "status", "spring_evaluations", "parent_1", "parent_2"}
    schema = pa.schema([(name, pa.int64() if name in whole else pa.float64()) for name in names])
    with pq.ParquetWriter(path, schema) as writer:
        while some := list(islice(rows, ROWS_AT_ONCE)):
            columns = zip(*some, strict=True)
            arrays = [pa.array(c, type=t.type) for c, t in zip(columns, schema, strict=True)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
