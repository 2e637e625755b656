"""What an encoding is: how a population of genomes varies, and how it becomes robots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = [
    "ArrayGenomes",
    "Encoding",
    "EncodingSettings",
    "Genomes",
    "Interval",
    "ListGenomes",
    "coins",
    "folded",
    "sparse",
]

Genomes = Any
"""A population of genomes. Only its encoding looks inside; everybody else may call `len`."""


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if not 0.0 < bounds[0] <= bounds[1] < float("inf"):
        raise ValueError("expected two finite numbers with 0 < lowest <= highest")
    return bounds


Interval = Annotated[tuple[float, float], AfterValidator(_ordered)]
"""The lowest and the highest of what is positive."""


class EncodingSettings(BaseModel):
    """What every encoding can be told; each adds its own, and a field `type` with its name."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    period: float = Field(1.0, gt=0.0)
    """Length of an actuation cycle [s], the same for every robot and every spring."""


class Encoding(Protocol):
    """How genomes of one kind are made, varied, stored and expressed as robots.

    Every method works on a whole population at once and returns a new one; none but `overwrite`
    changes what it was given. Random numbers come from the generator passed in, nowhere else.
    """

    Settings: ClassVar[type[EncodingSettings]]
    """The part of a run's configuration that belongs to this encoding."""
    fixed_body: ClassVar[bool]
    """Whether all robots share the topology of one given body."""
    needs_body: ClassVar[bool]
    """Whether it is made over a given body; otherwise `body` is None."""

    def __init__(self, body: ws.Robot | None, settings: EncodingSettings) -> None: ...

    def random(self, n: int, rng: np.random.Generator) -> Genomes:
        """Make n unrelated genomes."""

    def mutate(self, genomes: Genomes, rng: np.random.Generator) -> Genomes:
        """Make one changed copy of every genome."""

    def tune(self, genomes: Genomes, rng: np.random.Generator) -> Genomes:
        """Make one copy of every genome that has the same body, but moves otherwise."""

    def cross(self, a: Genomes, b: Genomes, rng: np.random.Generator) -> Genomes:
        """Make one child of every pair a[i], b[i]."""

    def express(self, genomes: Genomes) -> Sequence[ws.Robot]:
        """Build the robots, ready to be packed into one simulation."""

    def distance(self, a: Genomes, b: Genomes) -> np.ndarray:
        """How different a[i] and b[i] are, shape (n,): 0 for equal, about 1 for unrelated ones."""

    def to_bytes(self, genomes: Genomes) -> list[bytes]:
        """One blob for every genome; equal genomes give equal blobs on every machine."""

    def from_bytes(self, blobs: Sequence[bytes]) -> Genomes:
        """The genomes of which `to_bytes` made the blobs, exactly."""

    def take(self, genomes: Genomes, indices: np.ndarray) -> Genomes:
        """The genomes at `indices`, in that order."""

    def concatenate(self, parts: Sequence[Genomes]) -> Genomes:
        """One population from several."""

    def overwrite(
        self, genomes: Genomes, rows: np.ndarray, others: Genomes, whence: np.ndarray
    ) -> None:
        """Put others[whence[i]] in place of genomes[rows[i]]: only for who just made `genomes`."""


def folded(genes: np.ndarray, circular: np.ndarray | bool = False) -> np.ndarray:
    """Bring genes back into [0, 1]: those on a circle go round, the others are reflected."""
    reflected = np.abs(genes - 2.0 * np.round(0.5 * genes))
    return np.where(circular, genes - np.floor(genes), reflected).astype(genes.dtype)


def coins(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Fair coins: bool, a bit of the generator each."""
    count = math.prod(shape)
    drawn = np.frombuffer(rng.bytes(-(-count // 8)), np.uint8)
    return np.unpackbits(drawn, count=count).reshape(shape).view(bool)


def sparse(shape: tuple[int, int], rate: float, rng: np.random.Generator) -> np.ndarray:
    """Coins that come up with a chance of `rate`, and at least one in each row: bool.

    Drawn are the gaps between those that come up: for small rates far fewer than there are coins.
    """
    rows, columns = shape
    found, last = np.zeros(rows * columns, bool), -1
    while last < len(found) and rate > 0.0:
        mean = rate * (len(found) - last)
        places = last + np.cumsum(rng.geometric(rate, int(mean + 4.0 * mean**0.5) + 8))
        found[places[places < len(found)]] = True
        last = int(places[-1])
    found = found.reshape(shape)
    found[np.arange(rows), rng.integers(columns, size=rows)] = True
    return found


class ArrayGenomes:
    """The housekeeping of encodings whose population is one float32 array (n, *genome_shape).

    Every gene lies in [0, 1].
    """

    genome_shape: tuple[int, ...]
    circular: np.ndarray | bool = False
    """Which genes go round, such as phases; broadcast to the genome's shape."""

    def to_vectors(self, genomes: np.ndarray) -> np.ndarray:
        """The genes of each genome in one row, shape (n, D), float64."""
        return genomes.reshape(len(genomes), -1).astype(np.float64)

    def from_vectors(self, vectors: np.ndarray) -> np.ndarray:
        """The genomes of rows of any real numbers, folded into [0, 1]."""
        genes = np.asarray(vectors, np.float64).reshape(len(vectors), *self.genome_shape)
        return folded(genes, self.circular).astype(np.float32)

    def take(self, genomes: np.ndarray, indices: np.ndarray) -> np.ndarray:
        """The genomes at `indices`, in that order."""
        return genomes[indices]

    def concatenate(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """One population from several."""
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def overwrite(
        self, genomes: np.ndarray, rows: np.ndarray, others: np.ndarray, whence: np.ndarray
    ) -> None:
        """Put others[whence[i]] in place of genomes[rows[i]]."""
        genomes[rows] = others[whence]

    def to_bytes(self, genomes: np.ndarray) -> list[bytes]:
        """Every genome as its genes in little-endian float32."""
        return [genome.tobytes() for genome in np.ascontiguousarray(genomes, dtype="<f4")]

    def from_bytes(self, blobs: Sequence[bytes]) -> np.ndarray:
        """The genomes of which `to_bytes` made the blobs; ValueError when a length is wrong."""
        size = 4 * int(np.prod(self.genome_shape))
        for i, blob in enumerate(blobs):
            if len(blob) != size:
                raise ValueError(
                    f"genome {i} has {len(blob)} bytes, expected {size}: "
                    "it belongs to another body or encoding"
                )
        genes = np.frombuffer(b"".join(blobs), dtype="<f4").astype(np.float32)
        return genes.reshape(len(blobs), *self.genome_shape)


class ListGenomes:
    """The housekeeping of encodings whose population is a list of immutable genomes."""

    def take(self, genomes: Sequence[Any], indices: np.ndarray) -> list[Any]:
        """The genomes at `indices`, in that order."""
        return [genomes[i] for i in indices]

    def concatenate(self, parts: Sequence[Sequence[Any]]) -> list[Any]:
        """One population from several."""
        return [genome for part in parts for genome in part]

    def overwrite(
        self, genomes: list[Any], rows: np.ndarray, others: Sequence[Any], whence: np.ndarray
    ) -> None:
        """Put others[whence[i]] in place of genomes[rows[i]]."""
        for row, place in zip(rows.tolist(), whence.tolist(), strict=True):
            genomes[row] = others[place]
