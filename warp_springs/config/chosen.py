"""Which springs or masses of a robot a table of a configuration is about."""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from warp_springs.config.section import Section, Triple
from warp_springs.robot import Robot

__all__ = ["Masses", "Springs"]

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
