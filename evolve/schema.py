"""The tables of a record, and how a file is known to be one of this version."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from evolve.errors import StoreError

__all__ = ["APPLICATION_ID", "SCHEMA", "VERSION", "check", "check_version", "has_tables", "marks"]

APPLICATION_ID = 0x65766F6C
"""Marks the files of this program among all SQLite files ("evol")."""
VERSION = 2

SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE generation (
    number INTEGER PRIMARY KEY,
    evaluations INTEGER NOT NULL,         -- of the run, up to and with this generation
    spring_evaluations INTEGER NOT NULL,  -- of this generation
    evaluation_time REAL NOT NULL,        -- simulating and scoring [s]
    driver_time REAL NOT NULL,            -- everything else [s]
    finished TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
);
CREATE TABLE individual (
    id INTEGER PRIMARY KEY,
    generation INTEGER NOT NULL REFERENCES generation (number),
    fitness REAL,                         -- NULL: the robot was stopped
    status INTEGER NOT NULL,              -- of warp_springs.Status
    spring_evaluations INTEGER NOT NULL,
    genome BLOB NOT NULL
);
CREATE TABLE parent (
    child INTEGER NOT NULL REFERENCES individual (id),
    place INTEGER NOT NULL,               -- 0: first parent, 1: second
    parent INTEGER NOT NULL REFERENCES individual (id),
    PRIMARY KEY (child, place)
) WITHOUT ROWID;
CREATE TABLE descriptor (individual INTEGER PRIMARY KEY REFERENCES individual (id){columns});
CREATE TABLE second_look (
    individual INTEGER PRIMARY KEY REFERENCES individual (id),
    dt REAL NOT NULL,                     -- half the first step, or the stable one [s]
    halved REAL,                          -- fitness at this step in float64
    halved_kept REAL,                     -- that / first fitness
    perturbed REAL,                       -- quantile of the fitness from perturbed starts
    perturbed_kept REAL,                  -- that / first fitness
    survives INTEGER NOT NULL             -- 1: enough is left of both
);
CREATE TABLE optimizer (name TEXT PRIMARY KEY, dtype TEXT NOT NULL, shape TEXT NOT NULL,
    data BLOB NOT NULL) WITHOUT ROWID;
"""


def has_tables(path: Path) -> bool:
    """Whether a file is a record, or anything else than one that was killed at its creation."""
    try:
        with closing(sqlite3.connect(path)) as connection:
            return bool(connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0])
    except sqlite3.DatabaseError:
        return True


def check(connection: sqlite3.Connection, path: Path, thoroughly: bool) -> None:
    """Refuse what is not a sound record of this version."""
    try:
        application, version = marks(connection)
        problem = connection.execute("PRAGMA quick_check(1)").fetchone()[0] if thoroughly else "ok"
    except sqlite3.DatabaseError as error:
        raise StoreError(f"{path} cannot be read: {error}") from None
    if application != APPLICATION_ID:
        raise StoreError(f"{path} is not the record of an evolution")
    check_version(path, version)
    if problem != "ok":
        raise StoreError(f"{path} is damaged: {problem.splitlines()[-1]}")


def marks(connection: sqlite3.Connection) -> tuple[int, int]:
    """Whose file it is, and the version of its format."""
    names = ("application_id", "user_version")
    application, version = (connection.execute(f"PRAGMA {n}").fetchone()[0] for n in names)
    return application, version


def check_version(path: Path, version: int) -> None:
    """Refuse a format that this version does not read."""
    if version != VERSION:
        raise StoreError(
            f"{path} was written by {'a newer' if version > VERSION else 'an older'} "
            f"version of evolve (format {version}, this one reads format {VERSION}); "
            "start its run.toml again with evolve run, or use that version"
        )
