"""Champions: the best of a run are looked at twice, filmed, and written as OpenUSD."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evolve.errors import RunError
from evolve.judging.evaluate import Evaluator
from evolve.judging.second_look import SecondLook
from evolve.judging.worlds import looked_at_again
from evolve.record import Finalist
from evolve.reports.archive import niches
from evolve.reports.bodies import shown, various
from evolve.reports.show import FILM_CYCLES, Show, Style, Watch, label
from evolve.run import Run
from evolve.store import Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = [
    "FILM_CYCLES",
    "ZOO_SIZE",
    "crown",
    "export",
    "export_generation",
    "export_robots",
    "label",
    "trial",
]

ZOO_SIZE = 9
"""Robots in the zoo, unless told otherwise."""
DESCENT = 0.9
"""Fitness of the next who are looked at twice, at most, in that of the last."""


def export(
    run: Run,
    best: int = ZOO_SIZE,
    film: str | None = None,
    style: Style | None = None,
    watch: Watch | None = None,
) -> tuple[list[Finalist], list[Path]]:
    """Crown the champion of a run; show it, and the zoo of the best.

    Writes champion.usdc and zoo.usdc, animations of the whole trial, and zoo.png, its end; films
    of both if asked. Whoever does not survive the second look comes after all who do; where nobody
    survives there is no champion, and no champion.usdc.

    Args:
        run: A run in which somebody has a fitness.
        best: How many are shown in the zoo: the best different individuals; where bodies evolve,
            the champion and good ones unlike each other in their descriptors.
        film: "mp4" or "webp": write champion and zoo as films too.
        style: How animations are written.
        watch: Told what is being done, if anybody wants to know.

    Returns:
        Everybody who was looked at twice, the champion first if there is one, and the paths of
        what was written.

    Raises:
        RunError: Nobody has a fitness.
        StoreError: Another process exports this run.
        RuntimeError: A film cannot be written for want of ffmpeg.
    """
    with run.exporting(), Store.open(run.record_path, write=True) as store:
        finalists = crown(run, store, best)
        zoo = shown(run, store, finalists, best)
        return finalists, _zoo(Show(run, store, style, watch), zoo, film)


def export_generation(
    run: Run, generation: int, style: Style | None = None, watch: Watch | None = None
) -> tuple[int, Path]:
    """Write everybody of a generation as generation_NNNN.usdc, the fittest first.

    Args:
        run: The run.
        generation: Which generation, negative from the last.
        style: How the animation is written.
        watch: Told what is being done, if anybody wants to know.

    Returns:
        How many robots there are, and the path.

    Raises:
        RunError: There is no such generation.
        StoreError: Another process exports this run.
    """
    with run.exporting(), Store.open(run.record_path) as store:
        record, count = store.record(), store.generations
        if not -count <= generation < count:
            raise RunError(f"{run.directory} has generations 0 to {count - 1}, not {generation}")
        generation %= count
        own = record.generations == generation
        worth = np.where(np.isnan(record.fitness[own]), -np.inf, record.fitness[own])
        ids = record.ids[own][np.argsort(-worth, kind="stable")].tolist()
        show = Show(run, store, style, watch)
        return len(ids), show.write(f"generation_{generation:04d}", ids, show.simulate(ids))


def export_robots(
    run: Run, ids: Sequence[int], style: Style | None = None, watch: Watch | None = None
) -> Path:
    """Write some individuals of a run as robots.usdc, in their order.

    Raises:
        RunError: Somebody is not in the record, or named twice.
        StoreError: Another process exports this run.
    """
    with run.exporting(), Store.open(run.record_path) as store:
        known = set(store.record().ids.tolist())
        for individual in ids:
            if individual not in known:
                raise RunError(f"{run.directory} has no individual {individual}")
        if len(set(ids)) < len(ids):
            raise RunError("an individual is named twice")
        show = Show(run, store, style, watch)
        return show.write("robots", ids, show.simulate(ids))


def trial(run: Run, store: Store, ids: Sequence[int], energy: bool = False) -> ws.Result:
    """Simulate the whole trial of some individuals again, three cycles at least, with all frames.

    Args:
        run: Their run.
        store: Its record.
        ids: Who they are.
        energy: Whether to record their energies too.
    """
    return Show(run, store).simulate(ids, energy)


def crown(run: Run, store: Store, best: int = ZOO_SIZE) -> list[Finalist]:
    """Look twice at the best different individuals, and record what is left of their fitness.

    Where bodies evolve, or the optimizer keeps an archive, also at good ones unlike the others.
    The best are often one family, with one weakness; while nobody survives, more are looked at
    further down, each round of them well below the last.

    Returns:
        All of them, survivors first, the fittest first.

    Raises:
        RunError: Nobody has a fitness.
    """
    second_look = run.config.task.second_look
    count = max(best, second_look.candidates)
    ids = store.best(count)
    if not ids:
        raise RunError(f"nobody in {run.directory} has a fitness: there is nothing to export")
    others = various(run, store, best) if niches(run.config) else []
    evaluator, encoding = Evaluator(run.config), run.config.make_encoding()
    seen: list[int] = []
    looks: list[SecondLook] = []
    while ids and len(looks) < second_look.rounds:
        new = list(dict.fromkeys([*ids, *others]))
        genomes = encoding.from_bytes(store.genomes(new))
        looks.append(looked_at_again(evaluator, encoding, genomes, store.scores(new).fitness))
        seen += new
        last = store.scores(ids[-1:]).fitness[0]
        if looks[-1].survives.any() or last <= 0.0:
            break
        ids, others = [i for i in store.best(count, DESCENT * last) if i not in seen], []
    store.put_second_look(seen, SecondLook.joined(looks))
    return store.finalists()


def _zoo(show: Show, zoo: Sequence[Finalist], film: str | None) -> list[Path]:
    """Write animations, pictures and films of the zoo; the champion is the first of it."""
    import warp_springs as ws

    ids, labels = [member.id for member in zoo], [label(member) for member in zoo]
    motion, survives = show.simulate(ids), zoo[0].survives
    paths = [show.write("champion", ids, motion, only=0)] if survives else []
    paths.append(show.write("zoo", ids, motion))
    picture = show.directory / "zoo.png"
    paths.append(ws.render(motion, picture, layout="panel", labels=labels))
    if film is not None:
        if survives:
            paths.append(show.film("champion", motion, film, robots=0, caption=labels[0]))
        paths.append(show.film("zoo", motion, film, layout="panel", labels=labels))
    if not survives:  # what an earlier export may have left
        for stale in (show.path("champion"), show.directory / f"champion.{film}"):
            stale.unlink(missing_ok=True)
    return paths
