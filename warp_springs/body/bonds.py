"""Masses held to a point, a line, a plane, a circle or a sphere: one form for all of them.

Each shape is the set of points c + P r, with a projector P (its directions of freedom), of which a
circle and a sphere keep those at a distance from c.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from warp_springs.geometry import FloatArray
from warp_springs.surfaces import Circle, Line, Plane, Sphere

__all__ = ["Bonds"]

_EMPTY = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Bonds:
    """Constraints of some masses, one each.

    Attributes:
        masses: Indices of the masses, shape (K,), each once.
        projectors: P, symmetric, shape (K, 3, 3): zero for a fixed mass.
        points: c [m], shape (K, 3).
        radii: Distance from c that circles and spheres keep [m], shape (K,); 0 for the others.
    """

    masses: np.ndarray = field(default_factory=lambda: _EMPTY)
    projectors: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    points: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    radii: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """All arrays."""
        return self.masses, self.projectors, self.points, self.radii

    def __len__(self) -> int:
        return len(self.masses)

    @classmethod
    def to_shape(cls, shape, masses: np.ndarray) -> Bonds:
        """Masses held to a plane, a line, a circle or a sphere.

        Raises:
            TypeError: The shape is something else.
        """
        radius = 0.0
        if isinstance(shape, (Plane, Circle)):
            normal = np.asarray(shape.normal)
            projector = np.eye(3) - np.outer(normal, normal)
            point = normal * shape.offset if isinstance(shape, Plane) else np.array(shape.center)
            radius = shape.radius if isinstance(shape, Circle) else 0.0
        elif isinstance(shape, Line):
            projector = np.outer(shape.direction, shape.direction)
            point = np.array(shape.point)
        elif isinstance(shape, Sphere):
            projector, point, radius = np.eye(3), np.array(shape.center), shape.radius
        else:
            raise TypeError(
                f"held_to: got {type(shape).__name__}, expected a Plane, Line, Circle or Sphere"
            )
        n = len(masses)
        return cls(
            np.asarray(masses, np.int64),
            np.tile(projector, (n, 1, 1)),
            np.tile(point, (n, 1)),
            np.full(n, radius),
        )

    @classmethod
    def to_axes(cls, free: FloatArray, masses: np.ndarray, positions: FloatArray) -> Bonds:
        """Masses that keep some coordinates: ``free`` is 1 for an axis of freedom, 0 for others."""
        n = len(masses)
        points = np.array(positions[masses], np.float64)
        return cls(np.asarray(masses), np.tile(np.diag(free), (n, 1, 1)), points, np.zeros(n))

    def joined(self, other: Bonds) -> Bonds:
        """Both; a mass that is in both is held to what the two have in common.

        Raises:
            ValueError: A mass would be held to two spheres or circles, or to shapes that have no
                point in common.
        """
        if not len(other):
            return self
        if not len(self):
            return other
        at = {int(mass): i for i, mass in enumerate(self.masses)}
        arrays = [array.copy() for array in self.arrays]
        fresh = []
        for j, mass in enumerate(other.masses.tolist()):
            if mass not in at:
                fresh.append(j)
                continue
            i = at[mass]
            ours = [array[i] for array in self.arrays[1:]]
            theirs = [array[j] for array in other.arrays[1:]]
            for array, value in zip(arrays[1:], _common(mass, ours, theirs), strict=True):
                array[i] = value
        pairs = zip(arrays, other.arrays, strict=True)
        return Bonds(*(np.concatenate([ours, theirs[fresh]]) for ours, theirs in pairs))

    def renamed(self, index: np.ndarray) -> Bonds:
        """The same constraints, of mass ``index[i]`` where they were of mass i."""
        return Bonds(index[self.masses].astype(np.int64), *self.arrays[1:]) if len(self) else self

    def moved(self, offset: FloatArray) -> Bonds:
        """Shifted with the body."""
        return Bonds(self.masses, self.projectors, self.points + offset, self.radii)

    def turned(self, turn: FloatArray, centre: FloatArray) -> Bonds:
        """Turned with the body."""
        projectors = turn @ self.projectors @ turn.T
        return Bonds(self.masses, projectors, centre + (self.points - centre) @ turn.T, self.radii)

    def scaled(self, factor: float) -> Bonds:
        """Scaled with the body, about the origin."""
        return Bonds(self.masses, self.projectors, self.points * factor, self.radii * factor)

    def put(self, positions: FloatArray, velocities: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions on the constraints and velocities along them, (..., M, 3) each.

        A mass at the centre of its circle or sphere goes some way, always the same.
        """
        if not len(self):
            return positions, velocities
        positions, velocities = np.array(positions), np.array(velocities)
        x, v = positions[..., self.masses, :], velocities[..., self.masses, :]
        arm = np.einsum("kij,...kj->...ki", self.projectors, x - self.points)
        v = np.einsum("kij,...kj->...ki", self.projectors, v)
        round_ = self.radii > 0.0
        length = np.sqrt((arm**2).sum(axis=-1))
        lost = round_ & (length == 0.0)
        column = np.argmax(np.abs(self.projectors).sum(axis=1), axis=1)
        arm = np.where(lost[..., None], self.projectors[np.arange(len(self)), column], arm)
        length = np.where(lost, np.sqrt((arm**2).sum(axis=-1)), length)
        unit = arm / np.where(round_, length, 1.0)[..., None]
        arm = np.where(round_[:, None], unit * self.radii[:, None], arm)
        radial = (v * unit).sum(axis=-1, keepdims=True) * unit
        positions[..., self.masses, :] = self.points + arm
        velocities[..., self.masses, :] = np.where(round_[:, None], v - radial, v)
        return positions, velocities


def _common(mass: int, one: list, two: list) -> tuple[FloatArray, FloatArray, float]:
    """Projector, point and radius of what two constraints have in common."""
    if one[2] > 0.0 and two[2] > 0.0:
        raise ValueError(f"held_to: mass {mass} is held to a circle or sphere already")
    if two[2] > 0.0:
        one, two = two, one
    # Directions of freedom of both are the eigenvectors of P1 P2 P1 with eigenvalue 1.
    values, vectors = np.linalg.eigh(one[0] @ two[0] @ one[0])
    free = vectors[:, values > 1.0 - 1e-9]
    # The point nearest to the first one's that meets both: (1 - P) (p - c) = 0 for each.
    lock = np.concatenate([np.eye(3) - one[0], np.eye(3) - two[0]])
    wanted = np.concatenate([np.zeros(3), (np.eye(3) - two[0]) @ (two[1] - one[1])])
    step = np.linalg.lstsq(lock, wanted, rcond=1e-9)[0]
    size = max(1.0, float(np.abs(wanted).max()))
    rest = one[2] ** 2 - step @ step if one[2] > 0.0 else 0.0
    if np.abs(lock @ step - wanted).max() > 1e-9 * size or rest < 0.0:
        raise ValueError(f"held_to: the constraints of mass {mass} have no point in common")
    return free @ free.T, one[1] + step, float(np.sqrt(rest)) if free.shape[1] else 0.0
