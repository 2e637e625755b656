"""Starting Warp without its banner, for programs that own their screen."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import warp as wp

__all__ = ["quiet"]


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
