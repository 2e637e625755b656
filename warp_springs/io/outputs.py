"""Files that appear whole or not at all: written beside their place, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

__all__ = ["checked_output", "written_beside"]


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


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A path of the same name in a new folder beside; what is written there replaces ``path``.

    If the block raises, or the process dies, ``path`` stays as it was.
    """
    with tempfile.TemporaryDirectory(prefix=".draft-", dir=path.parent) as folder:
        draft = Path(folder, path.name)
        yield draft
        draft.replace(path)
