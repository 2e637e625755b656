"""Files that appear whole or not at all: written beside their place, then renamed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

__all__ = ["checked_output", "made_folder", "written_beside"]

_DRAFT = ".draft-"


def checked_output(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Path:
    """The path of a file to write, refused before any work is done if it cannot become one.

    Args:
        path: Where the file shall be.
        suffixes: What its name may end in, in lower case with the dot; any case is accepted.

    Raises:
        ValueError: The name ends in something else.
        OSError: The path is a folder, or its folder is missing or not writable.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"path: got {str(path)!r}, expected a name in {', '.join(suffixes)}")
    if path.is_dir():
        raise IsADirectoryError(f"path: {path} is a folder, expected a file")
    if not path.parent.is_dir():
        raise NotADirectoryError(f"path: there is no folder {path.parent} to write into")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"path: no permission to write into the folder {path.parent}")
    return path


def made_folder(path: Path) -> Path:
    """A folder to write into, made if it is missing, refused before any work is done.

    Raises:
        OSError: Something else is there, or nobody may write there.
    """
    if path.exists() and not path.is_dir():
        raise NotADirectoryError(f"out: {path} is no folder; choose another with --out")
    path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK | os.X_OK):
        raise PermissionError(f"out: no permission to write into the folder {path}")
    return path


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A path of the same name in a new folder beside; what is written there replaces ``path``.

    If the block raises, or the process dies, ``path`` stays as it was. What killed processes left
    is swept away by whoever writes into the same folder next.
    """
    _sweep(path.parent)
    with _new_folder(path.parent) as folder:
        draft = folder / path.name
        yield draft
        draft.replace(path)


@contextmanager
def _new_folder(parent: Path) -> Iterator[Path]:
    """A folder for drafts, locked by this process, so that nobody takes it for litter."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_DRAFT, dir=parent))
        lock = _lock(folder, wait=True)
        if folder.exists():  # nobody swept it away before it was locked
            break
        _unlock(lock)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _unlock(lock)


def _sweep(parent: Path) -> None:
    """Remove the drafts of processes that are gone: the system took their locks back."""
    for folder in parent.glob(f"{_DRAFT}*/"):
        lock = _lock(folder, wait=False)
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            _unlock(lock)


def _lock(folder: Path, wait: bool) -> int | None:
    """Lock a folder; None where another process has it, or nothing can be locked."""
    try:
        import fcntl
    except ImportError:  # not on Windows: drafts of killed processes stay there
        return None
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        os.close(handle)
        return None
    return handle


def _unlock(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)
