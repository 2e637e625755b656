"""The threads of this process that step robots: started once, they wait for work."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor

__all__ = ["crew"]


def crew(threads: int) -> ThreadPoolExecutor:
    """So many threads. A process that was forked has none of its parent's: it starts its own."""
    return _crew(threads, os.getpid())


@functools.cache
def _crew(threads: int, process: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="warp_springs")
