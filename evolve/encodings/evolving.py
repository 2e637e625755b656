"""What encodings of evolving bodies share: limits that are the same for all, fair and safe."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from evolve.encodings.base import EncodingSettings, Interval

__all__ = ["BodySettings", "EvolvingBody", "PacedSettings", "WeightSettings"]


class WeightSettings(EncodingSettings):
    """What evolved bodies weigh; the same for every encoding of bodies."""

    mass: float = Field(4.0, gt=0.0)
    """Mass of every robot, however many points it has [kg]."""
    mass_per_point: float | None = Field(None, gt=0.0)
    """Mean mass of a point instead, so that larger bodies weigh more [kg]."""

    def weight(self, points: int) -> float:
        """Mass of a robot of so many points [kg]."""
        return self.mass if self.mass_per_point is None else points * self.mass_per_point


class PacedSettings(EncodingSettings):
    """How often bodies change, where controllers may change without them."""

    body_rate: float = Field(1.0, ge=0.0, le=1.0)
    """Share of the mutations that may change the body; the others leave it time to learn."""


class BodySettings(WeightSettings):
    """What evolved bodies may measure and do; the same for every encoding of bodies."""

    largest_extent: float = Field(1.0, gt=0.0)
    """Longest side of the bounding box that a body may have [m]."""
    most_masses: int = Field(64, ge=4)
    """Points that a body may have."""
    most_springs: int = Field(400, ge=6)
    """Springs that a body may have."""
    rest_length: Interval = (0.9, 1.1)
    """Lowest and highest mean rest length, in initial lengths of the spring."""
    amplitude: float = Field(0.2, ge=0.0, lt=1.0)
    """Largest amplitude of the rest length, in initial lengths of the spring."""
    stiffness: Interval = (1000.0, 20000.0)
    """Lowest and highest stiffness [N/m]; genes are its logarithm."""


class EvolvingBody:
    """Every robot has a body of its own."""

    fixed_body: ClassVar[bool] = False
    needs_body: ClassVar[bool] = False

    def paced(
        self, genomes: np.ndarray, mutants: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """The mutants of genomes, arrays both; as many as the body rate says, others are tuned."""
        if self.settings.body_rate >= 1.0:
            return mutants
        bodies = rng.random(len(genomes)) < self.settings.body_rate
        bodies = bodies.reshape(-1, *[1] * (genomes.ndim - 1))
        return np.where(bodies, mutants, self.tune(genomes, rng))
