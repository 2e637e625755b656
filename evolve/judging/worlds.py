"""Genomes that bring a world of their own: judged and shown there, those of one world together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from evolve.encodings.base import Encoding, Genomes
from evolve.judging.scores import Scores
from evolve.judging.second_look import SecondLook

if TYPE_CHECKING:
    import warp_springs as ws
    from evolve.judging.evaluate import Evaluator

__all__ = ["film_of", "judged", "looked_at_again"]


def _parts(
    evaluator: Evaluator, encoding: Encoding, genomes: Genomes
) -> Iterator[tuple[np.ndarray, Evaluator, Any]]:
    """Rows of the genomes, who judges them, and their robots."""
    if not hasattr(encoding, "worlds"):
        yield np.arange(len(genomes)), evaluator, encoding.express(genomes)
        return
    for rows, scene in encoding.worlds(genomes, evaluator.scene):
        yield rows, evaluator.within(scene), encoding.express(encoding.take(genomes, rows))


def judged(evaluator: Evaluator, encoding: Encoding, genomes: Genomes) -> Scores:
    """The scores of n genomes, each in its world."""
    rows, scores = [], []
    for some, judge, robots in _parts(evaluator, encoding, genomes):
        rows.append(some)
        scores.append(judge(robots))
    if len(scores) == 1:
        return scores[0]
    return Scores.concatenate(scores).take(np.argsort(np.concatenate(rows), kind="stable"))


def looked_at_again(
    evaluator: Evaluator, encoding: Encoding, genomes: Genomes, fitness: np.ndarray
) -> SecondLook:
    """The second look at n genomes, each in its world."""
    rows, looks = [], []
    for some, judge, robots in _parts(evaluator, encoding, genomes):
        rows.append(some)
        looks.append(judge.second_look(robots, fitness[some]))
    back = np.argsort(np.concatenate(rows), kind="stable")
    names = [field.name for field in fields(SecondLook)]
    return SecondLook(*(np.concatenate([getattr(x, n) for x in looks])[back] for n in names))


def film_of(evaluator: Evaluator, encoding: Encoding, genomes: Genomes, **how: Any) -> ws.Result:
    """The whole trial of n genomes; where they have worlds of their own, in that of the first."""
    for rows, judge, _ in _parts(evaluator, encoding, genomes):
        if 0 in rows:
            return judge.film(encoding.express(genomes), **how)
    raise ValueError("there is nobody to film")
