"""Energies of the robots of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Energy"]


@dataclass(frozen=True)
class Energy:
    """Mechanical energy [J] of every robot at every frame; arrays of shape (N, F), float64.

    Attributes:
        kinetic: sum of m v^2 / 2, with velocities synchronised with the positions.
        gravity: -sum of m g . x, zero at the origin.
        spring: sum of k (L - L0(t))^2 / 2.
        ground: sum of K_G z^2 / 2 over the masses below z = 0.
    """

    kinetic: np.ndarray
    gravity: np.ndarray
    spring: np.ndarray
    ground: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Sum of the four, shape (N, F); constant without actuation, losses and friction."""
        return self.kinetic + self.gravity + self.spring + self.ground
