"""What a search for bodies invents to cheat, and what is done about it."""

from __future__ import annotations

import numpy as np
import pytest

import warp_springs as ws
from evolve.encodings import ENCODINGS
from evolve.judging.evaluate import Evaluator
from evolve.toml import load

BASE = {"task.measure": 2.0, "task.settle": 0.5, "simulation.threads": 1}


EVOLVING = [name for name, encoding in ENCODINGS.items() if not encoding.fixed_body]


def bodies(name: str, n: int, **settings: object) -> list[ws.Robot]:
    """Random bodies of an encoding, mutated once."""
    cls = ENCODINGS[name]
    body = ws.shapes.lattice(2, 1, 1) if cls.needs_body else None
    encoding, rng = cls(body, cls.Settings(**settings)), np.random.default_rng(1)
    return encoding.express(encoding.mutate(encoding.random(n, rng), rng))


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


def test_a_body_that_sinks_into_the_floor_gets_no_fitness():
    """Wherever a mass gets to be deep below while it is simulated, the robot is stopped."""
    body = ws.shapes.lattice(2, 1, 1)
    scores = judged([body, body.replace(masses=1e6 * body.masses)])
    assert np.isfinite(scores.fitness).tolist() == [True, False]
    assert scores.status[1] != ws.Status.OK


@pytest.mark.parametrize("name", EVOLVING)
def test_a_body_without_muscles_goes_nowhere(name):
    """What it stores when it is built, a height or a tension, is spent while it settles."""
    settled = {"task.measure": 4.0, "task.settle": 1.0, "simulation.threads": 1}
    still = {"amplitude": 0.0} | ({"material": 1e-6} if name == "sprout" else {})  # nor growth
    scores = Evaluator(load("critter", settled))(bodies(name, 40, **still))
    assert np.nanmax(scores.fitness) < 0.01
    assert np.isfinite(scores.fitness).sum() > 20


@pytest.mark.parametrize("name", EVOLVING)
def test_no_body_is_built_folded(name):
    """Unfolding would be a way of many diameters of what it was: springs are built at rest."""
    for robot in bodies(name, 60):
        stretch = robot.rest_length / robot.lengths
        assert (stretch >= 0.9 - 1e-6).all() and (stretch <= 1.1 + 1e-6).all()
        assert (robot.amplitude <= 0.2 * robot.lengths * (1.0 + 1e-6)).all()


def test_a_tower_that_falls_while_it_settles_is_paid_nothing():
    """One that falls later is paid nothing by `steady`: see test_bodies."""
    tower = ws.shapes.lattice(1, 1, 6).replace(omega=2.0 * np.pi)
    leaning = tower.rotated((0.0, 1.0, 0.0), 0.3, about=(0.1, 0.0, 0.0))
    leaning = leaning.moved((0.0, 0.0, -leaning.bounds[0, 2]))
    paid = {}
    for settle in (0.1, 2.0):
        changes = {"task.fitness": "speed", "task.measure": 2.0, "task.settle": settle}
        paid[settle] = Evaluator(load("critter", changes))([leaning]).fitness[0]
    assert paid[0.1] > 0.2 and paid[2.0] < 0.005


def test_a_body_that_draws_on_the_integrator_does_not_survive_the_second_look():
    """Light tips on hard springs ring at the edge of stability, and push the body along."""
    config = load("critter", BASE | {"simulation.dt": 4e-3, "scene.damping": 1.0})
    evaluator = Evaluator(config)
    found = [
        robot.replace(stiffness=np.minimum(1.7 * robot.stiffness, 4000.0))
        for robot in bodies("voxels", 150)
    ]
    scores = evaluator(found)
    best = int(np.argmax(scores.worth))
    assert scores.fitness[best] > 1.0, "the exploit is there, faster than any honest body"
    look = evaluator.second_look([found[best]], scores.fitness[[best]])
    assert look.halved_kept[0] < 0.5 and not look.survives[0]
