"""Harmonics: every spring of a fixed body has a periodic course of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import EncodingSettings
from evolve.encodings.direct import PHASE, DirectEncoding, DirectSettings

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["HarmonicsEncoding", "HarmonicsSettings"]


class HarmonicsSettings(DirectSettings):
    """Bounds of the genes, how they vary, and how many harmonics there are."""

    type: Literal["harmonics"] = "harmonics"
    harmonics: int = Field(3, ge=1, le=16)
    """How many sines make the course of a rest length: sin(wt), sin(2wt), ..."""


class HarmonicsEncoding(DirectEncoding):
    """L0(t) = a + b1 sin(wt + c1) + b2 sin(2wt + c2) + ... of each of the R springs.

    A genome has shape (4 + 2 (H - 1), R), float32, every gene in [0, 1]: the four genes of the
    direct encoding, then amplitude and phase of each further harmonic. Harmonic h reaches 1/h of
    the largest amplitude, so that all are equally fast.
    """

    Settings: ClassVar[type[EncodingSettings]] = HarmonicsSettings

    def __init__(self, body: ws.Robot, settings: HarmonicsSettings) -> None:
        more = settings.harmonics - 1
        self.kinds = 4 + 2 * more
        kinds = np.arange(self.kinds)
        self.on_circle = (kinds == PHASE) | ((kinds > 3) & (kinds % 2 == 1))
        super().__init__(body, settings)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        genes = np.asarray(genomes, dtype=np.float64)
        if self.settings.harmonics == 1:
            return super().express(genomes)
        table = np.empty((len(genes), self.body.n_springs, self.settings.harmonics - 1, 2))
        reach = self.settings.amplitude * self.body.lengths
        for order in range(2, self.settings.harmonics + 1):
            row = 4 + 2 * (order - 2)
            table[:, :, order - 2, 0] = reach / order * self.spread(genes[:, row])
            phase = self.spread_phase(genes[:, row + 1], order)
            table[:, :, order - 2, 1] = 2.0 * np.pi * phase
        return self.actuated(*(genes[:, kind] for kind in range(4)), harmonics=table)
