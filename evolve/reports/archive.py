"""The atlas of a run: the best individual of every kind, kinds being cells of a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import DESCRIPTORS, RunConfig
from evolve.fitness import UNITS
from evolve.optimizers.map_elites import MapElitesSettings
from evolve.reports.units import titled
from evolve.run import Run
from evolve.store import Store

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Atlas", "atlas", "heat_map", "niches"]

CELLS = 12
"""Along each axis, where the optimizer has no grid of its own."""
TAILS = 0.01
"""Share of the individuals at either end of an axis that do not stretch it."""


@dataclass(frozen=True)
class Atlas:
    """The best of every cell of a grid of B x C cells over two descriptors."""

    names: tuple[str, str]
    edges: tuple[np.ndarray, np.ndarray]
    """Where the cells begin and end, shapes (B + 1,) and (C + 1,); whoever lies outside belongs to
    the outermost cell."""
    ids: np.ndarray
    """The best individual of each cell, shape (B, C); 0 where there is none."""
    fitness: np.ndarray
    """Its fitness, shape (B, C); NaN where there is none."""

    @property
    def filled(self) -> np.ndarray:
        """The best individuals of the cells that have one, the fittest first, shape (K,)."""
        found = self.ids[self.ids > 0]
        return found[np.lexsort((found, -self.fitness[self.ids > 0]))]

    @property
    def coverage(self) -> float:
        """Share of the cells that have somebody."""
        return float((self.ids > 0).mean())


def niches(config: RunConfig) -> tuple[str, ...]:
    """The descriptors by which the individuals of a run are told apart; none if by fitness alone.

    Those of an optimizer that keeps an archive; where bodies evolve, all that the run records
    beside way and height.
    """
    if found := config.optimizer.niches:
        return found
    if config.fixed_body:
        return ()
    return tuple(name for name in config.descriptors if name not in DESCRIPTORS)


def atlas(run: Run, store: Store) -> Atlas | None:
    """The atlas of a run over two of its `niches`; None where it has none, or nobody.

    Over the grid of MAP-Elites, its first two descriptors, where the optimizer is that; else over
    what was found, the first descriptor and the one that goes along with it least.
    """
    names = niches(run.config)
    record = store.record()
    ids = record.ids[np.isfinite(record.fitness)]
    if not names or not len(ids):
        return None
    found = store.descriptors(names)[np.isfinite(record.fitness)]
    good = np.isfinite(found).all(axis=1)
    ids, found = ids[good], found[good]
    fitness = record.fitness[np.isfinite(record.fitness)][good]
    if not len(ids):
        return None
    two = [0, 1][: len(names)]
    if len(names) > 2 and not isinstance(run.config.optimizer, MapElitesSettings):
        two[1] = _least_alike(found)
    names, found = tuple(names[place] for place in two), found[:, two]
    edges = _edges(run.config, names, found)
    places = [
        np.clip(np.searchsorted(edge, column, side="right") - 1, 0, len(edge) - 2)
        for edge, column in zip(edges, found.T, strict=True)
    ]
    if len(names) == 1:  # a row of cells
        names, edges = (*names, ""), [*edges, np.array([0.0, 1.0])]
        places.append(np.zeros(len(ids), np.int64))
    shape = (len(edges[0]) - 1, len(edges[1]) - 1)
    best, worth = np.zeros(shape, np.int64), np.full(shape, np.nan)
    # The last to be written is the best of a cell; of equals, the older.
    order = np.lexsort((-ids, fitness))
    where = tuple(place[order] for place in places)
    best[where], worth[where] = ids[order], fitness[order]
    return Atlas((names[0], names[1]), (edges[0], edges[1]), best, worth)


def _least_alike(found: np.ndarray) -> int:
    """Which column of a table (n, D) but the first is least correlated with the first."""
    scaled = found - found.mean(axis=0)
    spread = np.sqrt((scaled**2).sum(axis=0))
    alike = np.abs(scaled[:, 0] @ scaled) / np.maximum(spread[0] * spread, 1e-300)
    # What is the same for everybody tells nobody apart.
    return 1 + int(np.where(spread > 0.0, alike, np.inf)[1:].argmin())


def _edges(config: RunConfig, names: Sequence[str], found: np.ndarray) -> list[np.ndarray]:
    """Edges of the cells along each of the descriptors (n, D)."""
    settings = config.optimizer
    if isinstance(settings, MapElitesSettings):
        grid = zip(settings.lowest, settings.highest, settings.bins, strict=True)
        return [np.linspace(low, high, bins + 1) for low, high, bins in list(grid)[: len(names)]]
    ends = np.quantile(found, [TAILS, 1.0 - TAILS], axis=0)
    return [np.linspace(low, high if high > low else low + 1.0, CELLS + 1) for low, high in ends.T]


def heat_map(
    ax: Axes, found: Atlas, fitness: str = "speed", marked: np.ndarray | None = None
) -> Axes:
    """Draw the fitness of the best of every cell.

    Args:
        ax: Axes to draw into.
        found: What `atlas` returned.
        fitness: Name of the fitness, for the label of the colours.
        marked: Where to write 1, 2, ...: both descriptors of some individuals, shape (K, 2).
    """
    first, second = found.edges
    low = min(0.0, float(np.nanmin(found.fitness)))
    mesh = ax.pcolormesh(
        first, second, found.fitness.T, cmap="viridis", vmin=low, edgecolors="white", linewidth=0.4
    )
    ax.set_facecolor("#eceef0")
    ax.figure.colorbar(mesh, ax=ax, label=titled(fitness, UNITS[fitness]), pad=0.02)
    ball = {"boxstyle": "circle,pad=0.18", "facecolor": "white", "edgecolor": "#1f2328"}
    for number, (x, y) in enumerate([] if marked is None else marked, 1):
        x, y = np.clip(x, first[0], first[-1]), np.clip(y, second[0], second[-1])
        ax.text(
            x, y, str(number), ha="center", va="center", fontsize=8, color="#c8452d",
            fontweight="bold", bbox=ball,
        )  # fmt: skip
    ax.set_xlabel(_label(found.names[0]))
    ax.set_ylabel(_label(found.names[1]))
    if not found.names[1]:
        ax.set_yticks([])
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def _label(name: str) -> str:
    unit = UNITS.get(name, "")
    return titled(name, "" if unit == name else unit)
