"""The best robots of a run in motion, as a part of its report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from evolve.judging.evaluate import Evaluator
from evolve.reports.subject import Subject, share
from evolve.reports.units import with_unit

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["watch"]


def watch(report: ws.Document, subject: Subject) -> None:
    """Films of the best, of the best side by side and of the best dropped, and a page to play."""
    report.section("Watch")
    film, zoo, duration = subject.film, subject.zoo, subject.shown
    cycles = f"{duration / subject.run.config.encoding.period:g} cycles"
    part = {"start": float(film.times[-1]) - duration, "duration": duration}
    alone = [report.film(film, f"The best, #{zoo[0]}, {cycles}.", 0, **part)]
    if film.scene.ground is not None:
        words = f"#{zoo[0]} dropped from as high as it is long, its muscles at work."
        alone.append(report.film(_fall(subject), words, duration=duration))
    report.row(*alone)
    if len(zoo) > 1:
        words = f"The {len(zoo)} best side by side, {cycles}."
        report.film(film, words, range(len(zoo)), **part)
    report.player(
        film,
        "The best, to walk around.",
        names={place: f"#{individual}" for place, individual in enumerate(zoo)},
        custom_data=dict(enumerate(_page_facts(subject))),
        title=f"{subject.run.config.name}: the best",
    )


def _fall(subject: Subject) -> ws.Result:
    """The trial of the best, begun as high above the floor as it is long."""
    robot = subject.film.robots[0]
    return Evaluator(subject.run.config).film([robot.moved((0.0, 0.0, robot.diameter))])


def _page_facts(subject: Subject) -> Iterator[dict[str, str]]:
    """What the page says about each robot of the zoo."""
    found = {f.id: f for f in subject.finalists}
    for individual in subject.zoo:
        facts = {
            subject.run.config.task.fitness: with_unit(
                f"{subject.fitness(individual):.3f}", subject.unit
            )
        }
        if finalist := found.get(individual):
            facts["generation"] = f"{finalist.generation:,}"
            facts["half the step"] = share(finalist.halved_kept)
            facts["perturbed"] = share(finalist.perturbed_kept)
            facts["second look"] = "survives" if finalist.survives else "demoted"
        yield facts
