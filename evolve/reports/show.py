"""Individuals of a run as they move: simulated again, and written as animations and films."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evolve.judging.evaluate import Evaluator
from evolve.judging.worlds import film_of
from evolve.record import Finalist
from evolve.run import Run
from evolve.store import Store

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["FILM_CYCLES", "Show", "Style", "Watch", "label"]

FILM_CYCLES = 3
"""Cycles of the muscles that an animation shows at least."""

Watch = Callable[[str, float], None]
"""Called now and then with what is being done, and the share of it that is done, 0 ... 1."""


@dataclass(frozen=True)
class Style:
    """How animations are written."""

    format: str = "usdc"
    """``"usdc"``, ``"usda"`` or ``"usdz"``."""
    color: str = "stress"
    """As in ``ws.export_usd``."""
    geometry: str = "auto"
    """As in ``ws.export_usd``."""


class Show:
    """Simulates individuals of a run again, and writes them with their names and notes.

    Args:
        run: The run.
        store: Its record.
        style: How animations are written.
        watch: Told what is being done, if anybody wants to know.
    """

    def __init__(
        self, run: Run, store: Store, style: Style | None = None, watch: Watch | None = None
    ) -> None:
        self.directory = run.directory
        self._run, self._store = run, store
        self._style, self._watch = style or Style(), watch or _nobody

    def simulate(self, ids: Sequence[int], energy: bool = False) -> ws.Result:
        """The whole trial of some individuals, three cycles at least, with all frames."""
        encoding = self._run.config.make_encoding()
        return film_of(
            Evaluator(self._run.config),
            encoding,
            encoding.from_bytes(self._store.genomes(ids)),
            least_cycles=FILM_CYCLES,
            energy=energy,
            progress=partial(self._watch, "simulating"),
        )

    def path(self, name: str) -> Path:
        """Where an animation of that name stands."""
        return self.directory / f"{name}.{self._style.format}"

    def write(
        self, name: str, ids: Sequence[int], motion: ws.Result, only: int | None = None
    ) -> Path:
        """Write an animation of everybody in a result, or of one of them."""
        import warp_springs as ws

        places = range(len(ids)) if only is None else [only]
        notes = self._notes(ids)
        return ws.export_usd(
            motion,
            self.path(name),
            robots=places,
            names={place: f"robot_{ids[place]}" for place in places},
            custom_data={place: notes[place] for place in places},
            color=self._style.color,
            geometry=self._style.geometry,
            progress=partial(self._watch, f"writing {name}"),
        )

    def film(self, name: str, motion: ws.Result, suffix: str, **how: Any) -> Path:
        """Film a result; further arguments are those of ``ws.render``."""
        import warp_springs as ws

        path = self.directory / f"{name}.{suffix}"
        return ws.render(motion, path, progress=partial(self._watch, f"filming {name}"), **how)

    def _notes(self, ids: Sequence[int]) -> list[Mapping[str, Any]]:
        """What a USD file keeps of individuals: name -> value."""
        config, store = self._run.config, self._store
        of_run = {
            "run": config.name,
            "seed": config.seed,
            "encoding": config.encoding.type,
            "optimizer": config.optimizer.type,
            "fitnessName": config.task.fitness,
        }
        scores, record = store.scores(ids), store.record()
        generations = record.generations[np.searchsorted(record.ids, ids)].tolist()
        looks = {member.id: _second_look(member) for member in store.finalists()}
        return [
            of_run
            | {
                "individual": individual,
                "generation": generations[place],
                "parents": store.parents_of(individual) or None,
                "fitness": _number(scores.fitness[place]),
                **{name: _number(values[place]) for name, values in scores.descriptors.items()},
                **looks.get(individual, {}),
            }
            for place, individual in enumerate(ids)
        ]


def label(member: Finalist) -> str:
    """What is written beside a finalist in a picture."""
    return f"#{member.id}   {member.fitness:.2f}" + ("" if member.survives else "   demoted")


def _second_look(member: Finalist) -> dict[str, Any]:
    """What is left of the fitness of somebody who was looked at twice."""
    return {
        "survivesSecondLook": member.survives,
        "fitnessAtHalfStep": _number(member.halved),
        "keptAtHalfStep": _number(member.halved_kept),
        "fitnessPerturbed": _number(member.perturbed),
        "keptPerturbed": _number(member.perturbed_kept),
    }


def _number(value: float) -> float | None:
    """A finite number, or None, which is left out: USD holds no NaN."""
    return float(value) if math.isfinite(value) else None


def _nobody(words: str, done: float) -> None:
    """Nobody watches."""
