"""The verbs that place a robot in the world: move, turn, scale, throw and spin it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from warp_springs.body.elements import NONE, Elements
from warp_springs.body.fields import require_positive, require_vector
from warp_springs.geometry import cross_matrix, rotation_matrix

if TYPE_CHECKING:
    from warp_springs.robot import Robot

__all__ = ["Placing"]


class Placing:
    """Verbs of a robot; each returns a new robot, whose elements went with its body."""

    __slots__ = ()

    def moved(self, offset: ArrayLike) -> Robot:
        """The robot shifted by an offset [m], shape (3,)."""
        offset = require_vector("offset", offset)
        return self.replace(positions=self.positions + offset, **self._carried("moved", offset))

    def _carried(self, verb: str, *how: Any) -> dict[str, Elements]:
        """The elements that move, turn or grow with the body; nothing where it has none."""
        return {} if self.elements is NONE else {"elements": getattr(self.elements, verb)(*how)}

    def rotated(self, axis: ArrayLike, angle: float, about: ArrayLike | None = None) -> Robot:
        """The robot turned about an axis, its velocities with it.

        Args:
            axis: Direction of the axis, shape (3,), of any length but zero.
            angle: Angle [rad], counter-clockwise seen from the tip of the axis.
            about: A point on the axis [m], shape (3,); the centre of mass when left out.

        Raises:
            ValueError: The axis is zero, or a value is not finite.
        """
        turn = rotation_matrix(require_vector("axis", axis), angle)
        centre = self.center_of_mass if about is None else require_vector("about", about)
        changed = {"positions": centre + (self.positions - centre) @ turn.T}
        if self.velocities.any():
            changed["velocities"] = self.velocities @ turn.T
        return self.replace(**changed, **self._carried("turned", turn, centre))

    def scaled(self, factor: float) -> Robot:
        """The robot with positions, rest lengths and amplitudes multiplied by a factor > 0.

        Positions scale about the origin, so a body that stands on the ground still stands there.
        Masses, stiffness and velocities stay.

        Raises:
            ValueError: The factor is not finite or not positive.
        """
        factor = require_positive("factor", factor)
        return self.replace(
            positions=self.positions * factor,
            rest_length=self.rest_length * factor,
            amplitude=self.amplitude * factor,
            **self._carried("scaled", factor),
        )

    def moving(self, velocity: ArrayLike) -> Robot:
        """The robot with a velocity [m/s], shape (3,), added to every mass."""
        return self.replace(velocities=self.velocities + require_vector("velocity", velocity))

    def spinning(self, angular_velocity: ArrayLike) -> Robot:
        """The robot with a rigid rotation w x r about its centre of mass added.

        Args:
            angular_velocity: w [rad/s], shape (3,); r is measured from the centre of mass.
        """
        w = require_vector("angular_velocity", angular_velocity)
        arms = self.positions - self.center_of_mass
        return self.replace(velocities=self.velocities + arms @ cross_matrix(w).T)
