"""Champions: the best of a run are looked at twice, filmed, and written as OpenUSD."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evolve.errors import RunError
from evolve.evaluate import Evaluator
from evolve.run import Run
from evolve.store import Finalist, Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ZOO_SIZE", "crown", "export"]

ZOO_SIZE = 9
"""Robots in the zoo, unless told otherwise."""


def export(run: Run, best: int = ZOO_SIZE) -> tuple[list[Finalist], list[Path]]:
    """Crown the champion of a run; show it, and the zoo of the best.

    Writes champion.usdc and zoo.usdc, animations of the whole trial, and zoo.png, its end. Whoever
    does not survive the second look comes after all who do; where nobody survives there is no
    champion, and no champion.usdc.

    Args:
        run: A run in which somebody has a fitness.
        best: How many different individuals are shown in the zoo.

    Returns:
        Everybody who was looked at twice, the champion first if there is one, and the paths of
        what was written.

    Raises:
        RunError: Nobody has a fitness.
        StoreError: Another process exports this run.
    """
    with run.exporting(), Store.open(run.record_path, write=True) as store:
        finalists = crown(run, store, best)
        return finalists, _show(run, store, finalists[:best])


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


def _show(run: Run, store: Store, zoo: Sequence[Finalist]) -> list[Path]:
    """Write the animations and the picture of the zoo; the champion is the first of it."""
    import warp_springs as ws

    film = Evaluator(run.config).film(_robots(run, store, [member.id for member in zoo]))
    names = {place: f"robot_{member.id}" for place, member in enumerate(zoo)}
    notes = {place: _notes(run, member) for place, member in enumerate(zoo)}
    champion, *others = (run.directory / f for f in ("champion.usdc", "zoo.usdc", "zoo.png"))
    if zoo[0].survives:
        ws.export_usd(film, champion, robots=[0], names={0: names[0]}, custom_data={0: notes[0]})
    else:
        champion.unlink(missing_ok=True)
    ws.export_usd(film, others[0], names=names, custom_data=notes)
    ws.render(film, others[1], labels=[_label(member) for member in zoo])
    return [champion, *others] if zoo[0].survives else others


def _robots(run: Run, store: Store, ids: Sequence[int]) -> Sequence[ws.Robot]:
    encoding = run.config.make_encoding()
    return encoding.express(encoding.from_bytes(store.genomes(ids)))


def _label(member: Finalist) -> str:
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
