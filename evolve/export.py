"""Champions: the best of a run are looked at twice, filmed, and written as OpenUSD."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evolve.errors import RunError
from evolve.evaluate import Evaluator
from evolve.run import Run
from evolve.store import Finalist, Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ZOO_SIZE", "crown", "export", "label", "trial"]

FILM_CYCLES = 3
"""Cycles of the muscles that an animation shows at least."""
ZOO_SIZE = 9
"""Robots in the zoo, unless told otherwise."""


def export(
    run: Run,
    best: int = ZOO_SIZE,
    film: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[Finalist], list[Path]]:
    """Crown the champion of a run; show it, and the zoo of the best.

    Writes champion.usdc and zoo.usdc, animations of the whole trial, and zoo.png, its end; films
    of both if asked. Whoever does not survive the second look comes after all who do; where nobody
    survives there is no champion, and no champion.usdc.

    Args:
        run: A run in which somebody has a fitness.
        best: How many different individuals are shown in the zoo.
        film: "mp4" or "webp": write champion and zoo as films too.
        progress: Called with the share of the films that is drawn, 0 ... 1.

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
        zoo = finalists[:best]
        motion = trial(run, store, [member.id for member in zoo])
        paths = _show(run, motion, zoo)
        if film is not None:
            paths += _film(run, motion, zoo, film, progress or (lambda _: None))
        return finalists, paths


def trial(run: Run, store: Store, ids: Sequence[int], energy: bool = False) -> ws.Result:
    """Simulate the whole trial of some individuals again, three cycles at least, with all frames.

    Args:
        run: Their run.
        store: Its record.
        ids: Who they are.
        energy: Whether to record their energies too.
    """
    robots = _robots(run, store, ids)
    return Evaluator(run.config).film(robots, least_cycles=FILM_CYCLES, energy=energy)


def crown(run: Run, store: Store, best: int = ZOO_SIZE) -> list[Finalist]:
    """Look twice at the best different individuals, and record what is left of their fitness.

    Returns:
        All of them, survivors first, the fittest first.

    Raises:
        RunError: Nobody has a fitness.
    """
    ids = store.best(max(best, run.config.task.second_look.candidates))
    if not ids:
        raise RunError(f"nobody in {run.directory} has a fitness: there is nothing to export")
    look = Evaluator(run.config).second_look(_robots(run, store, ids), store.scores(ids).fitness)
    store.put_second_look(ids, look)
    return store.finalists()


def _show(run: Run, motion: ws.Result, zoo: Sequence[Finalist]) -> list[Path]:
    """Write the animations and the picture of the zoo; the champion is the first of it."""
    import warp_springs as ws

    names = {place: f"robot_{member.id}" for place, member in enumerate(zoo)}
    notes = {place: _notes(run, member) for place, member in enumerate(zoo)}
    champion, *others = (run.directory / f for f in ("champion.usdc", "zoo.usdc", "zoo.png"))
    if zoo[0].survives:
        ws.export_usd(motion, champion, robots=[0], names={0: names[0]}, custom_data={0: notes[0]})
    else:
        champion.unlink(missing_ok=True)
    ws.export_usd(motion, others[0], names=names, custom_data=notes)
    ws.render(motion, others[1], layout="panel", labels=[label(member) for member in zoo])
    return [champion, *others] if zoo[0].survives else others


def _film(
    run: Run,
    motion: ws.Result,
    zoo: Sequence[Finalist],
    suffix: str,
    progress: Callable[[float], None],
) -> list[Path]:
    """Film the champion, if there is one, and the zoo, a tile for each."""
    import warp_springs as ws

    champion, panel = (run.directory / f"{name}.{suffix}" for name in ("champion", "zoo"))
    ws.render(
        motion,
        panel,
        layout="panel",
        labels=[label(member) for member in zoo],
        progress=lambda done: progress(0.5 * done),
    )
    if not zoo[0].survives:
        champion.unlink(missing_ok=True)
        return [panel]
    ws.render(
        motion,
        champion,
        robots=0,
        caption=label(zoo[0]),
        progress=lambda done: progress(0.5 + 0.5 * done),
    )
    return [champion, panel]


def _robots(run: Run, store: Store, ids: Sequence[int]) -> Sequence[ws.Robot]:
    encoding = run.config.make_encoding()
    return encoding.express(encoding.from_bytes(store.genomes(ids)))


def label(member: Finalist) -> str:
    """What is written beside a finalist in a picture."""
    return f"#{member.id}   {member.fitness:.2f}" + ("" if member.survives else "   demoted")


def _notes(run: Run, member: Finalist) -> dict[str, Any]:
    """What a USD file keeps of a robot: name -> value."""
    config = run.config
    # USD holds no NaN; None is left out.
    again = {
        "fitnessAtHalfStep": member.halved,
        "keptAtHalfStep": member.halved_kept,
        "fitnessPerturbed": member.perturbed,
        "keptPerturbed": member.perturbed_kept,
    }
    return {
        "run": config.name,
        "seed": config.seed,
        "encoding": config.encoding.type,
        "optimizer": config.optimizer.type,
        "individual": member.id,
        "generation": member.generation,
        "fitnessName": config.task.fitness,
        "fitness": member.fitness,
        "survivesSecondLook": member.survives,
        **{name: None if math.isnan(value) else value for name, value in again.items()},
    }
