"""Memory that a generation used stays with the process, for the next generation."""

from __future__ import annotations

import ctypes
import functools
import sys

__all__ = ["keep_memory"]

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""What glibc's `mallopt` can be told, by its numbers in <malloc.h>."""
MOST = 1 << 25
"""Bytes of the largest array that is kept: as many as glibc allows."""


@functools.cache
def keep_memory() -> None:
    """Have the C library keep freed arrays instead of handing them back to the system.

    Every generation makes arrays of the same sizes, and the system clears each page before it
    hands it out again: a fifth of the driver's time. Where the C library is another, nothing
    happens.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(MMAP_THRESHOLD, MOST)
        mallopt(TRIM_THRESHOLD, 1 << 30)
