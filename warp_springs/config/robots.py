"""Robots of a configuration: a body, what it is made of, how it moves, where it starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from warp_springs.config.bodies import AnyBody
from warp_springs.config.control import ControllerConfig
from warp_springs.config.muscles import (
    ActuationConfig,
    CableConfig,
    CurveConfig,
    DashpotConfig,
    HardeningConfig,
    LimitsConfig,
    MaterialConfig,
    OmegaConfig,
    StiffnessConfig,
    WaveformConfig,
    WinchConfig,
)
from warp_springs.config.points import (
    AnyHeld,
    FixedConfig,
    LoadConfig,
    PushConfig,
    ShoeConfig,
    TetherConfig,
)
from warp_springs.config.section import Section, Triple
from warp_springs.robot import Robot

__all__ = ["RobotConfig"]


class RotationConfig(Section):
    """A turn about an axis, before the body goes to its position."""

    axis: Triple = (0.0, 0.0, 1.0)
    """Of any length."""
    angle: float
    """[rad]"""
    about: Triple | None = None
    """A point on the axis [m]; the centre of mass when left out."""


class RobotConfig(Section):
    """A robot, or several copies of it."""

    name: str | None = None
    """What it is called; after its shape when left out."""
    body: AnyBody
    scale: float = Field(1.0, gt=0.0)
    """Of all lengths of the body."""
    materials: tuple[MaterialConfig, ...] = ()
    """Applied in this order."""
    weighed: bool = False
    """Whether the masses follow from the densities of the materials."""
    loads: tuple[LoadConfig, ...] = ()
    """Points with a mass of their own."""
    actuation: tuple[ActuationConfig, ...] = ()
    """A list of tables applied in this order, or one table."""
    waveforms: tuple[WaveformConfig, ...] = ()
    omegas: tuple[OmegaConfig, ...] = ()
    cables: CableConfig | None = None
    """Springs that only pull: {} for all."""
    curves: tuple[CurveConfig, ...] = ()
    hardening: tuple[HardeningConfig, ...] = ()
    dashpots: tuple[DashpotConfig, ...] = ()
    limits: tuple[LimitsConfig, ...] = ()
    stiffness: tuple[StiffnessConfig, ...] = ()
    winches: tuple[WinchConfig, ...] = ()
    controllers: tuple[ControllerConfig, ...] = ()
    fixed: tuple[FixedConfig, ...] = ()
    held: tuple[AnyHeld, ...] = ()
    tethers: tuple[TetherConfig, ...] = ()
    pushes: tuple[PushConfig, ...] = ()
    shoes: tuple[ShoeConfig, ...] = ()
    rotation: RotationConfig | None = None
    position: Triple = (0.0, 0.0, 0.0)
    """Where the origin of the body goes [m]."""
    positions: tuple[Triple, ...] = ()
    """Where a copy goes, each [m]; instead of the position and the number of copies."""
    velocity: Triple = (0.0, 0.0, 0.0)
    """[m/s]"""
    spin: Triple = (0.0, 0.0, 0.0)
    """Angular velocity about the centre of mass [rad/s]."""
    copies: int = Field(1, ge=1)
    """How many."""
    orientation: Literal["same", "random"] = "same"
    """Whether each copy is turned at random, all directions alike."""
    seed: int = Field(0, ge=0)
    """From which the random turns follow."""

    @model_validator(mode="after")
    def _copies_are_told_once(self) -> RobotConfig:
        if self.positions and (self.copies > 1 or any(self.position)):
            raise ValueError("give either positions, or a position and the number of copies")
        return self

    @field_validator("actuation", mode="before")
    @classmethod
    def _one_will_do(cls, value: Any) -> Any:
        return [value] if isinstance(value, Mapping) else value

    def build(self) -> list[Robot]:
        """Make the robot and its copies."""
        robot = self._assembled()
        places = self.positions or (self.position,) * self.copies
        if self.orientation == "same":
            return [self._started(robot, place) for place in places]
        rng = np.random.default_rng(self.seed)
        return [self._started(_turned(robot, rng), place) for place in places]

    def _assembled(self) -> Robot:
        """The body with all that goes with it wherever it goes."""
        robot = self.body.build()
        if self.scale != 1.0:
            robot = robot.scaled(self.scale)
        for entry in self.materials:
            robot = entry.applied(robot)
        if self.weighed:
            robot = robot.weighed()
        cables = () if self.cables is None else (self.cables,)
        for entry in (
            *self.loads,
            *self.actuation,
            *self.waveforms,
            *self.omegas,
            *cables,
            *self.curves,
            *self.hardening,
            *self.dashpots,
            *self.limits,
            *self.stiffness,
            *self.winches,
            *self.controllers,
            *self.fixed,
            *self.held,
            *self.tethers,
            *self.shoes,
        ):
            robot = entry.applied(robot)
        return robot

    def _started(self, robot: Robot, place: Triple) -> Robot:
        """The robot where it starts, and moving as it starts."""
        if self.rotation is not None:
            robot = robot.rotated(**self.rotation.model_dump())
        robot = robot.moved(place)
        if any(self.velocity):
            robot = robot.moving(self.velocity)
        if any(self.spin):
            robot = robot.spinning(self.spin)
        for push in self.pushes:  # forces are given in the world
            robot = push.applied(robot)
        return robot


def _turned(robot: Robot, rng: np.random.Generator) -> Robot:
    """The robot turned about its centre of mass, all orientations equally likely."""
    w, *axis = rng.normal(size=4)  # a unit quaternion, once normalised
    return robot.rotated(axis, 2.0 * math.atan2(float(np.linalg.norm(axis)), w))
