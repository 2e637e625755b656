"""Runs of numbers, and a curve that fills space, so that neighbours lie together in memory."""

from __future__ import annotations

import numpy as np

__all__ = ["along_curve", "ranges"]


def ranges(starts: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """All of ``start, start + 1, ...``, ``count`` numbers for each start, one after the other."""
    first = np.cumsum(counts) - counts
    return np.arange(counts.sum()) + np.repeat(starts - first, counts)


def along_curve(share: np.ndarray) -> np.ndarray:
    """Place of points of the unit cube, shape (n, 3), along a Z-shaped curve that fills it."""
    grid = (1023.0 * np.clip(np.nan_to_num(share, posinf=1.0), 0.0, 1.0)).astype(np.int64)
    code = np.zeros(len(grid), np.int64)
    for axis in range(3):
        for bit in range(10):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
