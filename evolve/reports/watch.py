"""The best robots of a run in motion, as a part of its report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from evolve.reports.subject import Subject, share

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["watch"]


def watch(report: ws.Document, subject: Subject) -> None:
    """Films of the best, of the best side by side and of the best dropped, and a page to play."""
    report.section("Watch")
    film, zoo, duration = subject.film, subject.zoo, subject.shown
    cycles = f"{duration / subject.run.config.encoding.period:g} cycles"
    part = {"start": float(film.times[-1]) - duration, "duration": duration}
    films = [report.film(film, f"The best, #{zoo[0]}, {cycles}.", 0, **part)]
    if len(zoo) > 1:
        words = f"The {len(zoo)} best side by side, {cycles}."
        films.append(report.film(film, words, range(len(zoo)), **part))
    if film.scene.ground is not None:
        words = f"#{zoo[0]} dropped from as high as it is long, its muscles at work."
        films.append(report.film(_fall(subject), words))
    report.row(*films)
    report.row(
        report.player(
            film,
            "The best, to walk around.",
            names={place: f"#{individual}" for place, individual in enumerate(zoo)},
            custom_data=dict(enumerate(_page_facts(subject))),
            title=f"{subject.run.config.name}: the best",
        )
    )


def _fall(subject: Subject) -> ws.Result:
    """The best dropped from as high as it is long, as long as a film lasts."""
    import warp_springs as ws

    robot, settings = subject.film.robots[0], subject.run.config.simulation
    return ws.Simulation(
        [robot.moved((0.0, 0.0, robot.diameter))],
        subject.film.scene,
        dt=settings.dt,
        precision=settings.precision,
        integrator=settings.integrator,
        device=settings.device,
    ).run(subject.shown, fps=30)


def _page_facts(subject: Subject) -> Iterator[dict[str, str]]:
    """What the page says about each robot of the zoo."""
    found = {f.id: f for f in subject.finalists}
    for individual in subject.zoo:
        facts = {
            subject.run.config.task.fitness: f"{subject.fitness(individual):.3f} {subject.unit}"
        }
        if finalist := found.get(individual):
            facts["generation"] = f"{finalist.generation:,}"
            facts["half the step"] = share(finalist.halved_kept)
            facts["perturbed"] = share(finalist.perturbed_kept)
            facts["second look"] = "survives" if finalist.survives else "demoted"
        yield facts
