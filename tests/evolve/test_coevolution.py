"""Two populations: robots on hills; who meets whom, what each is worth, and that it resumes."""

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
    "encoding.groups": 3,
    "encoding.hidden": 2,
    "encoding.size": 3.0,
    "task.measure": 1.0,
}


@pytest.fixture(scope="module")
def config():
    return load("arms-race", SMALL).model_copy(update={"body": load("cube").body})


def test_every_robot_meets_several_hills_and_all_hills_as_many_robots(config):
    search = Search(config)
    asked = search.optimizer.ask(24)
    robots, hills = search.encoding.split(asked.genomes)
    assert len(np.unique(robots, axis=0)) == 8
    kinds, counts = np.unique(hills, axis=0, return_counts=True)
    assert len(kinds) == 4 and (counts == 6).all()
    assert (asked.parents == NOBODY).all()


def test_a_meeting_is_judged_on_its_own_hills(config):
    search = Search(config)
    evaluator, encoding = Evaluator(config), search.encoding
    genomes = search.optimizer.ask(24).genomes
    scores = judged(evaluator, encoding, genomes)
    row = 13
    (alone,) = encoding.worlds(genomes[row : row + 1], evaluator.scene)
    field = alone[1].obstacles[-1]
    assert isinstance(field, ws.HeightField) and np.ptp(field.heights) == pytest.approx(0.08)
    one = evaluator.within(alone[1])(encoding.express(genomes[row : row + 1]))
    assert one.fitness[0] == scores.fitness[row]
    look = looked_at_again(evaluator, encoding, genomes[[row, 2]], scores.fitness[[row, 2]])
    assert np.isfinite(look.halved).all()
    there = evaluator.within(alone[1])
    same = there.second_look(encoding.express(genomes[row : row + 1]), one.fitness)
    assert look.halved[0] == same.halved[0] and look.perturbed[0] == same.perturbed[0]


def test_robots_are_worth_their_mean_and_hills_what_robots_lack(config):
    search = Search(config)
    generation = search.step()
    robots, hills = search.encoding.split(generation.candidates.genomes)
    fitness = generation.scores.fitness
    of_robots, of_hills = search.optimizer.worths
    means = [fitness[(robots == kind).all(axis=1)].mean() for kind in np.unique(robots, axis=0)]
    lacks = [-np.nanmean(fitness[(hills == kind).all(axis=1)]) for kind in np.unique(hills, axis=0)]
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


def test_it_resumes_to_the_same_bits(config, tmp_path):
    whole = Run.create(config, tmp_path / "whole")
    whole.evolve()
    parts = Run.create(config, tmp_path / "parts")
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
