"""What springs may have, as tables of a configuration: materials, rhythms, laws of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator

from warp_springs import materials
from warp_springs.body.waveform import Waveform
from warp_springs.config.chosen import Springs
from warp_springs.config.section import Triple
from warp_springs.robot import Robot

__all__ = [
    "ActuationConfig",
    "CableConfig",
    "CurveConfig",
    "DashpotConfig",
    "HardeningConfig",
    "LimitsConfig",
    "MaterialConfig",
    "OmegaConfig",
    "StiffnessConfig",
    "WaveformConfig",
    "WinchConfig",
]


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

    def applied(self, robot: Robot) -> Robot:
        """The robot made of it there."""
        return robot.made_of(self.material(), where=self.rows(robot))


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


class WaveformConfig(Springs):
    """Springs with any periodic course: L0(t) = L0 (1 + wave(omega t)), in place of actuation."""

    values: tuple[float, ...]
    """The wave at equal distances over one period, linear between them."""
    omega: float
    """Angular frequency of the robot [rad/s]."""
    harmonics: int = Field(8, ge=1)
    """How many the wave becomes; they need twice as many values and one more."""
    relative: bool = True
    """Whether the wave is a share of the rest length; else it is in metres and added to it."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these muscles."""
        wave = Waveform.fit(self.values, self.harmonics)
        return robot.with_waveform(wave, self.omega, self.rows(robot), relative=self.relative)


class OmegaConfig(Springs):
    """Springs that breathe with an angular frequency of their own."""

    omega: float
    """[rad/s]"""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these frequencies."""
        return robot.with_omegas(self.omega, self.rows(robot))


class CableConfig(Springs):
    """Springs that only pull."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these cables."""
        return robot.with_cables(self.rows(robot))


class CurveConfig(Springs):
    """Springs whose stiffness depends on their stretch, piecewise."""

    stretch: tuple[float, ...]
    """Stretches at which the stiffness changes [m], increasing."""
    stiffness: tuple[float, ...]
    """Below the first, between them and above the last, as parts of the spring's own."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these springs."""
        return robot.with_curve(self.stretch, self.stiffness, self.rows(robot))


class HardeningConfig(Springs):
    """Springs with a tension k s + cubic s^3 at a stretch s."""

    cubic: float = Field(ge=0.0)
    """[N/m^3]"""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these springs."""
        return robot.with_hardening(self.cubic, self.rows(robot))


class DashpotConfig(Springs):
    """Dashpots beside springs."""

    ratio: float = Field(ge=0.0)
    """Of critical damping."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these dashpots."""
        return robot.with_dashpots(self.ratio, self.rows(robot))


class LimitsConfig(Springs):
    """Springs that break, or yield, at a stress, or at a force where no area is given."""

    breaks: float | None = Field(None, gt=0.0)
    """[Pa], or [N]; from there on a spring is gone."""
    yields: float | None = Field(None, gt=0.0)
    """[Pa], or [N]; beyond it a spring flows, and keeps a new rest length."""
    area: float = Field(1.0, gt=0.0)
    """Cross-section [m^2]; 1 where limits are forces."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these limits."""
        return robot.with_limits(self.breaks, self.yields, self.rows(robot), area=self.area)


class TimedConfig(Springs):
    """Springs that change by a timetable, linear between its times."""

    times: tuple[float, ...]
    """Increasing, two or more [s]; constant before and after."""
    period: float = Field(0.0, ge=0.0)
    """After so many seconds the table begins again; 0: never [s]."""


class StiffnessConfig(TimedConfig):
    """Springs whose stiffness changes in time."""

    factors: tuple[float, ...]
    """Of the stiffness, one for each time."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these springs."""
        rows = self.rows(robot)
        return robot.with_stiffness_in_time(self.times, self.factors, rows, period=self.period)


class WinchConfig(TimedConfig):
    """Springs whose rest length is wound in or out."""

    offsets: tuple[float, ...]
    """What is added to the rest length [m], one for each time."""

    def applied(self, robot: Robot) -> Robot:
        """The robot with these winches."""
        rows = self.rows(robot)
        return robot.with_winch(self.times, self.offsets, rows, period=self.period)
