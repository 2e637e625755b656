"""Arena: a robot of any encoding, and the hills that it has to run over, as one genome."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, Field, model_validator

from evolve.encodings.base import ArrayGenomes, Encoding, EncodingSettings, Genomes, folded
from evolve.encodings.controller import ControllerSettings

if TYPE_CHECKING:
    import warp_springs as ws

    AnyRobot = EncodingSettings

__all__ = ["ArenaEncoding", "ArenaSettings", "Hills", "Meetings"]

WAVELENGTH, DIRECTION, PHASE = range(3)
GENES = 4
"""Of a wave of the hills: wavelength, direction, phase, weight."""


class ArenaSettings(BaseModel):
    """What hills may be, and the encoding of the robots that meet them."""

    model_config = EncodingSettings.model_config

    type: Literal["arena"] = "arena"
    robot: AnyRobot = Field(default_factory=ControllerSettings)
    """The encoding of the robots, and its settings: controllers of a body, or bodies."""
    waves: int = Field(6, ge=1, le=32)
    """Waves that the hills are the sum of."""
    height: float = Field(0.08, gt=0.0)
    """From the lowest point to the highest, the same for all hills [m]."""
    feature: float = Field(0.4, gt=0.0)
    """Shortest wavelength; the longest is four times that [m]."""
    size: float = Field(6.0, gt=0.0)
    """Edge of the square about the origin that they cover [m]."""
    spacing: float = Field(0.1, gt=0.0)
    """Distance of grid points [m]."""
    mutation_rate: float = Field(0.1, gt=0.0, le=1.0)
    """Share of the genes of hills that a mutation changes, on average."""
    mutation_step: float = Field(0.1, gt=0.0)
    """Standard deviation of a mutation of hills, as a share of a gene's range."""

    @property
    def period(self) -> float:
        """Length of an actuation cycle [s]."""
        return self.robot.period

    @property
    def sensors(self) -> tuple[str, ...]:
        """What the robots sense."""
        return getattr(self.robot, "sensors", ())

    @model_validator(mode="after")
    def _grid_is_fine_enough(self) -> ArenaSettings:
        if self.feature < 2.0 * self.spacing:
            raise ValueError(
                f"feature: {self.feature:g} m given, two grid points or more expected, "
                f"{2.0 * self.spacing:g} m"
            )
        return self


class Hills(ArrayGenomes):
    """Hills as genes: each wave has a wavelength, a direction, a phase and a weight, (4 waves,)."""

    def __init__(self, settings: ArenaSettings) -> None:
        self.settings = settings
        self.genome_shape = (GENES * settings.waves,)
        kind = np.arange(self.genome_shape[0]) % GENES
        self.circular = (kind == DIRECTION) | (kind == PHASE)

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n genomes of uniform genes."""
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Shift some genes of all hills, at least one."""
        rows = np.arange(len(genomes))
        chosen = rng.random(genomes.shape) < self.settings.mutation_rate
        chosen[rows, rng.integers(genomes.shape[1], size=len(rows))] = True
        shift = rng.standard_normal(genomes.shape, dtype=np.float32) * chosen
        return folded(genomes + np.float32(self.settings.mutation_step) * shift, self.circular)

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every wave from a[i] or from b[i]."""
        coins = rng.random((len(a), self.settings.waves)) < 0.5
        return np.where(np.repeat(coins, GENES, axis=1), b, a)

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Mean difference of the genes, in that of unrelated ones, shape (n,)."""
        gap = np.abs(a.astype(np.float64) - b)
        gap = np.where(self.circular, 4.0 * np.minimum(gap, 1.0 - gap), 3.0 * gap)
        return gap.mean(axis=1)

    def field(self, genes: np.ndarray) -> ws.HeightField:
        """The hills of one genome, shape (4 waves,)."""
        import warp_springs as ws

        settings = self.settings
        waves = genes.astype(np.float64).reshape(settings.waves, GENES)
        waves[:, WAVELENGTH] = settings.feature * 4.0 ** waves[:, WAVELENGTH]
        waves[:, [DIRECTION, PHASE]] *= 2.0 * np.pi
        return ws.hills(waves, settings.height, settings.size, settings.spacing)


@dataclass(frozen=True)
class Meetings:
    """Robots, each with the hills that it meets."""

    robots: Genomes
    hills: np.ndarray

    def __len__(self) -> int:
        return len(self.hills)


