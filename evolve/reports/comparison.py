"""Several runs side by side: those that differ in nothing but their seed are one group."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import RunConfig
from evolve.fitness import UNITS
from evolve.provenance import decisive
from evolve.record import Finalist, Record
from evolve.reports.units import titled
from evolve.run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Curve", "Group", "Seed", "best_so_far", "compare", "groups"]

COLORS = ("#c8452d", "#3a6ea5", "#8a8d91", "#2e8b6f", "#b07cc6", "#d9a13b", "#5b4636", "#1f2328")
LINES = ("-", "--", ":", "-.")
POINTS = 240
"""Places at which the curves of several seeds are averaged."""


@dataclass(frozen=True)
class Seed:
    """One run of a group."""

    config: RunConfig
    record: Record
    finalists: Sequence[Finalist]

    @property
    def best(self) -> float:
        """The best fitness of the run; NaN when nobody has one."""
        return float(best_so_far(self.record.fitness)[-1])

    @property
    def champion(self) -> Finalist | None:
        """The champion, if the run was looked at twice and somebody survived."""
        return self.finalists[0] if self.finalists and self.finalists[0].survives else None


@dataclass(frozen=True)
class Curve:
    """The best so far, averaged over seeds, at P numbers of evaluations."""

    evaluations: np.ndarray
    """Shape (P,)."""
    mean: np.ndarray
    """Shape (P,); NaN until every seed has somebody with a fitness."""
    error: np.ndarray
    """Standard error of the mean, shape (P,); NaN for a single seed."""


@dataclass(frozen=True)
class Group:
    """Runs of one configuration with different seeds."""

    label: str
    seeds: Sequence[Seed]

    def curve(self) -> Curve:
        """Mean and standard error of the best so far, as far as all seeds have come."""
        last = min(len(seed.record.ids) for seed in self.seeds)
        evaluations = np.unique(np.linspace(1, last, POINTS).round().astype(np.int64))
        best = np.stack([best_so_far(s.record.fitness)[evaluations - 1] for s in self.seeds])
        count = len(self.seeds)
        spread = np.std(best, axis=0, ddof=1) if count > 1 else np.full(best.shape[1], np.nan)
        return Curve(evaluations, best.mean(axis=0), spread / np.sqrt(count))


def best_so_far(fitness: np.ndarray) -> np.ndarray:
    """Running maximum, NaN until somebody has a fitness."""
    best = np.maximum.accumulate(np.where(np.isfinite(fitness), fitness, -np.inf))
    return np.where(np.isfinite(best), best, np.nan)


def groups(runs: Sequence[Run]) -> list[Group]:
    """Put runs of one configuration together, in the order in which they were given.

    A group is called by what tells it from the others: the values of the keys in which they
    differ, the optimizer and the encoding first.
    """
    together: dict[tuple, list[Seed]] = {}
    settings: dict[tuple, dict] = {}
    for run in runs:
        with run.read() as store:
            seed = Seed(run.config, store.record(), store.finalists())
        flat = {key: value for key, value in decisive(run.config).items() if key != "seed"}
        key = tuple(sorted((k, repr(v)) for k, v in flat.items()))
        together.setdefault(key, []).append(seed)
        settings[key] = flat
    labels = _labels(list(settings.values()), [s[0].config for s in together.values()])
    return [Group(label, s) for label, s in zip(labels, together.values(), strict=True)]


def compare(ax: Axes, several: Sequence[Group], fitness: str = "speed") -> Axes:
    """Draw the mean best so far of every group against evaluations, with its standard error.

    Args:
        ax: Axes to draw into.
        several: What `groups` returned.
        fitness: Name of the fitness, for the label of the axis.
    """
    for index, group in enumerate(several):
        curve = group.curve()
        color, line = COLORS[index % len(COLORS)], LINES[index // len(COLORS) % len(LINES)]
        low, high = curve.mean - curve.error, curve.mean + curve.error
        ax.fill_between(curve.evaluations, low, high, color=color, alpha=0.2, linewidth=0)
        count = len(group.seeds)
        label = f"{group.label} ({count} seed{'s' if count > 1 else ''})"
        ax.plot(curve.evaluations, curve.mean, line, color=color, linewidth=1.9, label=label)
    ax.set_xlabel("evaluations")
    ax.set_ylabel(titled(f"best {fitness} so far", UNITS[fitness]))
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    ax.grid(axis="y", color="#8a8d91", alpha=0.25, linewidth=0.8)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="upper left", frameon=False)
    return ax


def _labels(settings: Sequence[dict], configs: Sequence[RunConfig]) -> list[str]:
    """A name for every group; the keys that all of them share go without saying."""
    first = ("optimizer.type", "encoding.type")
    keys = {key for flat in settings for key in flat}
    # The settings of another optimizer differ because it is another: its name says so.
    named = [key for key in first if len({repr(flat.get(key)) for flat in settings}) > 1]
    hidden = tuple(key.partition(".")[0] + "." for key in named)
    differ = len({config.fixed_body for config in configs}) > 1
    if differ:  # which body it is says its shape
        hidden += tuple(key for key in keys if key.startswith("body.") and key != "body.shape")
    others = sorted(
        key
        for key in keys
        if key not in first
        and not key.startswith(hidden)
        and len({repr(flat.get(key)) for flat in settings}) > 1
    )
    labels = []
    for flat, config in zip(settings, configs, strict=True):
        words = [str(flat[key]).replace("_", " ") for key in named]
        if differ:
            words.append("fixed body" if config.fixed_body else "bodies evolve")
        words += [f"{key.rpartition('.')[2]} {flat[key]}" for key in others[:3] if key in flat]
        labels.append(", ".join(words) or config.name)
    return [
        f"{label} ({configs[i].name})" if labels.count(label) > 1 else label
        for i, label in enumerate(labels)
    ]
