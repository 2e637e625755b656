"""Energies of the robots of a run, and the ledger that says where they come from and go to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Balance", "Energy"]


@dataclass(frozen=True)
class Energy:
    """Energy [J] of every robot at every frame; arrays of shape (N, F), float64.

    The first four are what a robot holds, the others what it was given or lost since the start of
    the run. ``residual`` is what the ledger cannot account for: it is the error of the integrator,
    of its order in dt, and a detector of energy from nowhere.

    Attributes:
        kinetic: sum of m v^2 / 2, with velocities synchronised with the positions.
        gravity: -sum of m g . x, zero at the origin; in water less what lifts, zero above it.
        spring: sum of k (L - L0(t))^2 / 2.
        ground: sum of K_G z^2 / 2 over the masses below z = 0; of K d^2 / 2 in obstacles.
        work: Work of the springs that change in time: the integral of -sum of k (L - L0) dL0/dt,
            and of dk/dt (L - L0)^2 / 2.
        damping_loss: Loss to the damping rate.
        drag_loss: Loss to drag; negative where a wind gives more than the drag takes.
        friction_loss: Loss to friction on the ground and on obstacles.
        outer_work: Work of forces from outside: pushes and soft constraints.
        dashpot_loss: Loss to the dashpots of springs.
        plastic_loss: Loss to springs that yielded or broke.
    """

    kinetic: np.ndarray
    gravity: np.ndarray
    spring: np.ndarray
    ground: np.ndarray
    work: np.ndarray
    damping_loss: np.ndarray
    drag_loss: np.ndarray
    friction_loss: np.ndarray
    outer_work: np.ndarray
    dashpot_loss: np.ndarray
    plastic_loss: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Kinetic, gravity, spring and ground energy, shape (N, F)."""
        with np.errstate(invalid="ignore"):  # infinities of a robot that was refused
            return self.kinetic + self.gravity + self.spring + self.ground

    @property
    def losses(self) -> np.ndarray:
        """Loss to damping, drag, friction, dashpots and plastic flow, shape (N, F)."""
        outside = self.damping_loss + self.drag_loss + self.friction_loss
        return outside + self.dashpot_loss + self.plastic_loss

    @property
    def residual(self) -> np.ndarray:
        """Change of the total since the first frame, less the work, plus the losses, (N, F)."""
        with np.errstate(invalid="ignore"):
            return self.total - self.total[:, :1] - self.work - self.outer_work + self.losses

    @property
    def gain(self) -> np.ndarray:
        """Energy from nowhere so far, as a part of the energy that came from somewhere, (N, F).

        The residual over what the robot held at the first frame (without its height), the height
        it lost since, and the work of its springs, of pushes and of the wind. 0.1 is a coarse
        step, 1 an explosion.
        """
        lowest = np.minimum.accumulate(self.gravity, axis=1)
        return _gain(self, lowest, np.maximum.accumulate(self._works, axis=1))

    @property
    def _works(self) -> np.ndarray:
        """Work of springs, pushes and wind, whichever way it went, shape (N, F)."""
        return np.abs(self.work) + np.abs(self.outer_work) + np.maximum(-self.drag_loss, 0.0)


def _gain(energy: Energy, lowest: np.ndarray, works: np.ndarray) -> np.ndarray:
    """`Energy.gain`, from the least energy of height and the most work up to each frame."""
    held = energy.kinetic[:, :1] + energy.spring[:, :1] + energy.ground[:, :1]
    given = held + energy.gravity[:, :1] - lowest + works
    return np.maximum(energy.residual, 0.0) / np.maximum(given, np.finfo(float).tiny)


class Balance:
    """Energy from nowhere, found look by look.

    Args:
        first: What robots have at the first look, in the order of the attributes of `Energy`, of
            shape (11, N).
    """

    def __init__(self, first: np.ndarray) -> None:
        self._first = np.array(first, np.float64)
        self._lowest, self._works = np.inf, 0.0

    def look(self, now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`Energy.gain` and `Energy.residual` of what robots have ``now``, (11, N): (N,) each."""
        table = np.stack([self._first, now], axis=-1)
        table[4:] -= table[4:, :, :1]
        energy = Energy(*table)
        self._lowest = np.minimum(self._lowest, energy.gravity)
        self._works = np.maximum(self._works, energy._works)
        return _gain(energy, self._lowest, self._works)[:, -1], energy.residual[:, -1]