class ArenaEncoding:
    """A genome is that of a robot, in any other encoding, and that of hills.

    All hills are of one height, so that they can only be difficult by their shape. The robots of
    one simulation share their hills; see `worlds`. `sides` are the encodings of the two, which
    breed apart in coevolution.
    """

    Settings: ClassVar[type[BaseModel]] = ArenaSettings
    fixed_body: ClassVar[bool] = True
    needs_body: ClassVar[bool] = True
    """With controllers for robots; `RunConfig` asks the encoding of the robots."""

    def __init__(self, body: ws.Robot | None, settings: ArenaSettings) -> None:
        from evolve.encodings import ENCODINGS

        self.settings = settings
        self.robots: Encoding = ENCODINGS[settings.robot.type](body, settings.robot)
        self.hills = Hills(settings)

    @property
    def sides(self) -> tuple[Any, Any]:
        """The encodings of robots and of hills."""
        return self.robots, self.hills

    def split(self, genomes: Meetings) -> tuple[Genomes, np.ndarray]:
        """The genomes of the robots, and of the hills that each of them meets."""
        return genomes.robots, genomes.hills

    def joined(self, robots: Genomes, hills: np.ndarray) -> Meetings:
        """Each robot on its hills."""
        return Meetings(robots, hills)

    def random(self, n: int, rng: np.random.Generator) -> Meetings:
        """Make n unrelated robots, each on hills of its own."""
        return Meetings(self.robots.random(n, rng), self.hills.random(n, rng))

    def mutate(self, genomes: Meetings, rng: np.random.Generator) -> Meetings:
        """Change every robot and its hills."""
        return Meetings(
            self.robots.mutate(genomes.robots, rng), self.hills.mutate(genomes.hills, rng)
        )

    def tune(self, genomes: Meetings, rng: np.random.Generator) -> Meetings:
        """Change what every robot does, on the same hills."""
        return Meetings(self.robots.tune(genomes.robots, rng), genomes.hills)

    def cross(self, a: Meetings, b: Meetings, rng: np.random.Generator) -> Meetings:
        """Cross over the robots a[i] and b[i], and their hills."""
        return Meetings(
            self.robots.cross(a.robots, b.robots, rng), self.hills.cross(a.hills, b.hills, rng)
        )

    def express(self, genomes: Meetings) -> Sequence[ws.Robot]:
        """Build the robots."""
        return self.robots.express(genomes.robots)

    def distance(self, a: Meetings, b: Meetings) -> np.ndarray:
        """Mean of the distances of robots and of hills, shape (n,)."""
        apart = self.robots.distance(a.robots, b.robots)
        return 0.5 * (apart + self.hills.distance(a.hills, b.hills))

    def to_bytes(self, genomes: Meetings) -> list[bytes]:
        """The genes of the hills, then the genome of the robot."""
        parts = self.hills.to_bytes(genomes.hills), self.robots.to_bytes(genomes.robots)
        return [hills + robot for hills, robot in zip(*parts, strict=True)]

    def from_bytes(self, blobs: Sequence[bytes]) -> Meetings:
        """The genomes of which `to_bytes` made the blobs; ValueError for other bytes."""
        size = 4 * self.hills.genome_shape[0]
        return Meetings(
            self.robots.from_bytes([blob[size:] for blob in blobs]),
            self.hills.from_bytes([blob[:size] for blob in blobs]),
        )

    def take(self, genomes: Meetings, indices: np.ndarray) -> Meetings:
        """The meetings at `indices`, in that order."""
        return Meetings(self.robots.take(genomes.robots, indices), genomes.hills[indices])

    def concatenate(self, parts: Sequence[Meetings]) -> Meetings:
        """One population from several."""
        return Meetings(
            self.robots.concatenate([part.robots for part in parts]),
            self.hills.concatenate([part.hills for part in parts]),
        )

    def overwrite(
        self, genomes: Meetings, rows: np.ndarray, others: Meetings, whence: np.ndarray
    ) -> None:
        """Put others[whence[i]] in place of genomes[rows[i]]."""
        self.robots.overwrite(genomes.robots, rows, others.robots, whence)
        self.hills.overwrite(genomes.hills, rows, others.hills, whence)

    def worlds(self, genomes: Meetings, scene: ws.Scene) -> Iterator[tuple[np.ndarray, ws.Scene]]:
        """Which of the robots live in which world: the scene with their hills."""
        kinds, kind = np.unique(genomes.hills, axis=0, return_inverse=True)
        for number, wanted in enumerate(kinds):
            obstacles = (*scene.obstacles, self.hills.field(wanted))
            yield np.flatnonzero(kind.ravel() == number), replace(scene, obstacles=obstacles)
