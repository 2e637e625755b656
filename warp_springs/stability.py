"""Health of the robots: why one was stopped, and the limits that stop it.

An evolutionary search makes absurd robots. Each robot of a batch carries its own status; one that
goes wrong is stopped where it was last good, and its neighbours do not change by one bit.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from warp_springs.checks import check_number

__all__ = ["Limits", "Status"]


class Status(enum.IntEnum):
    """Why a robot was stopped; ``OK`` is zero, so that any other value is true."""

    OK = 0
    #: A position or a velocity is infinite or not a number.
    NONFINITE = 1
    #: A spring is longer than ``Limits.stretch`` times the robot's longest spring.
    OVERSTRETCHED = 2
    #: A mass is faster than ``Limits.speed``.
    TOO_FAST = 3
    #: A number of the robot does not exist in the precision of the run; it was never stepped.
    INVALID = 4


@dataclass(frozen=True)
class Limits:
    """What a healthy robot stays within.

    Attributes:
        speed: Largest speed of a mass [m/s].
        stretch: Largest length of a spring, as a multiple of the longest spring of the robot
            (the largest of its initial lengths and of its rest lengths plus amplitudes).
    """

    speed: float = 1000.0
    stretch: float = 5.0

    def __post_init__(self) -> None:
        check_number("Limits.speed", self.speed, above=0.0)
        check_number("Limits.stretch", self.stretch, above=1.0)
