"""The configuration of a run: everything that is needed to repeat it, checked when it is read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from evolve.encodings import ENCODINGS
from evolve.fitness import FITNESS
from evolve.judging.trials import AGGREGATES
from evolve.optimizers import OPTIMIZERS
from warp_springs import config as configs

if TYPE_CHECKING:
    from evolve.encodings import Encoding, EncodingSettings
    from evolve.optimizers import Optimizer

__all__ = [
    "BudgetConfig",
    "LimitsConfig",
    "PerturbationConfig",
    "RunConfig",
    "SceneConfig",
    "SecondLookConfig",
    "SimulationConfig",
    "TaskConfig",
    "TrialsConfig",
]

DESCRIPTORS = ("displacement_x", "displacement_y", "height")
"""Measured of every robot, whatever the task."""

LONGEST_AUTO_STEP = 1e-3
"""With dt = "auto" no robot takes a longer step [s]."""


class SceneConfig(configs.SceneConfig):
    """Where the robots live; damped unless told otherwise."""

    damping: float = Field(1.0, ge=0.0)
    """Rate at which velocities decay [1/s]."""


class SimulationConfig(configs.SimulationConfig):
    """How motion is computed."""

    dt: float | Literal["auto"] = 5e-4
    """Time step [s], or "auto": for each robot a millisecond, halved until it is stable."""
    integrator: Literal["chin4", "leapfrog", "euler"] = "leapfrog"
    devices: tuple[str, ...] = ()
    """A worker process for each: ["cuda:0", "cuda:1"], or ["cpu", "cpu"]; none when empty. The
    results do not depend on how many there are."""

    cluster: str = ""
    """Address of a Ray cluster whose actors take the place of the worker processes, "auto" for the
    one this machine belongs to, "local" for one of its own; empty for none. Needs the extra `ray`.
    """

    @model_validator(mode="after")
    def _a_cluster_has_workers(self) -> SimulationConfig:
        if self.cluster and not self.devices:
            raise ValueError(
                "cluster: devices must say how many workers, and on what, as in --devices cpu cpu"
            )
        return self

    @model_validator(mode="after")
    def _devices_are_alike(self) -> SimulationConfig:
        kinds = {device.partition(":")[0] for device in (self.device, *self.devices)}
        if len(kinds) > 1:
            raise ValueError(
                f"devices: {', '.join(self.devices)} are not all of the kind of device, "
                f"{self.device}; the same robot would not have the same bits on all"
            )
        return self


class PerturbationConfig(configs.Section):
    """How the start of a trial is disturbed."""

    position: float = Field(0.01, ge=0.0)
    """Standard deviation of the displacement of each mass along x, y and z [shortest springs]."""
    velocity: float = Field(0.01, ge=0.0)
    """Standard deviation of the velocity of each mass along x, y and z [m/s]."""
    rotation: float = Field(0.1, ge=0.0)
    """Largest turn about the vertical, either way [rad]."""
    height: float = Field(0.01, ge=0.0)
    """Largest lift [shortest springs]."""


class TrialsConfig(PerturbationConfig):
    """Several trials of every robot, from perturbed starts and on floors of different friction."""

    count: int = Field(1, ge=1)
    """How many; one alone is not perturbed."""
    terrain: bool = True
    """Whether every trial has rough ground of its own, the seed of its scene counted on."""
    friction: float = Field(0.0, ge=0.0, lt=1.0)
    """The friction coefficients of the trials range from 1 - this to 1 + this times those of the
    scene, evenly."""
    aggregate: Literal[tuple(AGGREGATES)] = "mean"  # type: ignore[valid-type]
    """What becomes of their fitness."""


class SecondLookConfig(PerturbationConfig):
    """How the best are simulated again before one of them is crowned."""

    threshold: float = Field(0.8, ge=0.0)
    """Share of its fitness that a champion must keep, both at half the time step in float64 and
    from perturbed starts."""
    candidates: int = Field(32, ge=1)
    """How many of the best different individuals are looked at."""
    rounds: int = Field(8, ge=1)
    """How often: while nobody survives, as many are taken of those who have less than 90 % of the
    last one's fitness."""
    trials: int = Field(16, ge=1)
    """Perturbed starts of each candidate."""
    quantile: float = Field(0.5, ge=0.0, le=1.0)
    """Which of its perturbed trials counts: 0 the worst, 0.5 the median, 1 the best."""


class LimitsConfig(configs.Section):
    """What a robot may be and use; whoever exceeds a limit gets no fitness. None: no limit."""

    mass: float | None = Field(None, gt=0.0)
    """Of its body [kg]."""
    diameter: float | None = Field(None, gt=0.0)
    """Largest distance between two masses of the body at rest [m]."""
    springs: int | None = Field(None, ge=1)
    """Springs of its body."""
    energy: float | None = Field(None, gt=0.0)
    """Net work of its breathing springs during the measurement [J]."""

    @property
    def given(self) -> dict[str, float]:
        """The limits that there are: name of the measure -> largest value."""
        return {name: value for name, value in self.model_dump().items() if value is not None}


