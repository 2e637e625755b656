"""The record of a run as tables that any program reads."""

from __future__ import annotations

import csv
from pathlib import Path

from evolve.run import Run

__all__ = ["write_csv"]


def write_csv(run: Run, path: Path | None = None) -> Path:
    """Write every evaluation as a row of a CSV file and return its path.

    Columns: id, generation, fitness (empty: the robot was stopped), status (of
    ``warp_springs.Status``; 0 is OK), spring_evaluations, the ids of the parents (empty where
    there is none), and the descriptors.

    Args:
        run: A run, also one that is going on.
        path: File to write; ``record.csv`` in the folder of the run by default. It appears whole
            or not at all.
    """
    path = run.directory / "record.csv" if path is None else path
    draft = path.with_name(f".draft-{path.name}")
    with run.read() as store, draft.open("w", newline="", encoding="utf-8") as file:
        names, rows = store.table()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)
    draft.replace(path)
    return path
