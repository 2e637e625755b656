"""How different the individuals of a generation are, in their genomes and in what they do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.encodings.base import Encoding, Genomes
from evolve.run import Run
from evolve.streams import Role, Streams

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Diversity", "diversity", "diversity_plot"]

GENERATIONS = 48
"""Generations that are looked at, evenly spread over a run."""
PAIRS = 64
"""Pairs of individuals that are compared in each."""
OF_BODY = ("mass", "diameter", "springs", "muscles", "symmetry")
"""Descriptors that say what a body is, not what it does."""


@dataclass(frozen=True)
class Diversity:
    """Of G generations of a run."""

    evaluations: np.ndarray
    """Evaluations up to and with each, shape (G,)."""
    genotype: np.ndarray
    """Mean distance of the genomes of two individuals, shape (G,): 0 for equal ones, about 1 for
    unrelated ones."""
    behaviour: np.ndarray
    """Mean distance of two individuals in their descriptors, each in units of its standard
    deviation over the looked-at individuals of the run, divided by the square root of their
    number, shape (G,). NaN where fewer than two individuals have any."""
    shape: np.ndarray | None = None
    """The same, in the descriptors of the body that are recorded; None where all share one body, or
    none is recorded."""
    bodies: np.ndarray | None = None
    """Share of different topologies among the looked-at individuals, shape (G,); None where all
    share one body."""


def diversity(run: Run) -> Diversity:
    """Measure the diversity of a run over time, by random pairs of each generation.

    The pairs are drawn from a stream of the run's seed, so the figures can be had again.
    """
    encoding, evolving = run.config.make_encoding(), not run.config.fixed_body
    streams = Streams(run.config.seed)
    with run.read() as store:
        record = store.record()
        numbers = np.unique(record.generations)
        looked = numbers[
            np.linspace(0, len(numbers) - 1, min(GENERATIONS, len(numbers))).astype(int)
        ]
        ends, genotype, described, bodies = [], [], [], []
        for number in looked:
            ids = record.ids[record.generations == number]
            rng = streams(int(number), Role.DIVERSITY)
            first = rng.integers(len(ids), size=PAIRS)
            second = (first + rng.integers(1, max(len(ids), 2), size=PAIRS)) % len(ids)
            pairs = np.concatenate([ids[first], ids[second]])
            genomes = encoding.from_bytes(store.genomes(pairs))
            halves = (encoding.take(genomes, np.arange(k * PAIRS, (k + 1) * PAIRS)) for k in (0, 1))
            genotype.append(float(np.mean(encoding.distance(*halves))))
            columns = store.scores(pairs).descriptors
            described.append(np.stack(list(columns.values()), axis=1))
            if evolving:
                bodies.append(_different(encoding, genomes, pairs))
            ends.append(int(ids[-1]))
    values, names = np.stack(described), list(columns)
    of_body = [names.index(name) for name in names if name in OF_BODY]
    moving = [place for place in range(len(names)) if place not in of_body]
    return Diversity(
        np.array(ends),
        np.array(genotype),
        _spread(values[:, :, moving]),
        _spread(values[:, :, of_body]) if evolving and of_body else None,
        np.array(bodies) if evolving else None,
    )


def _different(encoding: Encoding, genomes: Genomes, ids: np.ndarray) -> float:
    """Share of different topologies among some different individuals."""
    _, first = np.unique(ids, return_index=True)
    robots = encoding.express(encoding.take(genomes, first))
    return len({robot.topology for robot in robots}) / len(first)


def diversity_plot(ax: Axes, found: Diversity) -> Axes:
    """Draw the diversity of genomes, behaviour and bodies against evaluations.

    Args:
        ax: Axes to draw into.
        found: What `diversity` returned.
    """
    lines = (
        ("genomes", found.genotype, "-", "#3a6ea5"),
        ("behaviour", found.behaviour, "--", "#c8452d"),
        ("shape of bodies", found.shape, "-.", "#2e8b6f"),
        ("share of different bodies", found.bodies, ":", "#5b4636"),
    )
    for label, values, line, color in lines:
        if values is not None:
            ax.plot(found.evaluations, values, line, color=color, linewidth=1.9, label=label)
    ax.set_xlabel("evaluations")
    ax.set_ylabel("mean distance of two individuals")
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(left=0.0)
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    ax.grid(axis="y", color="#8a8d91", alpha=0.25, linewidth=0.8)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False)
    return ax


def _spread(described: np.ndarray) -> np.ndarray:
    """Mean distance of the pairs of every generation, from descriptors (G, 2 * PAIRS, D)."""
    known = np.isfinite(described).all(axis=2)
    scale = np.std(described[known], axis=0) if known.any() else np.ones(described.shape[2])
    values = np.divide(described, scale, out=np.zeros_like(described), where=scale > 0.0)
    apart = np.linalg.norm(values[:, :PAIRS] - values[:, PAIRS:], axis=2)
    apart /= np.sqrt(max(np.count_nonzero(scale > 0.0), 1))
    both = known[:, :PAIRS] & known[:, PAIRS:]
    count = both.sum(axis=1)
    total = np.where(both, apart, 0.0).sum(axis=1)
    return np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
