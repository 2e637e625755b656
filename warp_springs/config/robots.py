"""Robots of a configuration: a body, what it is made of, how it moves, where it starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from warp_springs import materials, surfaces
from warp_springs.config.bodies import AnyBody
from warp_springs.config.section import Section, Triple, one_of
from warp_springs.robot import Robot

__all__ = ["RobotConfig"]

Box = tuple[Triple, Triple]


class Springs(Section):
    """Which springs: all, unless indices or a box around their middles are given."""

    springs: tuple[int, ...] | None = None
    """Indices."""
    box: Box | None = None
    """Lowest and highest corner, in the body's own coordinates [m]."""

    @model_validator(mode="after")
    def _one_choice(self) -> Springs:
        if self.springs is not None and self.box is not None:
            raise ValueError("give either springs or a box, not both")
        return self

    def rows(self, robot: Robot) -> np.ndarray:
        """Their indices."""
        if self.box is not None:
            return _within(robot.positions[robot.springs].mean(axis=1), self.box)
        return _indices("springs", self.springs, robot.n_springs)


class Masses(Section):
    """Which masses: all, unless indices or a box are given."""

    masses: tuple[int, ...] | None = None
    """Indices."""
    box: Box | None = None
    """Lowest and highest corner, in the body's own coordinates [m]."""

    @model_validator(mode="after")
    def _one_choice(self) -> Masses:
        if self.masses is not None and self.box is not None:
            raise ValueError("give either masses or a box, not both")
        return self

    def rows(self, robot: Robot) -> np.ndarray:
        """Their indices."""
        if self.box is not None:
            return _within(robot.positions, self.box)
        return _indices("masses", self.masses, robot.n_masses)


class MaterialConfig(Springs):
    """A material of some springs: one that exists, changed on request, or a new one."""

    name: str
    """bone, tissue, muscle, muscle2, nylon, or any other with a stiffness or a modulus."""
    stiffness: float | None = Field(None, gt=0.0)
    """[N/m]"""
    modulus: float | None = Field(None, gt=0.0)
    """Young's modulus of bars [Pa]."""
    section: float | None = Field(None, gt=0.0)
    """Cross-section [m^2]."""
    density: float | None = Field(None, gt=0.0)
    """[kg/m^3]"""
    strain: float | None = None
    """Amplitude of the rest length as a share of it."""
    phase: float | None = None
    """[rad]"""
    color: str | None = None
    """"#rrggbb"."""

    def material(self) -> materials.Material:
        """The material itself."""
        own = self.model_dump(exclude={"name", "springs", "box"}, exclude_none=True)
        known = materials.BUILT_IN.get(self.name)
        if known is None:
            return materials.Material(self.name, **own)
        if "stiffness" in own:
            own = {"modulus": None, **own}
        if "modulus" in own:
            own = {"stiffness": None, **own}
        return replace(known, **own)


class ActuationConfig(Springs):
    """Springs that breathe: L0(t) = L0 (1 + amplitude sin(omega t + phase))."""

    amplitude: float = 0.25
    """As a share of the rest length."""
    omega: float = Field(2.0 * math.pi)
    """Angular frequency of the robot [rad/s]."""
    phase: float | tuple[float, ...] | Literal["spread", "random"] = 0.0
    """[rad]; a number for each spring; evenly spread over a circle; or random."""
    seed: int = Field(0, ge=0)
    """From which random phases follow."""
    wave: Triple = (0.0, 0.0, 0.0)
    """Wave vector k [rad/m]: the phase of a spring whose middle is at x is less by k . x, so that
    the breathing travels along k."""
    harmonics: tuple[tuple[float, float], ...] = ()
    """Amplitude, as a share of the rest length, and phase [rad] of the harmonics 2, 3, ..."""

    @field_validator("phase", mode="before")
    @classmethod
    def _is_a_phase(cls, value: Any) -> Any:
        words = isinstance(value, str) and value in ("spread", "random")
        numbers = value if isinstance(value, (list, tuple)) else [value]
        if not words and any(isinstance(v, (str, bool, Mapping)) for v in numbers):
            raise ValueError("expected a number, a list of numbers, 'spread' or 'random'")
        return value

    def applied(self, robot: Robot) -> Robot:
        """The robot with these muscles."""
        rows = self.rows(robot)
        phase = self._phases(len(rows))
        phase = phase - robot.positions[robot.springs[rows]].mean(axis=1) @ np.array(self.wave)
        robot = robot.breathing(self.amplitude, self.omega, phase, rows)
        if not self.harmonics:
            return robot
        shares, phases = np.array(self.harmonics).T
        return robot.with_harmonics(robot.rest_length[rows, None] * shares, phases, rows)

    def _phases(self, count: int) -> np.ndarray:
        if self.phase == "spread":
            return np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
        if self.phase == "random":
            return np.random.default_rng(self.seed).uniform(0.0, 2.0 * math.pi, count)
        if isinstance(self.phase, tuple) and len(self.phase) != count:
            raise ValueError(f"actuation.phase: {len(self.phase)} given, for {count} springs")
        return np.broadcast_to(self.phase, count)


