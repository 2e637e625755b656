"""A CPPN of bodies: a pattern network says where voxels are, of what, and when they breathe."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from evolve.encodings.base import ArrayGenomes, EncodingSettings
from evolve.encodings.evolving import PacedSettings
from evolve.encodings.networks import Networks, NetworkSettings
from evolve.encodings.voxels import VoxelBody, VoxelBodySettings

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["CppnBodyEncoding", "CppnBodySettings"]


class CppnBodySettings(PacedSettings, NetworkSettings, VoxelBodySettings):
    """How far the network may grow, and how often its structure changes."""

    type: Literal["cppn_body"] = "cppn_body"
    add_node: float = Field(0.15, ge=0.0, le=1.0)
    """Share of the mutations that split a connection by a new node."""
    mutation_rate: float = Field(0.3, gt=0.0, le=1.0)
    """Share of the weights that a mutation changes, on average."""
    mutation_step: float = Field(0.1, gt=0.0)
    """Standard deviation of a mutation, as a share of a weight's range."""


class CppnBodyEncoding(VoxelBody, ArrayGenomes):
    """x, y, z, distance from the middle and 1 -> a network -> presence, material and phase.

    After Cheney, MacCurdy, Clune and Lipson (2013). A genome is that of `Networks`; the phase is
    the direction of two outputs, so that it has no seam.
    """

    Settings: ClassVar[type[EncodingSettings]] = CppnBodySettings
    settings: CppnBodySettings

    def __init__(self, body: None, settings: CppnBodySettings) -> None:
        super().__init__(body, settings)
        centres = self.lattice.centres
        places = centres - centres.mean(axis=0)
        places /= max(float(np.abs(places).max()), 0.5 * settings.edge)
        distance = np.linalg.norm(places, axis=1)
        self._inputs = np.stack([*places.T, distance, np.ones(len(distance))])
        rate, step = settings.mutation_rate, settings.mutation_step
        self.networks = Networks(5, settings.hidden, 4, rate, step)
        self.genome_shape = self.networks.genome_shape

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n networks without hidden nodes, each with some of the possible connections."""
        return self.networks.random(n, rng)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change weights, functions or the structure of every network."""
        settings = self.settings
        chances = (settings.add_node, settings.add_connection, settings.drop_connection)
        return self.paced(genomes, self.networks.mutate(genomes, rng, *chances), rng)

    def tune(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change what flows into the outputs other than presence: weights, functions, at times
        which connections there are."""
        return self.networks.tuned(genomes, rng, first=1, rate=self.settings.add_connection)

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every connection, and every node's function, from a[i] or from b[i]."""
        return self.networks.cross(a, b, rng)

    def express(self, genomes: np.ndarray) -> list[ws.Robot]:
        """Build the robots."""
        fields = self.networks.evaluate(genomes, self._inputs)
        presence, material, cosine, sine = np.moveaxis(fields, 1, 0)
        phase = np.arctan2(sine, cosine) / (2.0 * np.pi)
        return self.grown(presence, 0.5 + 0.4999 * np.tanh(material), phase)

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """How different the connections are, shape (n,), about 1 for unrelated young networks."""
        return self.networks.distance(a, b)
