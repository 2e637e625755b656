"""What single masses may have, as tables of a configuration: loads, forces, holds, skins."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from warp_springs import surfaces
from warp_springs.config.chosen import Masses
from warp_springs.config.section import Triple, one_of
from warp_springs.robot import Robot

__all__ = ["AnyHeld", "FixedConfig", "LoadConfig", "PushConfig", "ShoeConfig", "TetherConfig"]


class LoadConfig(Masses):
    """The mass of some points."""

    mass: float = Field(gt=0.0)
    """Of each [kg]."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these loads."""
        masses = robot.masses.copy()
        masses[self.rows(robot)] = self.mass
        return robot.replace(masses=masses)


class PushConfig(Masses):
    """A force on each of some masses for a while."""

    force: Triple
    """[N]"""
    start: float = Field(0.0, ge=0.0)
    """[s]"""
    duration: float | None = Field(None, gt=0.0)
    """[s]; for ever when left out."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these forces."""
        duration = math.inf if self.duration is None else self.duration
        return robot.pushed(self.rows(robot), self.force, self.start, duration)


class FixedConfig(Masses):
    """Masses that keep some of their coordinates."""

    axes: str = Field("xyz", pattern="^[xyz]+$")
    """Which coordinates."""

    def applied(self, robot: Robot) -> Robot:
        """The robot that is fixed there."""
        return robot.fixed(self.rows(robot), self.axes)


class TetherConfig(Masses):
    """Temporary springs from some masses to a point."""

    stiffness: float = Field(gt=0.0)
    """[N/m]"""
    point: Triple | None = None
    """In the body's own coordinates [m]; where each mass is when left out."""
    rest_length: float = Field(0.0, ge=0.0)
    """[m]"""
    start: float = Field(0.0, ge=0.0)
    """[s]"""
    end: float | None = Field(None, gt=0.0)
    """[s]; never when left out."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these tethers."""
        end = math.inf if self.end is None else self.end
        settings = self.model_dump(exclude={"masses", "box", "end"})
        return robot.tethered(self.rows(robot), end=end, **settings)


class HeldConfig(Masses):
    """Masses held to a plane, a line, a circle or a sphere, in the body's own coordinates."""

    def shape(self) -> object:
        """What they are held to."""
        settings = self.model_dump(exclude={"type", "masses", "box"})
        return getattr(surfaces, type(self).__name__.removeprefix("To"))(**settings)

    def applied(self, robot: Robot) -> Robot:
        """The robot that is held there."""
        return robot.held_to(self.shape(), self.rows(robot))


class ToPlane(HeldConfig):
    """The plane normal . p = offset."""

    type: Literal["plane"]
    normal: Triple
    """Of any length."""
    offset: float = 0.0
    """[m]"""


class ToLine(HeldConfig):
    """A line."""

    type: Literal["line"]
    point: Triple
    """[m]"""
    direction: Triple
    """Of any length."""


class ToCircle(HeldConfig):
    """A circle."""

    type: Literal["circle"]
    center: Triple
    """[m]"""
    normal: Triple
    """Of any length."""
    radius: float = Field(gt=0.0)
    """[m]"""


class ToSphere(HeldConfig):
    """A sphere."""

    type: Literal["sphere"]
    center: Triple
    """[m]"""
    radius: float = Field(gt=0.0)
    """[m]"""


AnyHeld = one_of((ToPlane, ToLine, ToCircle, ToSphere), "type")


class ShoeConfig(Masses):
    """Masses with a skin of their own: its friction and stiffness hold on every surface."""

    static_friction: float | None = Field(None, ge=0.0)
    kinetic_friction: float | None = Field(None, ge=0.0)
    stiffness: float | None = Field(None, gt=0.0)
    """[N/m]"""

    def applied(self, robot: Robot) -> Robot:
        """The robot with this skin."""
        return robot.shod(self.rows(robot), **self.model_dump(exclude={"masses", "box"}))