class LoadConfig(Masses):
    """The mass of some points."""

    mass: float = Field(gt=0.0)
    """Of each [kg]."""


class PushConfig(Masses):
    """A force on each of some masses for a while."""

    force: Triple
    """[N]"""
    start: float = Field(0.0, ge=0.0)
    """[s]"""
    duration: float | None = Field(None, gt=0.0)
    """[s]; for ever when left out."""


class FixedConfig(Masses):
    """Masses that keep some of their coordinates."""

    axes: str = Field("xyz", pattern="^[xyz]+$")
    """Which coordinates."""


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


class HeldConfig(Masses):
    """Masses held to a plane, a line, a circle or a sphere, in the body's own coordinates."""

    def shape(self) -> object:
        """What they are held to."""
        settings = self.model_dump(exclude={"type", "masses", "box"})
        return getattr(surfaces, type(self).__name__.removeprefix("To"))(**settings)


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


class ShoeConfig(Masses):
    """Masses with a skin of their own: its friction and stiffness hold on every surface."""

    static_friction: float | None = Field(None, ge=0.0)
    kinetic_friction: float | None = Field(None, ge=0.0)
    stiffness: float | None = Field(None, gt=0.0)
    """[N/m]"""


class DashpotConfig(Springs):
    """Dashpots beside springs."""

    ratio: float = Field(ge=0.0)
    """Of critical damping."""


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
    cables: Springs | None = None
    """Springs that only pull: {} for all."""
    dashpots: tuple[DashpotConfig, ...] = ()
    fixed: tuple[FixedConfig, ...] = ()
    held: tuple[one_of((ToPlane, ToLine, ToCircle, ToSphere), "type"), ...] = ()
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
            robot = robot.made_of(entry.material(), where=entry.rows(robot))
        if self.weighed:
            robot = robot.weighed()
        for entry in self.loads:
            masses = robot.masses.copy()
            masses[entry.rows(robot)] = entry.mass
            robot = robot.replace(masses=masses)
        for muscles in self.actuation:
            robot = muscles.applied(robot)
        if self.cables is not None:
            robot = robot.with_cables(self.cables.rows(robot))
        for entry in self.dashpots:
            robot = robot.with_dashpots(entry.ratio, entry.rows(robot))
        for entry in self.fixed:
            robot = robot.fixed(entry.rows(robot), entry.axes)
        for entry in self.held:
            robot = robot.held_to(entry.shape(), entry.rows(robot))
        for entry in self.tethers:
            end = math.inf if entry.end is None else entry.end
            settings = entry.model_dump(exclude={"masses", "box", "end"})
            robot = robot.tethered(entry.rows(robot), end=end, **settings)
        for entry in self.shoes:
            settings = entry.model_dump(exclude={"masses", "box"})
            robot = robot.shod(entry.rows(robot), **settings)
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
            duration = math.inf if push.duration is None else push.duration
            robot = robot.pushed(push.rows(robot), push.force, push.start, duration)
        return robot


def _turned(robot: Robot, rng: np.random.Generator) -> Robot:
    """The robot turned about its centre of mass, all orientations equally likely."""
    w, *axis = rng.normal(size=4)  # a unit quaternion, once normalised
    return robot.rotated(axis, 2.0 * math.atan2(float(np.linalg.norm(axis)), w))


def _within(points: np.ndarray, box: Box) -> np.ndarray:
    low, high = np.array(box)
    return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))


def _indices(what: str, given: tuple[int, ...] | None, count: int) -> np.ndarray:
    if given is None:
        return np.arange(count)
    for index in given:
        if not -count <= index < count:
            raise ValueError(f"{what}: {index} given, there are {count}")
    return np.array(given, np.intp) % count
