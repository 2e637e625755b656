"""The report of a run: its plots as PNG files, its parameters and results as a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evolve.config import RunConfig, SecondLookConfig
from evolve.errors import RunError
from evolve.fitness import UNITS
from evolve.record import Finalist, Record
from evolve.reports.plots import dot_plot, figure, learning_curve
from evolve.reports.units import with_unit
from evolve.run import Run
from evolve.store import Store

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["clock", "demotions", "describe", "draw", "metric", "results", "table", "verdict"]


def draw(run: Run) -> list[Path]:
    """Write learning_curve.png and dot_plot.png and return their paths.

    Raises:
        RunError: No generation is complete.
    """
    with run.read() as store:
        record = store.record()
    if not len(record.ids):
        raise RunError(f"{run.directory} has no complete generation yet: there is nothing to draw")
    paths = []
    for name, plot in {"learning_curve": learning_curve, "dot_plot": dot_plot}.items():
        page = figure()
        ax = plot(page.subplots(), record, run.config.task.fitness)
        ax.set_title(_title(run.config, record), loc="left", pad=32)
        path = run.directory / f"{name}.png"
        draft = path.with_suffix(".draft.png")
        page.savefig(draft)
        draft.replace(path)
        paths.append(path)
    return paths


def verdict(finalists: Sequence[Finalist], config: RunConfig) -> str:
    """Who is the champion, and what is left of its fitness at the second look, in one line.

    Args:
        finalists: Everybody who was looked at twice, survivors first, the fittest first.
        config: Of their run.
    """
    first = finalists[0]
    who = f"#{first.id} of generation {first.generation}"
    best = with_unit(f"{first.fitness:.3f}", UNITS[config.task.fitness])
    figures = f"{best}; {_second_look(first)}"
    if first.survives:
        return f"champion {who}: {figures}: survives"
    count = len(finalists)
    nobody = f"none of {count} good ones survives" if count > 1 else "the best does NOT survive"
    return f"no champion: {nobody} the second look; the fittest, {who}: {figures}"


def demotions(finalists: Sequence[Finalist]) -> str:
    """How many survive, and who lost the crown for not surviving."""
    survivors = [f for f in finalists if f.survives]
    words = f"{len(survivors)} of {len(finalists)} survive"
    if not survivors:
        return words
    demoted = [f for f in finalists if not f.survives and f.fitness > survivors[0].fitness]
    if not demoted:
        return f"{words}; nobody fitter than the champion was demoted"
    first = demoted[0]
    return (
        f"{words}; {len(demoted)} fitter than the champion demoted, the fittest "
        f"#{first.id}: {first.fitness:.3f}; {_second_look(first)}"
    )


def _body(config: RunConfig) -> str:
    """What the body is, or of what kind the bodies are."""
    if config.body is None:
        return f"every robot has its own, made by its genome ({config.encoding.type})"
    body = config.body.build()
    words = (
        f"{config.body.shape}: {body.n_masses} masses, {body.n_springs} springs, "
        f"{body.mass:g} kg, diameter {body.diameter:.3g} m"
    )
    return words if config.fixed_body else f"every robot has its own, descended from a {words}"


def describe(config: RunConfig) -> Iterator[tuple[str, str]]:
    """What a run does, in a few lines: (subject, words)."""
    yield "body", _body(config)
    yield (
        "search",
        f"{config.optimizer.type} over {config.encoding.type} genomes, "
        f"{config.population:,} x {config.generations:,} = "
        f"{config.population * config.generations:,} evaluations, "
        f"seed {config.seed}",
    )
    task, simulation, period = config.task, config.simulation, config.encoding.period
    step = "auto" if simulation.dt == "auto" else f"{simulation.dt * 1e3:g} ms"
    yield (
        "trial",
        f"{task.fitness} over {task.measure:g} cycles of {period:g} s after {task.settle:g} to "
        f"settle; {simulation.integrator}, dt {step}, {simulation.precision}",
    )
    look = task.second_look
    yield (
        "crown",
        f"to the fittest that keeps {look.threshold:.0%} at half the time step in float64 and "
        f"{_of_trials(look)}, of the {look.candidates} best, or of others while none of them does",
    )


def results(store: Store, config: RunConfig) -> Iterator[tuple[str, str]]:
    """What came of a run: (subject, words)."""
    record = store.record()
    springs, evaluating, driving = store.totals()
    yield "generations", f"{store.generations:,} of {config.generations:,}"
    yield "evaluations", f"{len(record.ids):,}, {_stopped(record)}"
    if np.isfinite(record.fitness).any():
        best = int(np.nanargmax(record.fitness))
        yield (
            "best",
            with_unit(f"{record.fitness[best]:.4g}", UNITS[config.task.fitness])
            + f" (#{record.ids[best]}, generation {record.generations[best]})",
        )
    if finalists := store.finalists():
        yield "verdict", verdict(finalists, config)
        yield "second look", demotions(finalists)
    if evaluating:
        yield "cost", f"{metric(springs)} spring evaluations in {clock(evaluating)}"
        yield "speed", f"{metric(springs / evaluating)} springs/s"
        yield "driver", f"{driving / (driving + evaluating):.1%} of the time"
    yield "digest", store.digest()


def table(run: Run) -> Table:
    """Parameters and results of a run, for the terminal."""
    from rich.markup import escape
    from rich.table import Table

    sheet = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    sheet.add_column(style="dim", no_wrap=True)
    sheet.add_column(overflow="fold")
    with run.read() as store:
        for subject, words in [*describe(run.config), *results(store, run.config)]:
            sheet.add_row(subject, escape(words))
    return sheet


def clock(seconds: float) -> str:
    """A duration as m:ss or h:mm:ss."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def metric(number: float) -> str:
    """A large number with a prefix: 1.02 G; a question mark for none."""
    if np.isnan(number):
        return "?"
    for limit, prefix in ((1e12, "T"), (1e9, "G"), (1e6, "M")):
        if number >= limit:
            return f"{number / limit:.3g} {prefix}"
    return f"{number:,.0f}"


def _stopped(record: Record) -> str:
    """How many robots were stopped, and why."""
    import warp_springs as ws

    codes, counts = np.unique(record.status[record.status != 0], return_counts=True)
    why = ", ".join(f"{ws.Status(c).name} {n:,}" for c, n in zip(codes, counts, strict=True))
    return f"{counts.sum():,} of them stopped" + (f" ({why})" if why else "")


def _second_look(finalist: Finalist) -> str:
    """Both figures of the second look."""

    def figure(fitness: float, kept: float) -> str:
        return "stopped" if np.isnan(fitness) else f"{fitness:.3f} ({kept:.0%})"

    halved = figure(finalist.halved, finalist.halved_kept)
    perturbed = figure(finalist.perturbed, finalist.perturbed_kept)
    return f"{halved} at half the time step, {perturbed} from perturbed starts"


def _of_trials(look: SecondLookConfig) -> str:
    which = "the median" if look.quantile == 0.5 else f"the {look.quantile:g} quantile"
    return f"in {which} of {look.trials} perturbed starts"


def _title(config: RunConfig, record: Record) -> str:
    return (
        f"{config.name}: {config.optimizer.type} over {config.encoding.type} genomes, "
        f"seed {config.seed}, {len(record.ids):,} evaluations"
    )
