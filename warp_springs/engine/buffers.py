"""Flat buffers as the kernels read them: aligned, with the lane as the innermost index."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

__all__ = ["aligned", "aligned_empty", "is_buffer", "lane_major"]


def lane_major(
    values: np.ndarray, robots: int, width: int, out: np.ndarray | None = None
) -> np.ndarray:
    """Flat values of ``robots`` equal robots with the lane as the innermost index.

    The last robot fills the lanes that are left over in the last bundle. ``out`` is written, if
    it is given.
    """
    if width == 1:
        if out is None:
            return values.ravel()
        out[:] = values.ravel()
        return out
    full, left, size = robots // width, robots % width, (len(values) // robots, *values.shape[1:])
    rows = values.reshape(robots, *size)
    shape = full + (left > 0), *size, width
    if out is None:
        out = aligned_empty(math.prod(shape), values.dtype)
    block = out.reshape(shape)
    block[:full] = np.moveaxis(rows[: full * width].reshape(full, width, *size), 1, -1)
    if left:
        block[full, ..., :left] = np.moveaxis(rows[full * width :], 0, -1)
        block[full, ..., left:] = rows[-1][..., None]
    return block.ravel()


def aligned_empty(count: int, dtype: np.dtype) -> np.ndarray:
    """So many numbers, to be written, from a 64-byte boundary on, as vector loads need."""
    buffer = np.empty(count * dtype.itemsize + 64, np.uint8)
    start = -buffer.ctypes.data % 64
    return buffer[start : start + count * dtype.itemsize].view(dtype)


def is_buffer(values: np.ndarray, dtype: np.dtype) -> bool:
    """Whether an array is as `aligned` makes them, and may be written to."""
    flags = values.flags
    good = values.dtype == dtype and flags.writeable and flags.c_contiguous
    return good and values.ctypes.data % 64 == 0


def aligned(parts: Sequence[np.ndarray], dtype: np.dtype) -> np.ndarray:
    """The parts joined in one array that starts on a 64-byte boundary, as vector loads need."""
    array = aligned_empty(sum(part.size for part in parts), dtype)
    if parts:
        np.concatenate(parts, out=array, casting="same_kind")
    return array
