"""What a search for bodies invents to cheat, and what is done about it."""

from __future__ import annotations

import numpy as np
import pytest

import warp_springs as ws
from evolve.judging.evaluate import Evaluator
from evolve.toml import load

BASE = {"task.measure": 2.0, "task.settle": 0.5, "simulation.threads": 1}


def judged(robots: list[ws.Robot], **limits: float):
    changes = {f"task.limits.{name}": value for name, value in limits.items()}
    return Evaluator(load("critter", BASE | changes))(robots)


def breathing(body: ws.Robot, strain: float = 0.05) -> ws.Robot:
    return body.replace(amplitude=strain * body.lengths, omega=2.0 * np.pi)


@pytest.mark.parametrize(
    ("limit", "value"), [("mass", 1.5), ("diameter", 0.3), ("springs", 60), ("energy", 1e-4)]
)
def test_whoever_exceeds_a_limit_gets_no_fitness(limit, value):
    """The smaller and calmer of two robots is within each limit, the other beyond."""
    small = ws.shapes.lattice(2, 1, 1)  # 12 masses of 0.1 kg, 50 springs, 0.245 m, at rest
    large = breathing(ws.shapes.lattice(3, 1, 1))
    free, held = judged([small, large]), judged([small, large], **{limit: value})
    assert np.isfinite(free.fitness).all()
    assert np.isfinite(held.fitness).tolist() == [True, False]
    assert held.fitness[0] == free.fitness[0]
    assert (held.status == 0).all(), "nothing is wrong with the simulation of either"


def test_exploding_springs_get_no_fitness():
    body = ws.shapes.lattice(2, 1, 1)
    bomb = body.replace(rest_length=4.0 * body.lengths, stiffness=np.full(body.n_springs, 2e4))
    scores = judged([body, bomb])
    assert np.isfinite(scores.fitness).tolist() == [True, False]
    assert scores.status[0] == 0 and scores.status[1] != 0


def test_legs_below_the_floor_get_no_fitness():
    """The floor would shoot them out: a body of the encodings always starts on it."""
    body = ws.shapes.lattice(2, 1, 1)
    scores = judged([body, body.moved((0.0, 0.0, -0.15))])
    assert np.isfinite(scores.fitness).tolist() == [True, False]
