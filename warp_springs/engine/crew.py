"""The threads of this process that step and pack robots: started once, they wait for work."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

__all__ = ["crew", "each"]

Item = TypeVar("Item")


def crew(threads: int) -> ThreadPoolExecutor:
    """So many threads. A process that was forked has none of its parent's: it starts its own."""
    return _crew(threads, os.getpid())


@functools.cache
def _crew(threads: int, process: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="warp_springs")


def each(function: Callable[[Item], object], items: Sequence[Item], threads: int) -> None:
    """Call a function with each item, on so many threads."""
    if threads < 2 or len(items) < 2:
        for item in items:
            function(item)
    else:
        list(crew(threads).map(function, items))
