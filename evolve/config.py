"""The configuration of a run: everything that is needed to repeat it, checked when it is read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from evolve.encodings import ENCODINGS
from evolve.fitness import FITNESS
from evolve.optimizers import OPTIMIZERS
from evolve.trials import AGGREGATES

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.encodings import Encoding
    from evolve.optimizers import Optimizer

__all__ = [
    "BODIES",
    "BudgetConfig",
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


class Section(BaseModel):
    """A table of the configuration: unchangeable, and unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class BodyConfig(Section):
    """A body made by one of the shapes of `warp_springs`, standing on the ground."""

    edge: float = Field(0.1, gt=0.0)
    """Length of an edge [m]."""
    stiffness: float = Field(1000.0, gt=0.0)
    """Stiffness of the springs [N/m] unless the encoding decides it."""

    def build(self) -> ws.Robot:
        """Make the body."""
        import warp_springs as ws

        settings = self.model_dump()
        return getattr(ws.shapes, settings.pop("shape"))(**settings)


class CubeConfig(BodyConfig):
    """Eight masses, 28 springs between all pairs."""

    shape: Literal["cube"]
    mass: float = Field(0.8, gt=0.0)
    """Of the whole body [kg]."""


class TetrahedronConfig(BodyConfig):
    """Four masses, six springs."""

    shape: Literal["tetrahedron"]
    mass: float = Field(0.4, gt=0.0)
    """Of the whole body [kg]."""


class OctahedronConfig(BodyConfig):
    """Six masses, 15 springs."""

    shape: Literal["octahedron"]
    mass: float = Field(0.6, gt=0.0)
    """Of the whole body [kg]."""


class LatticeConfig(BodyConfig):
    """A block of nx x ny x nz voxels."""

    shape: Literal["lattice"]
    nx: int = Field(ge=1)
    ny: int = Field(ge=1)
    nz: int = Field(ge=1)
    mass_per_vertex: float = Field(0.1, gt=0.0)
    """[kg]"""


class VoxelsConfig(BodyConfig):
    """Voxels drawn as layers, the lowest first, each a map seen from above.

    A layer is a list of rows, the farthest (largest y) first; a row runs along x and is either a
    string in which '#' is a voxel and '.' is none, or a list of 1 and 0.
    """

    shape: Literal["voxels"]
    layers: tuple[tuple[str | tuple[int, ...], ...], ...]
    mass_per_vertex: float = Field(0.1, gt=0.0)
    """[kg]"""

    @field_validator("layers")
    @classmethod
    def _rectangular(cls, layers: tuple) -> tuple:
        voxels = 0
        for z, layer in enumerate(layers):
            for y, row in enumerate(layer):
                where = f"layer {z}, row {y}"
                if wrong := set(row) - ({"#", "."} if isinstance(row, str) else {0, 1}):
                    raise ValueError(f"{where}: {wrong.pop()!r} is neither a voxel nor none")
                if len(layer) != len(layers[0]) or len(row) != len(layers[0][0]):
                    raise ValueError(f"{where}: every layer and row must be as large as the first")
                voxels += sum(cell in ("#", 1) for cell in row)
        if not voxels:
            raise ValueError("there is no voxel")
        return layers

    @property
    def mask(self) -> np.ndarray:
        """Which voxels exist, shape (nx, ny, nz), bool."""
        cells = [[[c in ("#", 1) for c in row] for row in layer[::-1]] for layer in self.layers]
        return np.array(cells, dtype=bool).transpose(2, 1, 0)

    def build(self) -> ws.Robot:
        """Make the body."""
        import warp_springs as ws

        settings = self.model_dump(exclude={"shape", "layers"})
        return ws.shapes.voxels(self.mask, **settings)


class GroundConfig(Section):
    """The plane z = 0; the figures are rubber on concrete."""

    stiffness: float = Field(1e5, gt=0.0)
    """[N/m]"""
    static_friction: float = Field(1.0, ge=0.0)
    kinetic_friction: float = Field(0.8, ge=0.0)
    friction: Literal["coulomb", "course"] = "coulomb"


class SceneConfig(Section):
    """Where the robots live."""

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    """[m/s^2]"""
    damping: float = Field(1.0, ge=0.0)
    """Rate at which velocities decay [1/s]."""
    drag: float = Field(0.0, ge=0.0)
    """Quadratic drag of a mass [kg/m]."""
    ground: GroundConfig = GroundConfig()

    def build(self) -> ws.Scene:
        """Make the scene."""
        import warp_springs as ws

        settings = self.model_dump()
        return ws.Scene(ground=ws.Ground(**settings.pop("ground")), **settings)


