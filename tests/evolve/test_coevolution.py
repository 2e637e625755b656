"""Two populations: robots on hills; who meets whom, what each is worth, and that it resumes."""

from collections import Counter

import numpy as np
import pytest

import warp_springs as ws
from evolve import Evaluator, Run, Scores, Search, load
from evolve.judging.worlds import judged, looked_at_again
from evolve.optimizers.base import NOBODY

SMALL = {
    "population": 24,
    "generations": 4,
    "optimizer.opponents": 3,
    "optimizer.hills": 4,
    "encoding.robot.groups": 3,
    "encoding.robot.hidden": 2,
    "encoding.size": 3.0,
    "task.measure": 1.0,
}


@pytest.fixture(scope="module")
def config():
    return load("arms-race", SMALL).model_copy(update={"body": load("cube").body})


BODIES = {
    "encoding": {
        "type": "arena",
        "size": 3.0,
        "robot": {"type": "voxels", "cells": [3, 2, 2], "edge": 0.1},
    },
    "optimizer": {"type": "coevolution", "opponents": 3, "hills": 4},
    "scene.ground": False,
    "population": 24,
    "generations": 4,
    "task.measure": 1.0,
}
"""Changes to the preset critter: bodies against hills."""


@pytest.fixture(scope="module", params=["controllers", "bodies"])
def either(request, config):
    return config if request.param == "controllers" else load("critter", BODIES)


def different(encoding, blobs):
    """How many there are of each kind of genome."""
    return sorted(Counter(encoding.to_bytes(blobs)).values())


def test_every_robot_meets_several_hills_and_all_hills_as_many_robots(either):
    search = Search(either)
    asked = search.optimizer.ask(24)
    robots, hills = search.encoding.split(asked.genomes)
    assert different(search.encoding.robots, robots) == [3] * 8
    assert different(search.encoding.hills, hills) == [6] * 4
    assert (asked.parents == NOBODY).all()


def test_a_meeting_is_judged_on_its_own_hills(either):
    search = Search(either)
    evaluator, encoding = Evaluator(either), search.encoding
    genomes = search.optimizer.ask(24).genomes
    scores = judged(evaluator, encoding, genomes)
    row = 13
    mine = encoding.take(genomes, np.array([row]))
    (alone,) = encoding.worlds(mine, evaluator.scene)
    field = alone[1].obstacles[-1]
    assert isinstance(field, ws.HeightField) and np.ptp(field.heights) == pytest.approx(0.08)
    one = evaluator.within(alone[1])(encoding.express(mine))
    assert one.fitness[0] == scores.fitness[row]
    look = looked_at_again(
        evaluator, encoding, encoding.take(genomes, np.array([row, 2])), scores.fitness[[row, 2]]
    )
    assert np.isfinite(look.halved).all()
    there = evaluator.within(alone[1])
    same = there.second_look(encoding.express(mine), one.fitness)
    assert look.halved[0] == same.halved[0] and look.perturbed[0] == same.perturbed[0]


def test_robots_are_worth_their_mean_and_hills_what_robots_lack(either):
    search = Search(either)
    generation = search.step()
    robots, hills = (
        np.array(side.to_bytes(genomes))
        for side, genomes in zip(
            search.encoding.sides, search.encoding.split(generation.candidates.genomes), strict=True
        )
    )
    fitness = generation.scores.fitness
    of_robots, of_hills = search.optimizer.worths
    means = [fitness[robots == kind].mean() for kind in np.unique(robots)]
    lacks = [-np.nanmean(fitness[hills == kind]) for kind in np.unique(hills)]
    healthy = np.sort(means)[::-1]
    np.testing.assert_allclose(of_robots[np.isfinite(of_robots)], healthy[np.isfinite(healthy)])
    np.testing.assert_allclose(of_hills, np.sort(lacks)[::-1])


def test_both_sides_get_better_at_what_they_do():
    """With a fitness in closed form: a robot is its first gene, hills take away theirs."""
    search = Search(load("arms-race", SMALL | {"population": 96, "optimizer.hills": 8}))
    optimizer, encoding = search.optimizer, search.encoding

    def play(asked):
        robots, hills = encoding.split(asked.genomes)
        return robots[:, 0] + 0.5 * robots[:, 1] - hills[:, 0]

    strength, hardness = [], []
    for _ in range(25):
        asked = optimizer.ask(96)
        robots, hills = encoding.split(asked.genomes)
        strength.append((robots[:, 0] + 0.5 * robots[:, 1]).mean())
        hardness.append(hills[:, 0].mean())
        optimizer.tell(asked, Scores(play(asked), np.zeros(96)))
    assert np.mean(strength[-3:]) > strength[0] + 0.3
    assert np.mean(hardness[-3:]) > hardness[0] + 0.2


def test_it_resumes_to_the_same_bits(either, tmp_path):
    whole = Run.create(either, tmp_path / "whole")
    whole.evolve()
    parts = Run.create(either, tmp_path / "parts")
    count = iter(range(10))
    assert not parts.evolve(should_stop=lambda: next(count) >= 2)
    assert parts.evolve()
    with whole.read() as one, parts.read() as two:
        a, b = one.record(), two.record()
        np.testing.assert_array_equal(a.fitness, b.fitness)
        assert one.genomes(a.ids.tolist()) == two.genomes(b.ids.tolist())


def test_it_needs_two_populations():
    with pytest.raises(ValueError, match="needs two populations"):
        Search(load("cube", {"optimizer.type": "coevolution"}))


def test_bodies_evolve_against_hills():
    """Bodies of many topologies meet; genomes survive their bytes; bodies alone may be tuned."""
    search = Search(load("critter", BODIES))
    encoding = search.encoding
    while not search.finished:
        generation = search.step()
    genomes = generation.candidates.genomes
    robots = encoding.express(genomes)
    assert len({robot.topology for robot in robots}) >= 3
    again = encoding.from_bytes(encoding.to_bytes(genomes))
    assert encoding.to_bytes(again) == encoding.to_bytes(genomes)
    np.testing.assert_array_equal(encoding.distance(again, genomes), 0.0)
    tuned = encoding.tune(genomes, np.random.default_rng(1))
    np.testing.assert_array_equal(tuned.hills, genomes.hills)
    for one, other in zip(robots, encoding.express(tuned), strict=True):
        assert one.topology == other.topology
    worths = search.optimizer.worths
    assert len(worths[0]) == 8 and len(worths[1]) == 4
    look = looked_at_again(Evaluator(search.config), encoding, genomes, generation.scores.fitness)
    assert np.isfinite(look.halved).any()


def test_any_optimizer_searches_robots_together_with_hills():
    """Not coevolution: hills that are easy are fine, too; but nothing may stumble over pairs."""
    for optimizer in ("genetic", "hill_climber", "learning", "speciation"):
        search = Search(
            load("critter", BODIES | {"optimizer": {"type": optimizer}, "generations": 2})
        )
        while not search.finished:
            search.step()
        assert search.optimizer.best_fitness > 0.0
