"""The record of a run: one SQLite file that holds every evaluation and survives being killed.

A generation is one transaction, on the disk before the next one is told of: whatever moment the
process dies or the power fails at, the file holds whole generations and the state of the optimizer
after the last of them. The tables are made to be asked in SQL::

    -- everybody the champion descends from
    WITH RECURSIVE line(id) AS (
        SELECT :champion UNION SELECT parent FROM parent JOIN line ON child = line.id)
    SELECT id, generation, fitness FROM individual JOIN line USING (id) ORDER BY id;
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evolve import schema
from evolve.errors import StoreError
from evolve.judging.scores import Scores
from evolve.optimizers.base import NOBODY, Candidates
from evolve.record import Ancestor, Finalist, Record, Timing
from evolve.tidying import Tidying

if TYPE_CHECKING:
    from evolve.judging.second_look import SecondLook

__all__ = ["Store"]


class Store:
    """An open record. Use `create` for a new one, `open` for one that exists."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.path = path
        self._connection = connection
        self._tidying = Tidying(path)
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA wal_autocheckpoint = 0")  # see `Tidying`

    @classmethod
    def create(cls, path: Path, meta: Mapping[str, str], descriptors: Sequence[str]) -> Store:
        """Make the record of a run that has not begun, or open it if it is there already."""
        if path.exists() and schema.has_tables(path):
            return cls.open(path, write=True)
        connection = sqlite3.connect(path, isolation_level=None)
        connection.execute("PRAGMA page_size = 16384")
        connection.execute("PRAGMA journal_mode = WAL")
        columns = "".join(f', "{name}" REAL' for name in descriptors)
        store = cls(connection, path)
        with store._transaction():
            for statement in schema.SCHEMA.format(columns=columns).split(";"):
                connection.execute(statement)
            connection.executemany("INSERT INTO meta VALUES (?, ?)", meta.items())
            connection.execute(f"PRAGMA application_id = {schema.APPLICATION_ID}")
            connection.execute(f"PRAGMA user_version = {schema.VERSION}")
        return store

    @classmethod
    def open(cls, path: Path, write: bool = False) -> Store:
        """Open the record of a run.

        Raises:
            StoreError: The file does not exist, is broken, or was not written by this program or
                was written by a version with another format.
        """
        if not path.is_file():
            raise StoreError(f"there is no record {path}")
        # The last connection that may write tidies SQLite's log away, so even readers may.
        mode = "rw" if write or os.access(path, os.W_OK) else "ro"
        uri = f"{path.resolve().as_uri()}?mode={mode}"
        if not (write or os.access(path.parent, os.W_OK) or _log(path).exists()):
            uri += "&immutable=1"  # where nobody writes, SQLite cannot make the files of its log
        connection = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=30.0)
        try:
            schema.check(connection, path, thoroughly=write)
            connection.execute(f"PRAGMA query_only = {not write}")
        except BaseException:
            connection.close()
            raise
        return cls(connection, path)

    @staticmethod
    def check_format(path: Path) -> None:
        """Refuse a record of another format; whatever else is there, even nothing, is fine.

        Raises:
            StoreError: It was written by a version of this program with another format.
        """
        if path.is_file():
            with suppress(sqlite3.DatabaseError), closing(sqlite3.connect(path)) as connection:
                application, version = schema.marks(connection)
                if application == schema.APPLICATION_ID:
                    schema.check_version(path, version)

    def close(self) -> None:
        """Close the file; SQLite then folds its log into it."""
        self._tidying.end()
        self._connection.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- writing ---------------------------------------------------------------------------------

    def add_generation(
        self,
        number: int,
        candidates: Candidates,
        blobs: Sequence[bytes],
        scores: Scores,
        state: Mapping[str, np.ndarray],
        timing: Timing,
    ) -> None:
        """Record a generation and the state of the optimizer after it, all or nothing."""
        ids = candidates.ids.tolist()
        fitness = [x if np.isfinite(x) else None for x in scores.fitness.tolist()]
        cost = scores.spring_evaluations
        generation = (number, ids[-1], int(cost.sum()), timing.evaluation, timing.driver)
        rows = zip(
            ids, [number] * len(ids), fitness, scores.status.tolist(), cost.tolist(), blobs,
            strict=True,
        )  # fmt: skip
        parents = np.argwhere(candidates.parents != NOBODY)
        links = np.column_stack(
            [candidates.ids[parents[:, 0]], parents[:, 1], candidates.parents[tuple(parents.T)]]
        )
        described = zip(ids, *(v.tolist() for v in scores.descriptors.values()), strict=True)
        with self._transaction():
            execute, executemany = self._connection.execute, self._connection.executemany
            execute(
                "INSERT INTO generation (number, evaluations, spring_evaluations, "
                "evaluation_time, driver_time) VALUES (?, ?, ?, ?, ?)",
                generation,
            )
            executemany("INSERT INTO individual VALUES (?, ?, ?, ?, ?, ?)", rows)
            executemany("INSERT INTO parent VALUES (?, ?, ?)", links.tolist())
            columns = ", ".join(["individual", *(f'"{name}"' for name in scores.descriptors)])
            marks = ", ".join("?" * (1 + len(scores.descriptors)))
            executemany(f"INSERT INTO descriptor ({columns}) VALUES ({marks})", described)
            execute("DELETE FROM optimizer")
            executemany("INSERT INTO optimizer VALUES (?, ?, ?, ?)", map(_packed, state.items()))
        self._tidying.look()

    def put_second_look(self, ids: Iterable[int], look: SecondLook) -> None:
        """Record what was seen at the second look, in place of any earlier one."""
        columns = (
            look.dt, look.halved, look.halved_kept, look.perturbed, look.perturbed_kept,
            look.survives.astype(int),
        )  # fmt: skip
        rows = zip(ids, *(column.tolist() for column in columns), strict=True)
        with self._transaction():
            self._connection.execute("DELETE FROM second_look")
            self._connection.executemany(
                "INSERT INTO second_look VALUES (?, ?, ?, ?, ?, ?, ?)", rows
            )

    # -- reading ---------------------------------------------------------------------------------

    @property
    def meta(self) -> dict[str, str]:
        """What was noted when the run was created."""
        return dict(self._connection.execute("SELECT key, value FROM meta"))

    @property
    def generations(self) -> int:
        """How many generations are complete."""
        return self._connection.execute("SELECT count(*) FROM generation").fetchone()[0]

    def optimizer_state(self) -> dict[str, np.ndarray]:
        """State after the last complete generation; empty before the first."""
        rows = self._connection.execute("SELECT name, dtype, shape, data FROM optimizer")
        return {
            name: np.frombuffer(data, dtype).reshape(json.loads(shape))
            for name, dtype, shape, data in rows
        }

    def genomes(self, ids: Iterable[int]) -> list[bytes]:
        """The genomes of individuals, in the order of the ids."""
        query = "SELECT genome FROM individual WHERE id = ?"
        return [self._one(query, i)[0] for i in ids]

    def scores(self, ids: Iterable[int]) -> Scores:
        """The scores of individuals, in the order of the ids."""
        query = "SELECT fitness, status, spring_evaluations FROM individual WHERE id = ?"
        cursor = self._connection.execute("SELECT * FROM descriptor LIMIT 0")
        names = [column[0] for column in cursor.description[1:]]
        ids = list(ids)
        described = "SELECT * FROM descriptor WHERE individual = ?"
        rows = [self._one(query, i) + self._one(described, i)[1:] for i in ids]
        return _scores(rows, names)

    def descriptors(self, names: Sequence[str]) -> np.ndarray:
        """Some descriptors of everybody, in the order of the ids, shape (n, len(names)).

        Raises:
            StoreError: A descriptor was not recorded.
        """
        known = self._connection.execute("SELECT * FROM descriptor LIMIT 0").description
        known = [column[0] for column in known[1:]]
        for name in names:
            if name not in known:
                raise StoreError(f"{self.path} has no descriptor {name!r}: {', '.join(known)}")
        columns = ", ".join(f'"{name}"' for name in names)
        rows = self._connection.execute(f"SELECT {columns} FROM descriptor ORDER BY individual")
        return np.array(rows.fetchall(), dtype=np.float64).reshape(-1, len(names))

    def parents_of(self, individual: int) -> list[int]:
        """The ids of an individual's parents, the first parent first; none of the first ones."""
        query = "SELECT parent FROM parent WHERE child = ? ORDER BY place"
        return [row[0] for row in self._connection.execute(query, (int(individual),))]

    def ancestors(self, individual: int) -> list[Ancestor]:
        """An individual and everybody it descends from, the youngest first.

        Raises:
            StoreError: There is no such individual.
        """
        rows = self._connection.execute(
            "WITH RECURSIVE line(id) AS (SELECT ? UNION SELECT parent FROM parent JOIN line "
            "ON child = line.id) SELECT id, generation, fitness, "
            "(SELECT parent FROM parent WHERE child = id AND place = 0), "
            "(SELECT parent FROM parent WHERE child = id AND place = 1) "
            "FROM line JOIN individual USING (id) ORDER BY id DESC",
            (individual,),
        ).fetchall()
        if not rows:
            raise StoreError(f"{self.path} has no individual {individual}")
        return [
            Ancestor(*row[:2], np.nan if row[2] is None else row[2], tuple(p for p in row[3:] if p))
            for row in rows
        ]

    def judged(self, at_once: int = 1024) -> Iterator[tuple[list[bytes], Scores]]:
        """All genomes with their scores, some at a time, in the order of the ids."""
        columns = "genome, fitness, status, spring_evaluations, descriptor.*"
        rows = self._connection.execute(
            f"SELECT {columns} FROM individual JOIN descriptor ON id = individual ORDER BY id"
        )
        names = [column[0] for column in rows.description[5:]]
        while part := rows.fetchmany(at_once):
            yield [row[0] for row in part], _scores([row[1:4] + row[5:] for row in part], names)

    def record(self) -> Record:
        """All evaluations as columns."""
        rows = self._connection.execute(
            "SELECT id, generation, fitness, status FROM individual ORDER BY id"
        ).fetchall()
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        ids, generations, status = (table[:, i].astype(np.int64) for i in (0, 1, 3))
        return Record(ids, generations, table[:, 2], status)

    def table(self) -> tuple[list[str], Iterator[tuple]]:
        """Every evaluation with its parents and descriptors: the names of the columns, the rows."""
        cursor = self._connection.execute(
            "SELECT id, generation, fitness, status, spring_evaluations, first.parent AS parent_1, "
            "second.parent AS parent_2, descriptor.* FROM individual "
            "LEFT JOIN parent AS first ON first.child = id AND first.place = 0 "
            "LEFT JOIN parent AS second ON second.child = id AND second.place = 1 "
            "JOIN descriptor ON descriptor.individual = id ORDER BY id"
        )
        names = [column[0] for column in cursor.description]
        twice = names.index("individual")
        rows = (row[:twice] + row[twice + 1 :] for row in cursor)
        return names[:twice] + names[twice + 1 :], rows

    def best(self, count: int, below: float = np.inf) -> list[int]:
        """Ids of the best individuals below a fitness, the best first; equal genomes count once."""
        ranking = self._connection.execute(
            "SELECT id FROM individual WHERE fitness < ? ORDER BY fitness DESC, id", (below,)
        )
        chosen: dict[bytes, int] = {}
        for (individual,) in ranking:
            if len(chosen) == count:
                break
            chosen.setdefault(self.genomes([individual])[0], individual)
        return list(chosen.values())

    def finalists(self) -> list[Finalist]:
        """Everybody who was looked at twice; the champion, if there is one, is the first.

        Those who survive come before those who do not, the fittest first, of equals the older.
        """
        rows = self._connection.execute(
            "SELECT id, generation, fitness, dt, halved, halved_kept, perturbed, perturbed_kept, "
            "survives FROM second_look JOIN individual ON id = individual "
            "ORDER BY survives DESC, fitness DESC, id"
        )
        return [
            Finalist(*row[:4], *(np.nan if x is None else x for x in row[4:8]), bool(row[8]))
            for row in rows
        ]

    def costs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """After each generation: evaluations, spring evaluations and seconds so far, shape (G,)."""
        rows = self._connection.execute(
            "SELECT evaluations, spring_evaluations, evaluation_time + driver_time "
            "FROM generation ORDER BY number"
        ).fetchall()
        evaluations, springs, seconds = np.array(rows, np.float64).reshape(-1, 3).T
        return evaluations, np.cumsum(springs), np.cumsum(seconds)

    def totals(self) -> tuple[int, float, float]:
        """Spring evaluations, seconds of evaluation and seconds of the driver, of the whole run."""
        return self._connection.execute(
            "SELECT coalesce(sum(spring_evaluations), 0), coalesce(sum(evaluation_time), 0.0), "
            "coalesce(sum(driver_time), 0.0) FROM generation"
        ).fetchone()

    def digest(self) -> str:
        """A hash over everything the run decided: genomes, scores, parents. Not times."""
        digest = hashlib.sha256()
        for query in (
            "SELECT genome, id, generation, fitness, status FROM individual ORDER BY id",
            "SELECT x'', child, place, parent FROM parent ORDER BY child, place",
            "SELECT x'', * FROM descriptor ORDER BY individual",
        ):
            for blob, *values in self._connection.execute(query):
                digest.update(f"{len(blob)} {values}\n".encode())
                digest.update(blob)
        return digest.hexdigest()

    def _one(self, query: str, key: int) -> tuple:
        row = self._connection.execute(query, (int(key),)).fetchone()
        if row is None:
            raise StoreError(f"{self.path} has no individual {key}")
        return row

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """All of what happens within, or nothing."""
        try:
            self._connection.execute("BEGIN IMMEDIATE")
            yield
            self._connection.execute("COMMIT")
        except BaseException as error:
            if self._connection.in_transaction:  # SQLite leaves it by itself when the disk is full
                self._connection.execute("ROLLBACK")
            if isinstance(error, sqlite3.OperationalError):
                raise StoreError(f"{self.path} cannot be written: {error}") from error
            raise


def _log(path: Path) -> Path:
    """Where SQLite keeps what it has not yet folded into a record."""
    return path.with_name(path.name + "-wal")


def _scores(rows: Sequence[tuple], names: Sequence[str]) -> Scores:
    """Scores from rows of fitness, status, spring evaluations and the descriptors `names`."""
    described = np.array([row[3:] for row in rows], dtype=np.float64).reshape(-1, len(names))
    return Scores(
        fitness=np.array([row[0] for row in rows], dtype=np.float64),
        status=np.array([row[1] for row in rows]),
        descriptors={name: described[:, i] for i, name in enumerate(names)},
        spring_evaluations=np.array([row[2] for row in rows]),
    )


def _packed(item: tuple[str, np.ndarray]) -> tuple[str, str, str, bytes]:
    """A named array as a row: little-endian, so that it means the same on every machine."""
    name, array = item
    array = np.ascontiguousarray(array)
    array = array.astype(array.dtype.newbyteorder("<"))
    return name, array.dtype.str, json.dumps(array.shape), array.tobytes()
