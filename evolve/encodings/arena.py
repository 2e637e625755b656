"""Arena: a robot with its controller, and the hills that it has to run over, as one genome."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import EncodingSettings
from evolve.encodings.controller import ControllerEncoding, ControllerSettings

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ArenaEncoding", "ArenaSettings"]

GENES = 4
"""Of a wave of the hills: wavelength, direction, phase, weight."""


class ArenaSettings(ControllerSettings):
    """What hills may be, beside what controllers may."""

    type: Literal["arena"] = "arena"
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


class ArenaEncoding(ControllerEncoding):
    """The genes of a controller, then those of hills: shape (R + 4 waves,).

    All hills are of one height, so that they can only be difficult by their shape. The robots of
    one simulation share their hills; see `worlds`.
    """

    Settings: ClassVar[type[EncodingSettings]] = ArenaSettings

    settings: ArenaSettings

    def __init__(self, body: ws.Robot, settings: ArenaSettings) -> None:
        super().__init__(body, settings)
        if settings.feature < 2.0 * settings.spacing:
            raise ValueError(
                f"feature: {settings.feature:g} m given, two grid points or more expected, "
                f"{2.0 * settings.spacing:g} m"
            )
        (self.robot_genes,) = self.genome_shape
        self.genome_shape = (self.robot_genes + GENES * settings.waves,)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n networks."""
        return super().express(genomes[:, : self.robot_genes])

    def split(self, genomes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The genes of the robots (n, R) and of their hills (n, 4 waves)."""
        return genomes[:, : self.robot_genes], genomes[:, self.robot_genes :]

    def joined(self, robots: np.ndarray, hills: np.ndarray) -> np.ndarray:
        """Each robot on its hills."""
        return np.concatenate([robots, hills], axis=1)

    def worlds(self, genomes: np.ndarray, scene: ws.Scene) -> Iterator[tuple[np.ndarray, ws.Scene]]:
        """Which of the robots live in which world: the scene with their hills."""
        genes = self.split(genomes)[1]
        kinds, kind = np.unique(genes, axis=0, return_inverse=True)
        for number, wanted in enumerate(kinds):
            obstacles = (*scene.obstacles, self._hills(wanted))
            yield np.flatnonzero(kind.ravel() == number), replace(scene, obstacles=obstacles)

    def _hills(self, genes: np.ndarray) -> ws.HeightField:
        import warp_springs as ws

        settings = self.settings
        waves = genes.astype(np.float64).reshape(settings.waves, GENES)
        waves[:, 0] = settings.feature * 4.0 ** waves[:, 0]
        waves[:, 1:3] *= 2.0 * np.pi
        return ws.hills(waves, settings.height, settings.size, settings.spacing)
