"""The report of a run, or of several, as one HTML file that tells a stranger everything."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evolve.errors import RunError
from evolve.reports.archive import atlas, heat_map, niches
from evolve.reports.comparison import Group, compare, groups
from evolve.reports.diversity import diversity, diversity_plot
from evolve.reports.family import family
from evolve.reports.figures import clock, demotions, describe, metric, results, verdict
from evolve.reports.findings import findings
from evolve.reports.parameters import parameters
from evolve.reports.plots import dot_plot, figure, learning_curve, performance
from evolve.reports.subject import Subject, examine, share
from evolve.reports.tables import write_table
from evolve.reports.units import in_units, titled, with_unit
from evolve.reports.watch import watch
from evolve.run import Run
from evolve.store import Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["REPORT", "write_report"]

REPORT = "report.html"
LONG_LINE = 70
"""Letters of a command that goes into several lines."""
FILES = {
    "champion.usdc": "animation of the champion, OpenUSD",
    "zoo.usdc": "animation of the best, side by side",
    "zoo.png": "picture of the best",
    "learning_curve.png": "learning curve",
    "dot_plot.png": "every individual as a dot",
    "record.csv": "every evaluation as a row: fitness, status, parents, descriptors",
    "run.sqlite": "the record of the run, with every genome",
    "run.toml": "the configuration that repeats it",
}
"""What may lie beside a report: name -> what it is."""


CHAMPION_PLOTS = (
    (
        ("energies", "Its energies over the whole trial, and what the ledger cannot account for."),
        ("footfall", "Which of its feet touch the ground when."),
    ),
    (
        ("height", "Height of its centre of mass."),
        ("speed", "Speed of its centre of mass over the ground."),
    ),
    (
        ("trajectory", "Its way over the floor, seen from above."),
        ("stress_histogram", "How strongly its springs are stretched and compressed."),
    ),
)
"""Of the best robot, two in a row: name in `warp_springs.plots`, caption."""


def write_report(
    runs: Sequence[Run],
    path: Path | None = None,
    notes: str = "",
    progress: Callable[[str], None] = lambda words: None,
) -> list[Path]:
    """Write the report of the first run, compared with the others if there are any.

    Runs that differ in nothing but the seed are averaged; other encodings and optimizers, random
    search and hill climbing for example, become curves and rows of a comparison. Everything is
    inside the file but the animations, tables and pictures that it links to.

    Args:
        runs: One run or several; also runs that are going on.
        path: File to write; ``report.html`` in the folder of the first run by default.
        notes: Words of your own, paragraphs apart by empty lines.
        progress: Told what is being done.

    Returns:
        The paths of the report and of the table of evaluations that it links to.

    Raises:
        RunError: The first run has no individual with a fitness, or another no generation.
    """
    import warp_springs as ws

    run = runs[0]
    path = run.directory / REPORT if path is None else path
    for other in runs:
        with other.read() as store:
            if not store.generations:
                raise RunError(
                    f"{other.directory} has no complete generation yet: nothing to report"
                )
    progress("simulating the best again")
    subject = examine(run)
    several = groups(runs)
    report = ws.Document(f"{run.config.name}: report of a run", subtitle=run.config.about)
    with run.read() as store:
        _summary(report, subject, store)
        progress("filming")
        watch(report, subject)
        progress("drawing")
        _learning(report, subject, several, store.costs())
        _champion(report, subject)
        _zoo(report, subject)
        _atlas(report, subject, store)
        if not run.config.fixed_body:
            family(report, run, store, subject.zoo[0])
        if len(several) > 1:
            _comparison(report, subject, several)
        _findings(report, subject, several, notes)
        _parameters(report, subject, store)
        _again(report, subject, runs, store)
    table = write_table(run, run.directory / "record.csv")
    progress("writing")
    _files(report, run, path)
    return [report.write(path), table]


def _summary(report: ws.Document, subject: Subject, store: Store) -> None:
    config, finalists = subject.run.config, subject.finalists
    complete = store.generations >= config.generations
    if finalists:
        report.verdict(verdict(finalists, config), good=finalists[0].survives)
    else:
        figure = with_unit(f"{subject.fitness(subject.zoo[0]):.3f}", subject.unit)
        best = f"#{subject.zoo[0]} with {figure}"
        report.verdict(f"not looked at twice yet; the best so far is {best}", good=False)
    if not complete:
        report.text(
            f"The run is not complete: {store.generations:,} of {config.generations:,} generations."
        )
    springs, evaluating, driving = store.totals()
    first = finalists[0] if finalists else None
    tiles = [(titled(f"{config.task.fitness} of the best", subject.unit),
              f"{subject.fitness(subject.zoo[0]):.3f}")]  # fmt: skip
    if first:
        tiles.append(("left at half the time step", share(first.halved_kept)))
        tiles.append(("left from perturbed starts", share(first.perturbed_kept)))
    tiles += [
        ("evaluations", f"{len(subject.record.ids):,}"),
        ("spring evaluations", metric(springs)),
        ("springs per second", metric(springs / evaluating) if evaluating else "?"),
        ("of computing [min:s]", clock(evaluating + driving)),
    ]
    report.tiles(tiles)
    report.table(list(describe(config)))


def _learning(
    report: ws.Document, subject: Subject, several: Sequence[Group], costs: tuple
) -> None:
    report.section("Learning")
    fitness = subject.run.config.task.fitness
    count = sum(len(group.seeds) for group in several)
    if count > 1:
        chart = figure(9.4, 4.6)
        compare(chart.subplots(), several, fitness)
        words = (
            "Best so far against evaluations: mean over seeds, shaded its standard error. "
            "A single seed has no error."
        )
        report.plot(chart, words)
    curve, dots = figure(8.0, 4.8), figure(8.0, 4.8)
    learning_curve(curve.subplots(), subject.record, fitness)
    dot_plot(dots.subplots(), subject.record, fitness)
    report.row(
        report.plot(curve, "Learning curve of this run: best so far, and what each generation is."),
        report.plot(dots, "Every individual of this run is a dot."),
    )
    spread, cost = figure(6.8, 4.1), figure(6.8, 4.1)
    diversity_plot(spread.subplots(), diversity(subject.run))
    performance(cost.subplots(), subject.record, costs, fitness)
    report.row(
        report.plot(
            spread,
            "Diversity: mean distance of two random individuals of a generation. Genomes: 0 equal, "
            "about 1 unrelated. Behaviour and shape: in standard deviations of what is measured.",
        ),
        report.plot(cost, "Best so far against what it cost."),
    )


def _champion(report: ws.Document, subject: Subject) -> None:
    import warp_springs as ws

    report.section("The best robot")
    robot = subject.film.robots[0]
    report.text(
        f"#{subject.zoo[0]}: {robot.n_masses} masses, {robot.n_springs} springs, "
        f"{robot.mass:.3g} kg, {robot.diameter:.3g} m between its farthest masses. "
        f"It moves at {_speed_words(subject)}."
    )
    for pair in CHAMPION_PLOTS:
        parts = []
        for name, words in pair:
            page = figure(6.8, 4.3)
            called = {"name": f"#{subject.zoo[0]}"} if name == "speed" else {}
            getattr(ws.plots, name)(page.subplots(), subject.film, 0, **called)
            parts.append(report.plot(page, words))
        report.row(*parts)


def _zoo(report: ws.Document, subject: Subject) -> None:
    report.section("Zoo")
    labels = [f"#{i}   {subject.fitness(i):.2f}" for i in subject.zoo]
    apart = niches(subject.run.config)
    words = f"The {len(labels)} best different individuals at the end of their trial."
    if apart:
        words = (
            f"The best, and {len(labels) - 1} good individuals that differ most from each other in "
            f"{_listed(apart)}, at the end of their trial."
        )
    report.still(subject.film, words, labels=labels)
    if subject.finalists:
        report.table(
            [
                (f"#{f.id}", f.generation, f"{f.fitness:.3f}", share(f.halved_kept),
                 share(f.perturbed_kept), "yes" if f.survives else "no")
                for f in subject.finalists if f.id in subject.zoo
            ],
            ("individual", "generation", subject.run.config.task.fitness, "left at half the step",
             "left from perturbed starts", "survives"),
            caption=f"Second look: {demotions(subject.finalists)}.",
        )  # fmt: skip


def _atlas(report: ws.Document, subject: Subject, store: Store) -> None:
    """The best of every kind as a heat map, where more than fitness tells individuals apart."""
    found = atlas(subject.run, store)
    if found is None:
        return
    report.section("Atlas")
    described = store.scores(subject.zoo).descriptors
    nothing = np.full(len(subject.zoo), 0.5)
    places = np.stack([described.get(name, nothing) for name in found.names], axis=1)
    chart = figure(8.4, 5.0)
    heat_map(chart.subplots(), found, subject.run.config.task.fitness, places)
    words = (
        f"The fitness of the best of every kind that was found, {len(found.filled):,} kinds "
        f"({found.coverage:.0%} of the cells); the numbers are the robots of the zoo, in its order."
    )
    report.row(report.plot(chart, words))


def _listed(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _comparison(report: ws.Document, subject: Subject, several: Sequence[Group]) -> None:
    report.section("Alternatives tried")
    rows = []
    for group in several:
        bests = np.array([seed.best for seed in group.seeds])
        mean, error = float(np.mean(bests)), _standard_error(bests)
        crowned = [seed.champion.perturbed for seed in group.seeds if seed.champion]
        least = min(len(seed.record.ids) for seed in group.seeds)
        rows.append((
            group.label, len(bests), least, f"{mean:.3f}", error, f"{np.max(bests):.3f}",
            f"{np.mean(crowned):.3f}" if crowned else "not looked at twice",
        ))  # fmt: skip
    report.table(
        rows,
        ("runs", "seeds", "evaluations", "mean of the best", "standard error", "best of all",
         "champions from perturbed starts"),
        caption=f"{in_units(subject.run.config.task.fitness, subject.unit)}; evaluations of the "
        "shortest seed.",
    )  # fmt: skip


def _findings(report: ws.Document, subject: Subject, several: Sequence[Group], notes: str) -> None:
    report.section("What worked and what did not")
    report.text(*findings(subject.record, subject.finalists, several, subject.unit))
    report.text(*(" ".join(part.split()) for part in notes.split("\n\n") if part.strip()))


def _parameters(report: ws.Document, subject: Subject, store: Store) -> None:
    report.section("Every parameter")
    report.table(list(parameters(subject.run.config)), ("parameter", "value", "meaning"))
    report.heading("Made by")
    origin = {key: value for key, value in store.meta.items() if key != "config"}
    film = subject.film
    seen = {"device": film.device, "precision": film.precision, "integrator": film.integrator,
            "seed": str(subject.run.config.seed)}  # fmt: skip
    report.table([*seen.items(), *origin.items()])


def _again(report: ws.Document, subject: Subject, runs: Sequence[Run], store: Store) -> None:
    report.section("Make it again")
    lines = [
        f"evolve run {_folder(subject.run)}/run.toml --out again",
        "evolve digest again",
        f"# {dict(results(store, subject.run.config))['digest']}",
        "evolve report again",
    ]
    if len(runs) > 1:
        words = ["evolve report", *map(_folder, runs)]
        long = sum(map(len, words)) > LONG_LINE
        lines += ["# and beside the others:", (" \\\n  " if long else " ").join(words)]
    report.code(*lines)
    report.text(
        "The digest is a hash of everything the run decided: the same configuration on the same "
        "kind of machine gives the same."
    )


def _folder(run: Run) -> str:
    """The folder of a run as it is called, with the folder of the seeds that it is one of."""
    folder = run.directory.resolve()
    return f"{folder.parent.name}/{folder.name}" if folder.name.startswith("seed-") else folder.name


def _files(report: ws.Document, run: Run, path: Path) -> None:
    """Links to what lies beside the report, or where the run is if the report is elsewhere."""
    report.section("Files")
    base = path.resolve().parent
    links = []
    for name, words in FILES.items():
        file = run.directory.resolve() / name
        if file.exists():
            shown = file.as_uri()
            with suppress(ValueError):
                shown = file.relative_to(base).as_posix()
            links.append((shown, words))
    report.links(links)


def _speed_words(subject: Subject) -> str:
    """How fast the best is, in body diameters per cycle and in m/s, over the measurement."""
    config, film = subject.run.config, subject.film
    settle = config.task.settle * config.encoding.period
    robot, frames = film.robots[0], film.frames(0)
    start = int(np.searchsorted(film.times, settle))
    way = (frames[-1] - frames[start]).T @ robot.masses / robot.mass
    seconds = float(film.times[-1] - film.times[start])
    speed = float(np.hypot(*way[:2])) / max(seconds, 1e-12)
    per_cycle = speed * config.encoding.period / robot.diameter
    return f"{per_cycle:.3f} body diameters per cycle, {speed:.3g} m/s"


def _standard_error(values: np.ndarray) -> str:
    return f"{np.std(values, ddof=1) / np.sqrt(len(values)):.3f}" if len(values) > 1 else "one seed"
