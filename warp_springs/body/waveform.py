"""Any periodic course of the rest length as harmonics, with the error that this makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.elements import frozen
from warp_springs.geometry import FloatArray

__all__ = ["Waveform"]

#: Points over one period at which a function is looked at.
SAMPLES = 4096


@dataclass(frozen=True, eq=False)
class Waveform:
    """mean + sum over h = 1, 2, ... of amplitudes[h-1] sin(h x + phases[h-1]), x from 0 to 2 pi.

    Attributes:
        mean: Mean over one period.
        amplitudes: Amplitude of each harmonic, shape (H,).
        phases: Phase of each harmonic [rad], shape (H,).
        error: Largest distance from what was asked for, over one period.
    """

    mean: float
    amplitudes: FloatArray
    phases: FloatArray
    error: float

    @classmethod
    def fit(
        cls, wave: ArrayLike | Callable[[FloatArray], ArrayLike], harmonics: int = 8
    ) -> Waveform:
        """The harmonics nearest to a wave in the mean square.

        Args:
            wave: Values at equal distances over one period (the end of the period is its start
                and left out), shape (n,), between them linear; or a function of x that takes an
                array over [0, 2 pi).
            harmonics: How many.

        Raises:
            ValueError: A value is not finite, or there are too few for so many harmonics.
        """
        if isinstance(harmonics, bool) or not isinstance(harmonics, int) or harmonics < 1:
            raise ValueError(f"harmonics: got {harmonics!r}, expected a whole number of 1 or more")
        x = np.arange(SAMPLES) * (2 * np.pi / SAMPLES)
        if callable(wave):
            values = np.broadcast_to(np.asarray(wave(x), np.float64), x.shape)
        else:
            table = np.asarray(wave, np.float64)
            if table.ndim != 1 or len(table) < 2 * harmonics + 1:
                raise ValueError(
                    f"wave: shape {table.shape} given, {2 * harmonics + 1} values or more "
                    f"expected for {harmonics} harmonics"
                )
            at = np.arange(len(table) + 1) * (2 * np.pi / len(table))
            values = np.interp(x, at, np.append(table, table[0]))
        if not np.isfinite(values).all():
            raise ValueError("wave: a value is not finite")
        spectrum = np.fft.rfft(values)[: harmonics + 1] / SAMPLES
        # a cos + b sin = A sin(h x + c) with a = A sin c, b = A cos c
        a, b = 2 * spectrum[1:].real, -2 * spectrum[1:].imag
        fitted = cls(float(spectrum[0].real), frozen(np.hypot(a, b)), frozen(np.arctan2(a, b)), 0.0)
        error = float(np.abs(fitted(x) - values).max())
        return cls(fitted.mean, fitted.amplitudes, fitted.phases, error)

    def __call__(self, x: ArrayLike) -> FloatArray:
        """Values at x [rad], of the same shape."""
        angle = np.asarray(x, np.float64)[..., None] * np.arange(1, len(self.amplitudes) + 1)
        return self.mean + (self.amplitudes * np.sin(angle + self.phases)).sum(axis=-1)
