"""Closed loop: sensors and a small network set the rest lengths of groups of muscles."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.actuation import ActuationSettings, muscles
from evolve.encodings.base import EncodingSettings
from evolve.encodings.fields import ArrayField, squashed

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ControllerEncoding", "ControllerSettings", "spread_out"]

FEET = 4
"""Masses whose contact is felt."""
NOWHERE = (0.0, 0.0, 0.0)
"""Where goals and lights are until the robots are aimed at those of the task."""


class ControllerSettings(ActuationSettings):
    """What the robots sense, and how large their network is."""

    type: Literal["controller"] = "controller"
    sensors: tuple[
        Literal["clock", "contact", "force", "length", "velocity", "tilt", "goal", "light"], ...
    ] = Field(("clock", "contact", "tilt", "velocity"), min_length=1)
    """What the network reads: a clock of one `period`; contact or force of four feet; the length of
    a spring of each group; velocity of the centre of mass; tilt; distance and direction of
    `task.goals`; the light that shines there, at four sides of the body."""
    groups: int = Field(8, ge=1)
    """Groups of neighbouring springs; each obeys one output, and has one stiffness."""
    hidden: int = Field(6, ge=0, le=64)
    """Hidden neurons; 0 for a network of one layer."""
    recurrent: bool = False
    """Whether the hidden neurons remember what they were."""
    rate: float = Field(25.0, gt=0.0)
    """Readings a second [1/s]."""
    response: float = Field(0.0, ge=0.0)
    """Time in which muscles come to 63 % of what the network tells them [s]; 0 for at once."""
    far: float = Field(2.0, gt=0.0)
    """Distance of a goal that reads as 1, and of a light that reads as one half [m]."""
    amplitude: float = Field(0.25, gt=0.0, lt=1.0)
    """Largest change of a rest length, as a part of it."""
    rhythm: float = Field(0.0, ge=0.0, lt=1.0)
    """Largest amplitude of the rhythm that each group has of its own, under what the network adds,
    as a part of the rest length; 0 for none."""
    mutation_step: float = Field(0.05, gt=0.0)
    """Standard deviation of a mutation, as a share of a gene's range: networks are touchy."""


class ControllerEncoding(ArrayField):
    """The weights of a `ws.Controller`, and for each group a mean rest length, a stiffness, and, if
    asked for, a rhythm.

    With a symmetry mirrored springs share these; the network stays free, for it is to tell left
    from right.
    """

    Settings: ClassVar[type[EncodingSettings]] = ControllerSettings

    settings: ControllerSettings

    def __init__(self, body: ws.Robot, settings: ControllerSettings) -> None:
        super().__init__(body, settings)
        import warp_springs as ws

        active = np.flatnonzero(muscles(body, settings.muscles))
        middles = body.positions[body.springs[active]].mean(axis=1)
        centers = spread_out(middles, settings.groups)
        outputs = _nearest(middles, middles[centers])
        self.group = np.full(body.n_springs, -1)
        self.group[active] = outputs
        centers = active[centers]
        brain = ws.Controller(
            sensors=[self._sensor(kind, centers) for kind in settings.sensors],
            muscles=active,
            outputs=outputs,
            reach=settings.amplitude,
            hidden=settings.hidden,
            recurrent=settings.recurrent,
            rate=settings.rate,
            response=settings.response,
        )
        still = np.where(self.group < 0, body.amplitude, 0.0)
        self.body = body.replace(amplitude=still, omega=2.0 * np.pi / settings.period)
        self.body = self.body.controlled(brain)
        self.groups = brain.n_outputs
        self._parts = 4 if settings.rhythm else 2
        self.genome_shape = (brain.n_weights + self._parts * self.groups,)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n networks."""
        genes, settings = self.coefficients(genomes), self.settings
        (low, high), (soft, stiff) = settings.rest_length, settings.stiffness
        weights, each = np.split(genes, [-self._parts * self.groups], axis=1)
        each = each.reshape(len(genes), self._parts, self.groups)
        rest, hard, *waves = np.moveaxis(each[:, :, self.group[self.own]], 1, 0)
        rhythm = {}
        if waves:
            reach = settings.rhythm * self.body.lengths
            phase = self.spread_phase(np.arctan2(*waves) / (2.0 * np.pi))
            rhythm["amplitude"] = reach * np.tanh(self.spread(np.hypot(*waves)))
            rhythm["phase"] = 2.0 * np.pi * phase
        return self.variants(
            weights=weights,
            rest_length=self.body.lengths * (low + (high - low) * squashed(self.spread(rest))),
            stiffness=soft * (stiff / soft) ** squashed(self.spread(hard)),
            **rhythm,
        )

    def _sensor(self, kind: str, centers: np.ndarray) -> ws.sensors.Sensor:
        from warp_springs import sensors

        body, settings = self.body, self.settings
        if kind in ("contact", "force"):
            low, high = body.bounds[:, 2]
            soles = np.flatnonzero(body.positions[:, 2] <= low + 0.05 * (high - low))
            feet = soles[spread_out(body.positions[soles], FEET)]
            weight = 9.81 * body.mass
            return sensors.contact(feet) if kind == "contact" else sensors.force(feet, weight)
        if kind == "light":
            arms = body.positions - body.center_of_mass
            sides = [arms[:, 0], -arms[:, 0], arms[:, 1], -arms[:, 1]]
            return sensors.light([int(np.argmax(side)) for side in sides], NOWHERE, settings.far)
        made = {
            "clock": lambda: sensors.clock(settings.period),
            "length": lambda: sensors.length(centers),
            "velocity": lambda: sensors.velocity(),
            "tilt": lambda: sensors.tilt(),
            "goal": lambda: sensors.goal(NOWHERE, settings.far),
        }
        return made[kind]()


def spread_out(points: np.ndarray, count: int) -> np.ndarray:
    """Indices of some points (n, 3) far from each other: each the farthest from those before."""
    squared = ((points - points.mean(axis=0)) ** 2).sum(axis=1)
    chosen = [int(np.argmax(squared))]
    nearest = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)) and nearest.max() > 0.0:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def _nearest(points: np.ndarray, centers: np.ndarray) -> np.ndarray:
    """Which center is the nearest of each point, shape (n,)."""
    return ((points[:, None] - centers[None]) ** 2).sum(axis=2).argmin(axis=1)
