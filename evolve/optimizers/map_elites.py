"""MAP-Elites: the best robot for every kind of behaviour (needs the extra `qd`)."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from evolve.encodings.base import Encoding
from evolve.errors import RunError
from evolve.optimizers.base import Individuals, OptimizerSettings, described
from evolve.optimizers.variation import Breeder, BreedingSettings
from evolve.streams import Role, Streams

__all__ = ["MapElites", "MapElitesSettings"]


class MapElitesSettings(BreedingSettings):
    """The grid of behaviours."""

    type: Literal["map_elites"] = "map_elites"
    descriptors: tuple[str, ...] = Field(("displacement_x", "displacement_y"), min_length=1)
    """Descriptors of the trial that span the grid."""
    bins: tuple[int, ...] = (24, 24)
    """Cells along each of them."""
    lowest: tuple[float, ...] = (-2.0, -2.0)
    """Where the grid begins; what lies outside belongs to the outermost cell."""
    highest: tuple[float, ...] = (2.0, 2.0)
    """Where it ends."""
    crossover_rate: float = Field(0.3, ge=0.0, le=1.0)
    """Share of the children with two parents; the others have one."""

    @property
    def measures(self) -> tuple[str, ...]:
        """What spans the grid."""
        return self.descriptors

    @property
    def niches(self) -> tuple[str, ...]:
        """The same."""
        return self.descriptors

    @model_validator(mode="after")
    def _fits(self) -> MapElitesSettings:
        count = len(self.descriptors)
        for name in ("bins", "lowest", "highest"):
            if len(getattr(self, name)) != count:
                raise ValueError(f"{name}: expected {count} numbers, one for each descriptor")
        if min(self.bins) < 1:
            raise ValueError("bins: expected whole numbers of 1 or more")
        if not all(low < high for low, high in zip(self.lowest, self.highest, strict=True)):
            raise ValueError("lowest: expected to be below highest")
        return self


class MapElites(Breeder):
    """Mouret and Clune (2015): a grid over behaviour, in every cell the best of all so far.

    Parents are drawn evenly from the filled cells. The survivors are the elites, in the order of
    their cells.
    """

    Settings: ClassVar[type[OptimizerSettings]] = MapElitesSettings

    settings: MapElitesSettings

    def __init__(self, encoding: Encoding, streams: Streams, settings: Any) -> None:
        super().__init__(encoding, streams, settings)
        try:
            from ribs.archives import GridArchive
        except ImportError:
            raise RunError(
                "map_elites needs ribs: install it with pip install 'warp-springs[qd]'"
            ) from None
        ranges = list(zip(settings.lowest, settings.highest, strict=True))
        self._make_archive = lambda: GridArchive(
            solution_dim=(), dims=settings.bins, ranges=ranges, solution_dtype=np.int64
        )

    def cells(self, individuals: Individuals) -> np.ndarray:
        """Cell of each individual in the flattened grid, shape (n,)."""
        return self._make_archive().index_of(self._measures(individuals))

    def _parents(self, n: int) -> np.ndarray:
        rng = self.streams(self.turn, Role.SELECTION)
        return rng.integers(len(self._survivors), size=(n, 2))

    def _tell(self, individuals: Individuals) -> None:
        pool = individuals
        if self._survivors is not None:
            pool = self._joined(self._survivors, individuals)
        measures, worth = self._measures(pool), pool.scores.worth
        good = np.flatnonzero(np.isfinite(measures).all(axis=1) & np.isfinite(worth))
        if not len(good):
            return
        # The archive knows places in the pool; genomes stay with their encoding. It keeps an elite
        # until somebody better comes, and survivors come first.
        archive = self._make_archive()
        archive.add(good, worth[good], measures[good])
        elites = archive.data(["solution", "index"])
        self._survivors = self._take(pool, elites["solution"][np.argsort(elites["index"])])

    def _measures(self, individuals: Individuals) -> np.ndarray:
        return described(individuals.scores, self.settings.descriptors)
