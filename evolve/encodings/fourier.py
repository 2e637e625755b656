"""A Fourier field: waves in space, the fewer of them the smoother the motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.actuation import ActuationSettings
from evolve.encodings.base import EncodingSettings
from evolve.encodings.fields import ArrayField

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["FourierEncoding", "FourierSettings"]


class FourierSettings(ActuationSettings):
    """How fine the waves are."""

    type: Literal["fourier"] = "fourier"
    waves: int = Field(2, ge=0, le=6)
    """Half waves that fit into the longest extent of the body, at most, along each axis."""


class FourierEncoding(ArrayField):
    """Each field is a sum of cosine products cos(l X) cos(m Y) cos(n Z) with l + m + n <= waves.

    X, Y and Z go from 0 to pi over the longest extent of the body. A genome has shape (4, modes);
    a mode of the order l + m + n counts 1 / (1 + l + m + n) of its coefficient.
    """

    Settings: ClassVar[type[EncodingSettings]] = FourierSettings

    def __init__(self, body: ws.Robot, settings: FourierSettings) -> None:
        super().__init__(body, settings)
        orders = np.stack(
            np.meshgrid(*[np.arange(settings.waves + 1)] * 3, indexing="ij"), axis=-1
        ).reshape(-1, 3)
        orders = orders[orders.sum(axis=1) <= settings.waves]
        angles = (self.places + 1.0) * (0.5 * np.pi)
        waves = np.cos(orders[:, None, :] * angles).prod(axis=2)
        self._basis = waves / (1.0 + orders.sum(axis=1))[:, None]
        self.genome_shape = (4, len(orders))

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        # Not as a matrix product, which might add up differently on another number of threads.
        fields = np.einsum("nfm,mr->nfr", self.coefficients(genomes), self._basis, optimize=False)
        return self.from_fields(fields)
