"""A neural field: a small network reads the place of a spring and says what it does."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.actuation import ActuationSettings
from evolve.encodings.base import EncodingSettings
from evolve.encodings.fields import ArrayField

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["NeuralEncoding", "NeuralSettings"]


class NeuralSettings(ActuationSettings):
    """How large the network is."""

    type: Literal["neural"] = "neural"
    hidden: int = Field(8, ge=1, le=64)
    """Neurons of the hidden layer, tanh."""


class NeuralEncoding(ArrayField):
    """x, y, z, distance from the middle and 1 -> hidden tanh neurons -> the four fields.

    A genome holds the H x 5 weights into the hidden layer and the 4 x (H + 1) weights out of it, in
    one row.
    """

    Settings: ClassVar[type[EncodingSettings]] = NeuralSettings

    def __init__(self, body: ws.Robot, settings: NeuralSettings) -> None:
        super().__init__(body, settings)
        distance = np.linalg.norm(self.places, axis=1)
        self._inputs = np.stack([*self.places.T, distance, np.ones(len(distance))])
        self.genome_shape = (5 * settings.hidden + 4 * (settings.hidden + 1),)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        hidden, weights = self.settings.hidden, self.coefficients(genomes)
        into = weights[:, : 5 * hidden].reshape(-1, hidden, 5)
        out = weights[:, 5 * hidden :].reshape(-1, 4, hidden + 1)
        # Not as matrix products, which might add up differently on another number of threads.
        neurons = np.tanh(np.einsum("nhi,ir->nhr", into, self._inputs, optimize=False))
        fields = np.einsum("nfh,nhr->nfr", out[:, :, :-1], neurons, optimize=False)
        return self.from_fields(fields / np.sqrt(hidden) + out[:, :, -1:])
