"""Closed loops as tables of a configuration: sensors, a network, and the muscles it drives."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from warp_springs import sensors
from warp_springs.body.control import Controller, Growth
from warp_springs.config.chosen import Masses, Springs
from warp_springs.config.section import Section, Triple, one_of
from warp_springs.robot import Robot

__all__ = ["ControllerConfig"]


class Target(Section):
    """Something that a sensor looks at, in the world."""

    place: Triple
    """Where it is at the start [m]."""
    motion: Triple = (0.0, 0.0, 0.0)
    """How it moves [m/s]."""

    @property
    def where(self) -> dict[str, Triple]:
        """The place and how it moves."""
        return {"place": self.place, "motion": self.motion}


class Contact(Masses):
    """For each mass 1 where it is at or below the ground or an obstacle, else 0."""

    type: Literal["contact"]

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.contact(self.rows(robot))


class Force(Masses):
    """For each mass the force with which the ground and the obstacles push it."""

    type: Literal["force"]
    full: float = Field(gt=0.0)
    """[N] where the reading is 1."""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.force(self.rows(robot), self.full)


class Length(Springs):
    """For each spring how much longer it is than its rest length, as a part of it."""

    type: Literal["length"]
    full: float = Field(0.25, gt=0.0)
    """Part where the reading is 1."""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.length(self.rows(robot), self.full)


class Velocity(Section):
    """Velocity of the centre of mass forward, to the left and upward."""

    type: Literal["velocity"]
    full: float = Field(1.0, gt=0.0)
    """[m/s] where the reading is 1."""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.velocity(self.full)


class Tilt(Section):
    """Sines of pitch and roll."""

    type: Literal["tilt"]

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.tilt()


class Goal(Target):
    """Distance over the ground to a place, and its direction."""

    type: Literal["goal"]
    full: float = Field(1.0, gt=0.0)
    """Distance [m] where the reading is 1."""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.goal(full=self.full, **self.where)


class Light(Masses, Target):
    """Level of light of a lamp at each of some masses."""

    type: Literal["light"]
    full: float = Field(1.0, gt=0.0)
    """Distance [m] at which it is half of the lamp's."""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.light(self.rows(robot), full=self.full, **self.where)


class Clock(Section):
    """A rhythm: sine and cosine of 2 pi t / period."""

    type: Literal["clock"]
    period: float = Field(gt=0.0)
    """[s]"""

    def sensor(self, robot: Robot) -> sensors.Sensor:
        """The sensor itself."""
        return sensors.clock(self.period)


AnySensor = one_of((Contact, Force, Length, Velocity, Tilt, Goal, Light, Clock), "type")


class GrowthConfig(Section):
    """Outputs as the speed of a growth that is never undone."""

    speed: float = Field(0.5, gt=0.0)
    """Growth at an output of 1 [1/s]."""
    limit: float = Field(1.0, gt=0.0)
    """Largest growth of one output."""
    budget: float | None = Field(None, ge=0.0)
    """Largest sum of the growths of all outputs; any when left out."""

    def growth(self) -> Growth:
        """The growth itself."""
        return Growth(**self.model_dump(exclude_none=True))


class ControllerConfig(Springs):
    """A closed loop: sensors, a network, and the springs it drives; several drive different ones.

    Forward, left and up of its sensors are x, y and z of the body before it is rotated.
    """

    sensors: tuple[AnySensor, ...] = Field(min_length=1)
    """What it reads, in this order."""
    outputs: tuple[int, ...] | tuple[tuple[int, int], ...] | None = None
    """Which output each of its springs obeys, or which two; one for each when left out."""
    hidden: int = Field(8, ge=0)
    """Hidden neurons."""
    recurrent: bool = False
    """Whether they remember."""
    weights: tuple[float, ...] | None = None
    """Of the network: rows into the hidden neurons, then rows out of them, the last of each row is
    that of 1; random ones when left out."""
    spread: float = Field(1.0, ge=0.0)
    """Standard deviation of random weights."""
    seed: int = Field(0, ge=0)
    """From which random weights follow."""
    reach: float | tuple[float, ...] = 0.2
    """Largest change of a rest length, as a part of it, of all springs or of each."""
    rate: float = Field(20.0, gt=0.0)
    """Readings a second [1/s]."""
    response: float = Field(0.0, ge=0.0)
    """Time in which muscles come to 63 % of a new output [s]."""
    growth: GrowthConfig | None = None
    """Instead of changes that come and go."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with this closed loop."""
        brain = Controller(
            sensors=[entry.sensor(robot) for entry in self.sensors],
            muscles=self.rows(robot),
            outputs=self.outputs,
            hidden=self.hidden,
            recurrent=self.recurrent,
            reach=self.reach,
            rate=self.rate,
            response=self.response,
            growth=self.growth and self.growth.growth(),
        )
        weights = self.weights
        if weights is None:
            weights = self.spread * np.random.default_rng(self.seed).normal(size=brain.n_weights)
        return robot.controlled(brain.replace(weights=weights))
