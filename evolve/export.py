"""Champions: the best of a run are looked at twice, filmed, and written as OpenUSD."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evolve.errors import RunError
from evolve.evaluate import Evaluator
from evolve.run import Run
from evolve.store import Finalist, Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["ZOO_SIZE", "Zoo", "crown", "export"]

ZOO_SIZE = 9
"""Robots in the zoo, unless told otherwise."""


@dataclass(frozen=True)
class Zoo:
    """The best different individuals of a run, the fittest first."""

    members: Sequence[Finalist]
    robots: Sequence[ws.Robot]
    """In the same order."""
    champion: int
    """Place of the fittest who survives the second look; 0 where nobody does."""


def export(run: Run, best: int = ZOO_SIZE) -> tuple[Finalist, list[Path]]:
    """Crown the champion of a run; show it, and the zoo of the best.

    Writes champion.usdc and zoo.usdc, animations of the whole trial, and zoo.png, its end.

    Args:
        run: A run in which somebody has a fitness.
        best: How many different individuals are looked at twice and shown in the zoo.

    Returns:
        The champion, and the paths of what was written.

    Raises:
        RunError: Nobody has a fitness.
    """
    import warp_springs as ws

    with Store.open(run.record_path, write=True) as store:
        zoo = crown(run, store, best)
    film = Evaluator(run.config).film(zoo.robots)
    names = {place: f"robot_{member.id}" for place, member in enumerate(zoo.members)}
    notes = {place: _notes(run, member) for place, member in enumerate(zoo.members)}
    paths = [run.directory / name for name in ("champion.usdc", "zoo.usdc", "zoo.png")]
    one = zoo.champion
    ws.export_usd(
        film, paths[0], robots=[one], names={one: names[one]}, custom_data={one: notes[one]}
    )
    ws.export_usd(film, paths[1], names=names, custom_data=notes)
    ws.render(film, paths[2], labels=[f"#{m.id}   {m.fitness:.2f}" for m in zoo.members])
    return zoo.members[one], paths


def crown(run: Run, store: Store, best: int = ZOO_SIZE) -> Zoo:
    """Look twice at the best different individuals, and record what is left of their fitness.

    Raises:
        RunError: Nobody has a fitness.
    """
    ids = store.best(best)
    if not ids:
        raise RunError(f"nobody in {run.directory} has a fitness: there is nothing to export")
    encoding = run.config.make_encoding()
    robots = encoding.express(encoding.from_bytes(store.genomes(ids)))
    look = Evaluator(run.config).second_look(robots, store.scores(ids).fitness)
    store.add_second_looks(ids, look)
    known = {finalist.id: finalist for finalist in store.finalists()}
    return Zoo([known[i] for i in ids], robots, champion=int(look.survives.argmax()))


def _notes(run: Run, member: Finalist) -> dict[str, Any]:
    """What a USD file keeps of a robot: name -> value."""
    config = run.config
    return {
        "run": config.name,
        "seed": config.seed,
        "encoding": config.encoding.type,
        "optimizer": config.optimizer.type,
        "individual": member.id,
        "generation": member.generation,
        "fitnessName": config.task.fitness,
        "fitness": member.fitness,
        # USD holds no NaN; None is left out.
        "fitnessAtHalfStep": None if math.isnan(member.second_fitness) else member.second_fitness,
        "survivesSecondLook": member.survives,
    }
