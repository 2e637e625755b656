"""What a controller may sense: each function makes a `Sensor`, of one reading or several.

Readings are numbers without a unit, about 1 in size: what is measured, divided by ``full``.
Forward, left and up are the body's own: those directions of the robot as it was when it got its
controller (x, y and z then), carried along as it moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.body.fields import require_vector
from warp_springs.checks import check_number

__all__ = ["Sensor", "clock", "contact", "force", "goal", "length", "light", "tilt", "velocity"]

#: Readings of each kind of sensor: a number, or "each": one for every mass or spring.
READINGS = {
    "contact": "each",
    "force": "each",
    "length": "each",
    "velocity": 3,
    "tilt": 2,
    "goal": 3,
    "light": "each",
    "clock": 2,
}
KINDS = tuple(READINGS)
#: Those that look at a place.
TARGETS = ("goal", "light")

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Sensor:
    """One sensor; made by the functions of this module.

    Attributes:
        kind: What it measures, the name of the function.
        of: The masses it sits on, or the springs it measures.
        place: Where its goal or light is at time 0 [m], shape (3,).
        motion: How that moves [m/s], shape (3,).
        full: What is measured where the reading is 1; of a light the distance at which it is half,
            of a clock the period [s].
    """

    kind: str
    of: tuple[int, ...] = ()
    place: Triple = (0.0, 0.0, 0.0)
    motion: Triple = (0.0, 0.0, 0.0)
    full: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in READINGS:
            raise ValueError(f"Sensor.kind: got {self.kind!r}, expected {', '.join(KINDS)}")
        check_number(f"{self.kind}: full", self.full, above=0.0)

    @property
    def readings(self) -> int:
        """How many numbers it gives."""
        count = READINGS[self.kind]
        return len(self.of) if count == "each" else count


def contact(masses: ArrayLike) -> Sensor:
    """For each mass 1 where it is at or below the surface of the ground or an obstacle, else 0."""
    return Sensor("contact", _chosen("masses", masses))


def force(masses: ArrayLike, full: float) -> Sensor:
    """For each mass the force with which the ground and the obstacles push it, in ``full`` [N]."""
    return Sensor("force", _chosen("masses", masses), full=full)


def length(springs: ArrayLike, full: float = 0.25) -> Sensor:
    """For each spring how much longer it is than its rest length, L / rest_length - 1, in ``full``.

    A spring without a rest length reads its length [m] in ``full``.
    """
    return Sensor("length", _chosen("springs", springs), full=full)


def velocity(full: float = 1.0) -> Sensor:
    """Velocity of the centre of mass forward, to the left and upward, in ``full`` [m/s]."""
    return Sensor("velocity", full=full)


def tilt() -> Sensor:
    """How steeply the body's forward and its left point upward: sines of pitch and roll."""
    return Sensor("tilt")


def goal(place: ArrayLike, full: float = 1.0, motion: ArrayLike = (0.0, 0.0, 0.0)) -> Sensor:
    """Distance over the ground from the centre of mass to a place (3,) [m], in ``full`` [m], and
    its direction: cosine and sine of the angle from forward to it, positive to the left.

    The place moves with ``motion`` (3,) [m/s].
    """
    return Sensor("goal", (), triple("place", place), triple("motion", motion), full)


def light(
    masses: ArrayLike, place: ArrayLike, full: float = 1.0, motion: ArrayLike = (0.0, 0.0, 0.0)
) -> Sensor:
    """Level of light at each of some masses: 1 at the lamp, 1 / (1 + (d / full)^2) at a distance d.

    The lamp is at ``place`` (3,) [m] and moves with ``motion`` (3,) [m/s].
    """
    where = triple("place", place), triple("motion", motion)
    return Sensor("light", _chosen("masses", masses), *where, full)


def clock(period: float) -> Sensor:
    """A rhythm: sine and cosine of 2 pi t / period, the period in seconds."""
    return Sensor("clock", full=period)


def triple(name: str, value: ArrayLike) -> Triple:
    """Three finite numbers, refused with a ValueError where they are not."""
    return tuple(require_vector(name, value).tolist())


def _chosen(name: str, indices: ArrayLike) -> tuple[int, ...]:
    """Indices, from indices or from a mask."""
    found = np.atleast_1d(np.asarray(indices))
    if found.dtype == bool:
        found = np.flatnonzero(found)
    if found.ndim != 1 or not len(found) or found.dtype.kind not in "iu":
        raise ValueError(f"{name}: got {indices!r}, expected indices or a mask of one or more")
    return tuple(int(i) for i in found)
