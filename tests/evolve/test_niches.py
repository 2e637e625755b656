"""Searches that protect what is new: novelty, species, and bodies that are given time to learn."""

from __future__ import annotations

import numpy as np
import pytest

from evolve.judging.scores import Scores
from evolve.optimizers import NOBODY, OPTIMIZERS
from evolve.optimizers.novelty import loneliness
from evolve.search import Search
from evolve.toml import load
from tests.evolve.test_optimizers import Vectors, make, solve, sphere


def test_loneliness_is_the_mean_distance_to_the_nearest_others():
    points = np.random.default_rng(1).normal(size=(400, 3)) * (1.0, 10.0, 0.1)
    found = loneliness(points, 300, 5)
    scaled = points / points.std(axis=0)
    apart = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    expected = np.sort(apart, axis=1)[:300, 1:6].mean(axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_array_equal(loneliness(points[:1], 1, 5), [0.0])


def maze(genomes: np.ndarray) -> Scores:
    """Two places to be at; fitness leads to a trap at (0.2, 0.2), past it to 10 at (0.9, 0.9)."""
    place = genomes[:, :2].astype(np.float64)
    trap = 1.0 - np.abs(place - 0.2).max(axis=1)
    goal = np.abs(place - 0.9).max(axis=1) < 0.05
    where = {"displacement_x": place[:, 0], "displacement_y": place[:, 1]}
    return Scores(np.where(goal, 10.0, trap), np.zeros(len(place)), where)


class Near(Vectors):
    """Everybody begins in one corner and changes little at a time."""

    genome_shape = (4,)

    def random(self, n, rng):
        return (0.1 * rng.random((n, 4))).astype(np.float32)

    def mutate(self, genomes, rng):
        shift = rng.normal(0.0, 0.03, genomes.shape)
        return np.clip(genomes + shift, 0.0, 1.0).astype(np.float32)


def in_the_maze(name: str, **settings) -> tuple[float, int]:
    """The best fitness, and how many of 100 places were visited."""
    from evolve.streams import Streams

    cls = OPTIMIZERS[name]
    optimizer = cls(Near(), Streams(1), cls.Settings(**settings))
    seen = set()
    for _ in range(80):
        asked = optimizer.ask(40)
        seen |= set(map(tuple, np.floor(asked.genomes[:, :2] * 10.0).astype(int).tolist()))
        optimizer.tell(asked, maze(asked.genomes))
    return optimizer.best_fitness, len(seen)


def test_novelty_finds_what_fitness_leads_away_from():
    trapped, few = in_the_maze("genetic")
    for weight in (1.0, 0.8):
        best, many = in_the_maze("novelty", weight=weight)
        assert best == 10.0 and many > 2 * few
    assert trapped < 1.01


def test_the_archive_keeps_the_most_novel_of_every_generation():
    optimizer = make("novelty", archived=0.1, weight=1.0)
    told = [solve(optimizer, 1)[0] for _ in range(5)]
    archive = optimizer.archive
    assert len(archive) == 20 and len(set(archive.tolist())) == 20
    for generation, individuals in enumerate(told):
        mine = archive[4 * generation : 4 * generation + 4]
        assert set(mine.tolist()) <= set(individuals.ids.tolist())
    worth = np.concatenate([individuals.scores.worth for individuals in told])
    assert np.isfinite(worth[archive - 1]).all(), "the stopped are not novel"


def test_species_keep_two_peaks_and_are_as_many_as_they_should_be():
    def peaks(genomes):
        x = genomes.astype(np.float64)
        apart = [np.sum((x - at) ** 2, axis=1) for at in (0.2, 0.8)]
        return Scores(1.0 - np.minimum(*apart), np.zeros(len(x)))

    optimizer = make("speciation", species=4)
    counts = []
    for _ in range(60):
        candidates = optimizer.ask(40)
        optimizer.tell(candidates, peaks(candidates.genomes))
        counts.append(len(optimizer.sizes))
    near = optimizer._survivors.genomes.mean(axis=1) < 0.5
    assert min(near.sum(), (~near).sum()) >= 8
    assert 3 <= np.mean(counts[20:]) <= 6
    assert optimizer.sizes.sum() == len(optimizer._survivors) <= 40


def test_parents_are_of_one_species():
    optimizer = make("speciation", species=3)
    solve(optimizer, 6)
    species = np.repeat(np.arange(len(optimizer.sizes)), optimizer.sizes)
    of = dict(zip(optimizer._survivors.ids.tolist(), species.tolist(), strict=True))
    assert len(optimizer.sizes) > 1
    for one, other in optimizer.ask(40).parents.tolist():
        assert other == NOBODY or of[one] == of[other]


def test_a_species_without_progress_dies_out():
    """Nobody gets better: all but the species of the best are given up."""
    optimizer = make("speciation", species=4, patience=3)
    for _ in range(12):
        candidates = optimizer.ask(40)
        left = candidates.genomes.mean(axis=1)
        optimizer.tell(candidates, Scores(np.round(left * 2.0) - 1.0, np.zeros(40)))
    assert optimizer._bests.max() == optimizer.best_fitness
    assert (optimizer._stale[optimizer._bests < optimizer.best_fitness] <= 3).all()


def test_a_body_learns_before_it_competes():
    optimizer = make("learning", tries=4, lessons=3, bodies={"type": "genetic"})
    best: dict[tuple, float] = {}
    for generation in range(6):
        asked = optimizer.ask(40)
        bodies = list(map(tuple, asked.genomes[:, :6].tolist()))
        counts = np.unique(asked.genomes[:, :6], axis=0, return_counts=True)[1]
        assert len(counts) == 10 and (counts == 4).all(), "ten bodies, four controllers each"
        if generation % 3 == 0:
            best = dict.fromkeys(bodies, -np.inf)
        assert set(bodies) == set(best), "the same bodies in all three lessons"
        scores = sphere(asked.genomes)
        optimizer.tell(asked, scores)
        for body, worth in zip(bodies, scores.worth.tolist(), strict=True):
            best[body] = max(best[body], worth)
        if generation == 2:
            mine = optimizer.bodies._survivors
            np.testing.assert_allclose(np.sort(mine.scores.worth), np.sort(list(best.values())))
    assert optimizer.evaluations == 240, "every try counts"
    assert optimizer.bodies.evaluations == 20


def test_learning_ages_bodies_by_their_own_generations():
    optimizer = make("learning", tries=2, lessons=2, bodies={"type": "age_fitness"})
    solve(optimizer, 8)
    assert optimizer.bodies.generation == 4
    assert optimizer.bodies._ages.max() == 3


def test_learning_needs_a_controller_apart_from_the_body():
    cls = OPTIMIZERS["learning"]
    with pytest.raises(ValueError, match="cannot vary a controller without its body"):
        cls(object(), None, cls.Settings())


@pytest.mark.parametrize("bodies", ["age_fitness", "novelty", "speciation"])
def test_bodies_learn_in_a_run(bodies):
    changes = {
        "optimizer": {"type": "learning", "tries": 3, "bodies": {"type": bodies}},
        "encoding.body_rate": 1.0,
        "population": 24,
        "generations": 4,
        "task.measure": 1.0,
        "task.descriptors": ["diameter", "muscles", "symmetry", "footfall"],
    }
    run = Search(load("critter", changes))
    while not run.finished:
        generation = run.step()
    robots = run.encoding.express(generation.candidates.genomes)
    assert len({robot.topology for robot in robots}) <= 8
    assert run.optimizer.best_fitness > 0.0


@pytest.mark.parametrize("name", ["novelty", "map_elites"])
def test_bodies_are_told_apart_by_all_that_describes_them(name):
    descriptors = ["diameter", "mass", "muscles", "symmetry", "footfall"]
    optimizer = {"type": name, "descriptors": descriptors}
    if name == "map_elites":
        grid = {"bins": [4] * 5, "lowest": [0.1, 0.5, 0.0, 0.5, 0.0]}
        optimizer |= grid | {"highest": [0.9, 4.0, 300.0, 1.0, 1.0]}
    changes = {"population": 12, "generations": 3, "task.measure": 1.0, "optimizer": optimizer}
    run = Search(load("critter", changes | {"encoding.mass_per_point": 0.05}))
    while not run.finished:
        generation = run.step()
    found = generation.scores.descriptors
    assert set(descriptors) <= set(found)
    assert all(len(np.unique(found[one])) > 1 for one in descriptors)