class TaskConfig(configs.Section):
    """What the robots have to do, and when they are believed."""

    fitness: str = "speed"
    """What robots are selected for, a name of `evolve.FITNESS`: higher is better."""
    descriptors: tuple[str, ...] = ()
    """Further measures to record of every robot, beside its way and its height."""
    direction: tuple[float, float] = (1.0, 0.0)
    """Where forward is, over the ground; for the fitness `forward`."""
    goals: tuple[configs.Triple, ...] = ()
    """Places that the robots sense, and should reach, one in each of as many trials [m]."""
    goal_motion: configs.Triple = (0.0, 0.0, 0.0)
    """How the goals move [m/s]."""
    settle: float = Field(1.0, gt=0.0)
    """How long they move before they are measured [cycles]."""
    measure: float = Field(4.0, gt=0.0)
    """How long they are measured [cycles]."""
    limits: LimitsConfig = LimitsConfig()
    trials: TrialsConfig = TrialsConfig()
    second_look: SecondLookConfig = SecondLookConfig()

    @field_validator("fitness")
    @classmethod
    def _is_a_measure(cls, value: str) -> str:
        return _known_measure(value)

    @field_validator("descriptors")
    @classmethod
    def _are_measures(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_known_measure(name) for name in value)

    @field_validator("direction")
    @classmethod
    def _points_somewhere(cls, value: tuple[float, float]) -> tuple[float, float]:
        length = float(np.hypot(*value))
        if not 0.0 < length < float("inf"):
            raise ValueError("expected two finite numbers that are not both 0")
        return value

    @field_validator("second_look", mode="before")
    @classmethod
    def _is_a_table(cls, value: Any) -> Any:
        if isinstance(value, (int, float)):
            raise ValueError("expected a table; the share to keep is task.second_look.threshold")
        return value


class BudgetConfig(configs.Section):
    """When a run ends, apart from its generations: with the first generation that uses one up."""

    evaluations: int | None = Field(None, ge=1)
    spring_evaluations: float | None = Field(None, gt=0.0)
    seconds: float | None = Field(None, gt=0.0)
    """Of computing, over all its sessions [s]. A run that ends by the clock is not repeatable."""


def _known_measure(name: str) -> str:
    if name not in FITNESS:
        raise ValueError(f"expected measures, which are {', '.join(sorted(FITNESS))}")
    return name


AnyEncoding = configs.one_of((cls.Settings for cls in ENCODINGS.values()), "type")
AnyOptimizer = configs.one_of((cls.Settings for cls in OPTIMIZERS.values()), "type")


class RunConfig(configs.Section):
    """Everything that decides a run."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    """Also the name of its folder."""
    about: str = ""
    """What it evolves, in one line."""
    seed: int = Field(1, ge=0)
    """From which everything random follows."""
    population: int = Field(512, ge=1, le=1_000_000)
    """Robots evaluated in each generation."""
    generations: int = Field(60, ge=1)
    """How many, at most."""
    budget: BudgetConfig = BudgetConfig()
    body: configs.AnyBody | None = None
    """The body that is controlled, or from which evolving bodies descend; encodings that make
    bodies from nothing have none."""
    encoding: AnyEncoding
    optimizer: AnyOptimizer
    scene: SceneConfig = SceneConfig()
    simulation: SimulationConfig = SimulationConfig()
    task: TaskConfig = TaskConfig()

    @model_validator(mode="after")
    def _step_fits(self) -> RunConfig:
        dt = self.simulation.dt
        longest = LONGEST_AUTO_STEP if dt == "auto" else dt
        if longest > self.encoding.period / 10:
            raise ValueError(
                f"simulation.dt = {longest:g} s is too long for cycles of "
                f"{self.encoding.period:g} s: at most a tenth of encoding.period"
            )
        return self

    @model_validator(mode="after")
    def _goals_are_given(self) -> RunConfig:
        measures = (self.task.fitness, *self.descriptors)
        asking = [name for name in measures if FITNESS[_known_measure(name)].needs_goal]
        asking += [s for s in getattr(self.encoding, "sensors", ()) if s in ("goal", "light")]
        if asking and not self.task.goals:
            raise ValueError(f"task.goals: none given, and {asking[0]!r} needs one")
        return self

    @model_validator(mode="after")
    def _optimizer_is_told_what_it_asks_for(self) -> RunConfig:
        for name in self.optimizer.measures:
            _known_measure(name)
        return self

    @model_validator(mode="after")
    def _has_the_body_it_needs(self) -> RunConfig:
        name = self._robots.type
        needs = ENCODINGS[name].needs_body
        if needs and self.body is None:
            raise ValueError(f"body: the encoding {name} needs one; add a table [body]")
        if not needs and self.body is not None:
            raise ValueError(f"body: the encoding {name} makes its own bodies; remove [body]")
        return self

    @property
    def descriptors(self) -> tuple[str, ...]:
        """Names of what is recorded of every robot beside its fitness."""
        wanted = (*DESCRIPTORS, *self.task.descriptors, *self.optimizer.measures)
        return tuple(dict.fromkeys(wanted))

    @property
    def fixed_body(self) -> bool:
        """Whether all robots share one body, rather than evolving their own."""
        return ENCODINGS[self._robots.type].fixed_body

    @property
    def _robots(self) -> EncodingSettings:
        """Settings of the encoding that makes robots, in an arena too."""
        return getattr(self.encoding, "robot", self.encoding)

    def make_encoding(self) -> Encoding:
        """Make the encoding, over the configured body if there is one."""
        body = None if self.body is None else self.body.build()
        return ENCODINGS[self.encoding.type](body, self.encoding)

    def make_optimizer(self, encoding: Encoding) -> Optimizer:
        """Make the optimizer at its very start."""
        from evolve.streams import Streams

        return OPTIMIZERS[self.optimizer.type](encoding, Streams(self.seed), self.optimizer)