class SimulationConfig(Section):
    """How motion is computed."""

    dt: float | Literal["auto"] = 5e-4
    """Time step [s], or "auto": for each robot a millisecond, halved until it is stable."""
    precision: Literal["float64", "float32"] = "float64"
    integrator: Literal["chin4", "leapfrog", "euler"] = "leapfrog"
    device: str = "cpu"
    threads: int | None = Field(None, ge=1)
    """Processor cores to use, all when left out. The results do not depend on it."""
    devices: tuple[str, ...] = ()
    """A worker process for each: ["cuda:0", "cuda:1"], or ["cpu", "cpu"]; none when empty. The
    results do not depend on how many there are."""

    @model_validator(mode="after")
    def _devices_are_alike(self) -> SimulationConfig:
        kinds = {device.partition(":")[0] for device in (self.device, *self.devices)}
        if len(kinds) > 1:
            raise ValueError(
                f"devices: {', '.join(self.devices)} are not all of the kind of device, "
                f"{self.device}; the same robot would not have the same bits on all"
            )
        return self

    @field_validator("dt", mode="before")
    @classmethod
    def _is_a_step(cls, value: Any) -> Any:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if value != "auto" and not (number and value > 0.0):
            raise ValueError("expected a number of seconds above 0, or 'auto'")
        return value


class PerturbationConfig(Section):
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
    trials: int = Field(16, ge=1)
    """Perturbed starts of each candidate."""
    quantile: float = Field(0.5, ge=0.0, le=1.0)
    """Which of its perturbed trials counts: 0 the worst, 0.5 the median, 1 the best."""


class TaskConfig(Section):
    """What the robots have to do, and when they are believed."""

    fitness: str = "speed"
    """What robots are selected for, a name of `evolve.FITNESS`: higher is better."""
    descriptors: tuple[str, ...] = ()
    """Further measures to record of every robot, beside its way and its height."""
    direction: tuple[float, float] = (1.0, 0.0)
    """Where forward is, over the ground; for the fitness `forward`."""
    settle: float = Field(1.0, gt=0.0)
    """How long they move before they are measured [cycles]."""
    measure: float = Field(4.0, gt=0.0)
    """How long they are measured [cycles]."""
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


class BudgetConfig(Section):
    """When a run ends, apart from its generations: with the first generation that uses one up."""

    evaluations: int | None = Field(None, ge=1)
    spring_evaluations: float | None = Field(None, gt=0.0)
    seconds: float | None = Field(None, gt=0.0)
    """Of computing, over all its sessions [s]. A run that ends by the clock is not repeatable."""


def _known_measure(name: str) -> str:
    if name not in FITNESS:
        raise ValueError(f"expected measures, which are {', '.join(sorted(FITNESS))}")
    return name


def _choice(models: Any, key: str) -> Any:
    """A section whose key says which of several models it is."""
    models = tuple(models)
    if len(models) == 1:
        return models[0]
    return Annotated[Union[models], Field(discriminator=key)]  # noqa: UP007 (built at run time)


BODIES = (CubeConfig, TetrahedronConfig, OctahedronConfig, LatticeConfig, VoxelsConfig)
AnyBody = _choice(BODIES, "shape")
AnyEncoding = _choice((cls.Settings for cls in ENCODINGS.values()), "type")
AnyOptimizer = _choice((cls.Settings for cls in OPTIMIZERS.values()), "type")


class RunConfig(Section):
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
    body: AnyBody
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
    def _optimizer_is_told_what_it_asks_for(self) -> RunConfig:
        for name in self.optimizer.measures:
            _known_measure(name)
        return self

    @property
    def descriptors(self) -> tuple[str, ...]:
        """Names of what is recorded of every robot beside its fitness."""
        wanted = (*DESCRIPTORS, *self.task.descriptors, *self.optimizer.measures)
        return tuple(dict.fromkeys(wanted))

    @property
    def fixed_body(self) -> bool:
        """Whether all robots share one body, rather than evolving their own."""
        return ENCODINGS[self.encoding.type].fixed_body

    def make_encoding(self) -> Encoding:
        """Make the encoding over the configured body."""
        return ENCODINGS[self.encoding.type](self.body.build(), self.encoding)

    def make_optimizer(self, encoding: Encoding) -> Optimizer:
        """Make the optimizer at its very start."""
        from evolve.streams import Streams

        return OPTIMIZERS[self.optimizer.type](encoding, Streams(self.seed), self.optimizer)
