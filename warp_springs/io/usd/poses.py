"""How bodies and their masses turn, as NumPy arrays: no USD type in here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

BENT = np.radians(45.0)
"""Angle between a spring and its place in the stiff body from which on masses turn on their own: a
bar that is not turned is then thinner by 30 %, seen from one side."""


def rigid_fit(rest: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centres (F, 3) and rotations (F, 3, 3) that carry a body's rest shape nearest to its frames.

    Kabsch 1976 (doi:10.1107/S0567739476001873), all frames at once. ``rest`` has shape (M, 3) and
    zero mean, ``frames`` (F, M, 3). A body that leaves the rotation open (a point, a line) takes
    the smallest one.
    """
    centres = frames.mean(axis=1)
    return centres, _nearest_turns(np.einsum("fmi,mj->fij", frames - centres[:, None], rest))


def bends(rest: FloatArray, springs: IntArray, frames: FloatArray) -> bool:
    """Whether, in any frame (F, M, 3), a spring has turned by `BENT` or more in its body."""
    if not len(springs):
        return False
    centres, turns = rigid_fit(rest, frames)
    now = _directions((frames - centres[:, None]) @ turns, springs)
    before = _directions(rest, springs)
    has_length = before.any(axis=1) & now.any(axis=2)
    return bool((np.einsum("fsi,si->fs", now, before)[has_length] < np.cos(BENT)).any())


def mass_turns(rest: FloatArray, springs: IntArray, local: FloatArray) -> FloatArray:
    """Rotations (F, M, 3, 3) that carry the springs at each mass nearest to where they point.

    ``local`` are frames (F, M, 3) of the body that ``rest`` (M, 3) is at rest. What the springs of
    a mass leave open, a line for example, takes the smallest rotation; a mass without springs does
    not turn.
    """
    products = np.einsum("fsi,sj->fsij", _directions(local, springs), _directions(rest, springs))
    ends = springs.T.ravel()  # a spring and its opposite have the same product
    order = np.argsort(ends, kind="stable")
    masses, starts = np.unique(ends[order], return_index=True)
    sums = np.zeros((*local.shape, 3))
    sums[:, masses] = np.add.reduceat(products[:, order % len(springs)], starts, axis=1)
    return _nearest_turns(sums)


def quaternions(rotations: FloatArray, before: FloatArray | None = None) -> FloatArray:
    """Unit quaternions (x, y, z, w), shape (F, ..., 4), of rotations (F, ..., 3, 3).

    Each has the sign nearer to the one before it, and the first to ``before`` (..., 4), so that a
    viewer that interpolates turns the short way. Shepperd 1978 (doi:10.2514/3.55767b).
    """
    r = rotations
    diagonal = np.diagonal(r, axis1=-2, axis2=-1)
    trace = diagonal.sum(axis=-1)
    # Row k of the symmetric matrix 4 q q^T for q = (x, y, z, w); the largest diagonal is safest.
    outer = np.empty((*r.shape[:-2], 4, 4))
    outer[..., :3, :3] = r + r.swapaxes(-1, -2)
    for axis in range(3):
        outer[..., axis, axis] = 1.0 + 2.0 * diagonal[..., axis] - trace
        j, k = (axis + 1) % 3, (axis + 2) % 3
        outer[..., axis, 3] = outer[..., 3, axis] = r[..., k, j] - r[..., j, k]
    outer[..., 3, 3] = 1.0 + trace
    best = np.diagonal(outer, axis1=-2, axis2=-1).argmax(axis=-1)
    q = np.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    earlier = np.concatenate([q[:1] if before is None else before[None], q[:-1]])
    turns = np.where(np.einsum("...i,...i->...", q, earlier) < 0.0, -1.0, 1.0)
    return q * np.cumprod(turns, axis=0)[..., None]


def _nearest_turns(covariances: FloatArray) -> FloatArray:
    """The rotations (..., 3, 3) nearest to matrices, the smallest where those leave it open."""
    spread = np.linalg.norm(covariances, axis=(-2, -1))
    # A trace of the identity decides what is left open, and is below a body's own noise.
    trace = np.where(spread > 0.0, 1e-9 * spread, 1.0)[..., None, None]
    left, _, right = np.linalg.svd(covariances + trace * np.eye(3))
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right


def _directions(positions: FloatArray, springs: IntArray) -> FloatArray:
    """Unit vectors along springs, (..., S, 3), of positions (..., M, 3); zero without a length."""
    along = positions[..., springs[:, 1], :] - positions[..., springs[:, 0], :]
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    return np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
