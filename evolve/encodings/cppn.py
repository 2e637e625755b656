"""A CPPN: a pattern network whose topology evolves reads the place of a spring."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from evolve.encodings.actuation import ActuationSettings
from evolve.encodings.base import EncodingSettings
from evolve.encodings.fields import ArrayField
from evolve.encodings.networks import Networks, NetworkSettings

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["CppnEncoding", "CppnSettings"]


class CppnSettings(NetworkSettings, ActuationSettings):
    """How far the network may grow, and how often its structure changes."""

    type: Literal["cppn"] = "cppn"


class CppnEncoding(ArrayField):
    """x, y, z, distance from the middle and 1 -> a network -> the four fields.

    Compositional pattern-producing network (Stanley 2007). A genome is that of `Networks`: nodes
    are sine, Gaussian, tanh, absolute value, identity or step.
    """

    Settings: ClassVar[type[EncodingSettings]] = CppnSettings
    settings: CppnSettings

    def __init__(self, body: ws.Robot, settings: CppnSettings) -> None:
        super().__init__(body, settings)
        distance = np.linalg.norm(self.places, axis=1)
        self._inputs = np.stack([*self.places.T, distance, np.ones(len(distance))])
        self.networks = Networks(
            5, settings.hidden, 4, settings.mutation_rate, settings.mutation_step
        )
        self.genome_shape = self.networks.genome_shape

    def random(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Make n networks without hidden nodes, each with some of the possible connections."""
        return self.networks.random(n, rng)

    def mutate(self, genomes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Change weights, functions or the structure of every network."""
        settings = self.settings
        chances = (settings.add_node, settings.add_connection, settings.drop_connection)
        return self.networks.mutate(genomes, rng, *chances)

    def cross(self, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Take every connection, and every node's function, from a[i] or from b[i]."""
        return self.networks.cross(a, b, rng)

    def express(self, genomes: np.ndarray) -> ws.Variants:
        """Build the robots: one body, n controllers."""
        return self.from_fields(self.networks.evaluate(genomes, self._inputs))

    def distance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """How different the connections are, shape (n,), about 1 for unrelated young networks."""
        return self.networks.distance(a, b)
