"""The log of a record is folded into its file beside the search, which does not wait for the disk.

SQLite appends what is written to a log and, now and then, copies it into the file and waits until
both are on the disk: a tenth of a generation. It may do so on a connection of its own while others
read and write. Whoever is killed meanwhile leaves a log, and whoever opens the file reads it.
"""

from __future__ import annotations

import sqlite3
import threading
from contextlib import closing, suppress
from pathlib import Path

__all__ = ["Tidying"]

LOG_SIZE = 1 << 24
"""Bytes of a log from which on it is folded in."""


class Tidying:
    """Folds the log of one record into it, by a thread that lives as long as it takes."""

    def __init__(self, path: Path) -> None:
        self._path, self._log = path, path.with_name(path.name + "-wal")
        self._thread: threading.Thread | None = None

    def look(self) -> None:
        """Begin, if the log is long and nobody is at it."""
        if self._thread is not None and self._thread.is_alive():
            return
        if self._log.exists() and self._log.stat().st_size >= LOG_SIZE:
            self._thread = threading.Thread(target=self._fold, name="evolve-tidying")
            self._thread.start()

    def end(self) -> None:
        """Wait until nobody is at it."""
        if self._thread is not None:
            self._thread.join()

    def _fold(self) -> None:
        # What cannot be folded in now stays in the log, which is as good.
        with suppress(sqlite3.Error), closing(sqlite3.connect(self._path)) as connection:
            connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
