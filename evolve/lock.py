"""The lock that keeps two processes from doing the same to a run."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from evolve.errors import StoreError

__all__ = ["Lock"]


class Lock:
    """Keeps a second process from doing the same to a run; gone when its process is gone.

    It is the exclusive lock of an empty SQLite file: the operating system takes it back from a
    killed process, and readers of the record are not disturbed.
    """

    def __init__(self, path: Path, doing: str = "evolved") -> None:
        self._connection = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:
            self._connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            self._connection.close()
            if "locked" not in str(error):
                raise StoreError(f"{path.parent} cannot be written to: {error}") from None
            raise StoreError(f"{path.parent} is being {doing} by another process") from None

    def release(self) -> None:
        """Let others write."""
        self._connection.close()
