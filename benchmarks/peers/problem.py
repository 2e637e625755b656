"""The population that every program steps, as plain arrays; NumPy only, for any environment."""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

__all__ = ["Problem"]


@dataclass(frozen=True)
class Problem:
    """N robots of M masses and S springs on the classroom's ground, stepped by symplectic Euler.

    Without a ground (``ground_stiffness`` 0) nothing is hit; without amplitudes nothing breathes.

    Attributes:
        springs: Masses that each spring joins, the same for all robots, shape (S, 2), int32.
        masses: Masses [kg], shape (N, M).
        positions: Start [m], shape (N, M, 3).
        velocities: Start [m/s], shape (N, M, 3).
        stiffness: Spring constants [N/m], shape (N, S).
        rest_length: Mean rest lengths [m], shape (N, S).
        amplitude: Amplitudes of the rest lengths [m], shape (N, S).
        phase: Their phases [rad], shape (N, S).
        omega: Their angular frequency [rad/s], shape (N,).
        gravity: Acceleration [m/s^2], shape (3,).
        dt: Step [s].
        keep: Part of the velocity that a step leaves.
        ground_stiffness: Stiffness of the ground [N/m], 0 for none.
        static_friction: Coefficient of static friction.
        kinetic_friction: Coefficient of kinetic friction.
    """

    springs: np.ndarray
    masses: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    stiffness: np.ndarray
    rest_length: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    omega: np.ndarray
    gravity: np.ndarray
    dt: float
    keep: float
    ground_stiffness: float
    static_friction: float
    kinetic_friction: float

    @property
    def n_robots(self) -> int:
        """Number of robots N."""
        return len(self.masses)

    @property
    def n_masses(self) -> int:
        """Number of masses M of a robot."""
        return self.masses.shape[1]

    @property
    def n_springs(self) -> int:
        """Number of springs S of a robot."""
        return len(self.springs)

    def center_of_mass(self, positions: np.ndarray) -> np.ndarray:
        """Centers of mass (N, 3) of all robots where their masses are at ``positions``."""
        weights = self.masses / self.masses.sum(axis=1, keepdims=True)
        return np.einsum("nm,nmc->nc", weights, positions)

    def save(self, path: Path) -> None:
        """Write a .npz file."""
        np.savez(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load(cls, path: Path) -> "Problem":
        """Read what ``save`` wrote."""
        with np.load(path) as file:
            return cls(**{name: _plain(file[name]) for name in file.files})


def _plain(values: np.ndarray):
    """An array, or the number that it holds."""
    return values if values.ndim else values.item()
