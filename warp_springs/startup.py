"""For programs that own their screen: Warp without its banner, errors as one line."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import warp as wp

__all__ = ["one_line", "quiet"]


def one_line(error: BaseException) -> str:
    """What went wrong, in one line for a person; of the system's errors, which file it is about."""
    words = str(error)
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        words = f"{os.fsdecode(error.filename)}: {error.strerror}"
    return " ".join(words.split()) or type(error).__name__


def quiet() -> None:
    """Start Warp without its banner and messages about compiled modules; errors still show.

    Warp's native library writes to the standard error of the process that it found no CUDA driver,
    whatever its log level; on a machine without one that is no news, so that stream is closed
    while Warp starts. Programs with a screen of their own call this first.
    """
    wp.config.log_level = wp.LOG_ERROR
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
            wp.init()
    finally:
        os.dup2(kept, 2)
        os.close(kept)
