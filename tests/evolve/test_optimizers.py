from __future__ import annotations

import numpy as np
import pytest

from evolve.encodings import ArrayGenomes
from evolve.optimizers import NOBODY, OPTIMIZERS, Individuals, Optimizer
from evolve.scores import Scores
from evolve.streams import Streams

LEARNERS = [name for name in OPTIMIZERS if name != "random"]


class Vectors(ArrayGenomes):
    """Points in the unit cube: all that an optimizer needs to know of an encoding."""

    genome_shape = (12,)

    def random(self, n, rng):
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes, rng):
        chosen = rng.random(genomes.shape) < 0.2
        shift = rng.normal(0.0, 0.1, genomes.shape) * chosen
        return np.clip(genomes + shift, 0.0, 1.0).astype(np.float32)

    def cross(self, a, b, rng):
        return np.where(rng.random(a.shape) < 0.5, a, b)


def make(name: str, seed: int = 1, **settings) -> Optimizer:
    cls = OPTIMIZERS[name]
    return cls(Vectors(), Streams(seed), cls.Settings(**settings))


def sphere(genomes: np.ndarray) -> Scores:
    """Higher is better, best at 0.3 everywhere; a corner of the space has no fitness."""
    fitness = -np.sum((genomes.astype(np.float64) - 0.3) ** 2, axis=1)
    return Scores(fitness, status=(genomes[:, 0] > 0.9).astype(int))


def search(optimizer: Optimizer, generations: int, n: int = 40) -> list[Individuals]:
    history = []
    for _ in range(generations):
        candidates = optimizer.ask(n)
        scores = sphere(candidates.genomes)
        optimizer.tell(candidates, scores)
        history.append(Individuals(candidates.ids, candidates.genomes, scores))
    return history


@pytest.mark.parametrize("name", LEARNERS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_optimizer_beats_random_search(name, seed):
    optimizer, baseline = make(name, seed), make("random", seed)
    search(optimizer, 60, n=20)
    search(baseline, 60, n=20)
    assert optimizer.evaluations == baseline.evaluations == 1200
    assert optimizer.best_fitness > 0.5 * baseline.best_fitness  # of negative numbers


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_a_restored_optimizer_continues_with_the_same_bits(name):
    whole, first, second = make(name), make(name), make(name)
    everything = search(whole, 9)
    before = search(first, 4)
    everybody = {int(i): (h, k) for h in before for k, i in enumerate(h.ids)}

    def recall(ids):
        picked = [everybody[int(i)] for i in ids]
        genomes = np.stack([h.genomes[k] for h, k in picked])
        return Individuals(
            ids, genomes, Scores.concatenate([h.scores.take(np.array([k])) for h, k in picked])
        )

    second.restore({k: v.copy() for k, v in first.state().items()}, recall)
    after = search(second, 5)
    for a, b in zip(everything, before + after, strict=True):
        np.testing.assert_array_equal(a.ids, b.ids)
        np.testing.assert_array_equal(a.genomes, b.genomes)
    assert second.state().keys() == whole.state().keys()
    for key, value in whole.state().items():
        np.testing.assert_array_equal(value, second.state()[key])


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_the_bookkeeping(name):
    optimizer = make(name)
    history = search(optimizer, 6)
    ids = np.concatenate([h.ids for h in history])
    worth = np.concatenate([h.scores.worth for h in history])
    np.testing.assert_array_equal(ids, np.arange(1, 241))
    assert (optimizer.generation, optimizer.evaluations) == (6, 240)
    assert optimizer.failures == np.count_nonzero(np.isneginf(worth)) > 0
    assert optimizer.best_fitness == worth.max()
    assert optimizer.best_id == ids[worth.argmax()]


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_parents_were_individuals_of_earlier_generations(name):
    optimizer = make(name)
    for generation in range(4):
        candidates = optimizer.ask(30)
        parents = candidates.parents[candidates.parents != NOBODY]
        assert candidates.parents.shape == (30, 2)
        assert (parents >= 1).all() and (parents <= 30 * generation).all()
        if generation and name != "random":
            assert len(parents) >= 20
        optimizer.tell(candidates, sphere(candidates.genomes))


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_a_population_without_any_fitness_is_survived(name):
    optimizer = make(name)
    for _ in range(3):
        candidates = optimizer.ask(10)
        optimizer.tell(candidates, Scores(np.full(10, np.nan), np.ones(10)))
    assert optimizer.best_id == NOBODY and np.isnan(optimizer.best_fitness)
    assert optimizer.failures == 30
    candidates = optimizer.ask(10)
    optimizer.tell(candidates, Scores(np.arange(10.0), np.zeros(10)))
    assert optimizer.best_fitness == 9.0


def test_a_score_of_a_stopped_robot_never_counts():
    scores = Scores(np.array([5.0, 1.0, np.inf]), status=np.array([3, 0, 0]))
    assert np.isnan(scores.fitness[0])
    np.testing.assert_array_equal(scores.worth, [-np.inf, 1.0, -np.inf])


def test_elites_stay_and_are_not_asked_for_again():
    optimizer = make("genetic", elites=0.1, mutation_rate=1.0)
    search(optimizer, 1, n=50)
    best = optimizer.state()["survivors"][:5]
    search(optimizer, 1, n=50)
    survivors = optimizer.state()["survivors"]
    assert len(survivors) == 50
    better = optimizer.state()["survivors"][:5]
    assert set(better) <= set(best) | set(range(51, 101))
    assert np.count_nonzero(survivors <= 50) <= 5


def test_hill_climbers_never_step_down():
    optimizer = make("hill_climber")
    worth = np.full(40, -np.inf)
    for _ in range(6):
        told = search(optimizer, 1)[0].scores.worth
        climbed = optimizer._survivors.scores.worth
        np.testing.assert_array_equal(climbed, np.maximum(worth, told))
        worth = climbed
    with pytest.raises(ValueError, match="40 hill climbers were asked for 10"):
        optimizer.ask(10)


def test_what_does_not_fit_is_refused():
    optimizer = make("random")
    with pytest.raises(ValueError, match="at least one candidate, not 0"):
        optimizer.ask(0)
    with pytest.raises(ValueError, match="3 candidates were told 2 scores"):
        optimizer.tell(optimizer.ask(3), Scores(np.zeros(2), np.zeros(2)))
    with pytest.raises(ValueError, match=r"status must have the shape of fitness, \(2,\)"):
        Scores(np.zeros(2), np.zeros(3))
