from __future__ import annotations

import numpy as np
import pytest

from evolve.encodings import ArrayGenomes
from evolve.judging.scores import Scores
from evolve.optimizers import NOBODY, OPTIMIZERS, Individuals, Optimizer
from evolve.optimizers.selection import SelectionSettings, select
from evolve.search import Search
from evolve.streams import Streams
from evolve.toml import load

LEARNERS = [name for name in OPTIMIZERS if name not in ("random", "coevolution")]
"""Two populations have no best of all: see test_coevolution."""
SETTINGS = {
    "steady_state": {"living": 20},
    "map_elites": {"bins": (4, 4)},
    "learning": {"lessons": 3},  # not done when the test of resuming stops
}
"""What suits problems as small as these."""


class Vectors(ArrayGenomes):
    """Points in the unit cube: all that an optimizer needs to know of an encoding."""

    genome_shape = (12,)

    def random(self, n, rng):
        return rng.random((n, *self.genome_shape), dtype=np.float32)

    def mutate(self, genomes, rng):
        chosen = rng.random(genomes.shape) < 0.2
        shift = rng.normal(0.0, 0.1, genomes.shape) * chosen
        return np.clip(genomes + shift, 0.0, 1.0).astype(np.float32)

    def tune(self, genomes, rng):
        """The last half of the genes are the controller's."""
        mutants = self.mutate(genomes, rng)
        mutants[:, :6] = genomes[:, :6]
        return mutants

    def cross(self, a, b, rng):
        return np.where(rng.random(a.shape) < 0.5, a, b)

    def distance(self, a, b):
        return np.abs(a - b).mean(axis=1)


class Part(Vectors):
    """Genes of one of two populations."""

    def __init__(self, size):
        self.genome_shape = (size,)


class Pairs(Vectors):
    """Two populations in one genome."""

    sides = (Part(8), Part(4))

    def split(self, genomes):
        return genomes[:, :8], genomes[:, 8:]

    def joined(self, first, second):
        return np.concatenate([first, second], axis=1)


def make(name: str, seed: int = 1, **settings) -> Optimizer:
    cls = OPTIMIZERS[name]
    encoding = Pairs() if name == "coevolution" else Vectors()
    return cls(encoding, Streams(seed), cls.Settings(**{**SETTINGS.get(name, {}), **settings}))


def sphere(genomes: np.ndarray) -> Scores:
    """Higher is better, best at 0.3 everywhere; a corner of the space has no fitness."""
    fitness = -np.sum((genomes.astype(np.float64) - 0.3) ** 2, axis=1)
    descriptors = {
        "energy": genomes[:, 1],
        "displacement_x": 4.0 * genomes[:, 2] - 2.0,
        "displacement_y": 4.0 * genomes[:, 3] - 2.0,
    }
    return Scores(fitness, (genomes[:, 0] > 0.9).astype(int), descriptors)


def solve(optimizer: Optimizer, generations: int, n: int = 40) -> list[Individuals]:
    history = []
    for _ in range(generations):
        candidates = optimizer.ask(n)
        scores = sphere(candidates.genomes)
        optimizer.tell(candidates, scores)
        history.append(Individuals(candidates.ids, candidates.genomes, scores))
    return history


@pytest.mark.parametrize("name", LEARNERS)
def test_every_optimizer_beats_random_search(name):
    best = {name: 0.0, "random": 0.0}
    for seed in (1, 2, 3):
        for kind in best:
            optimizer = make(kind, seed)
            solve(optimizer, 60, n=20)
            assert optimizer.evaluations == 1200
            best[kind] += optimizer.best_fitness
    assert best[name] > 0.5 * best["random"]  # of negative numbers


def best_robot(name: str) -> float:
    """Fitness of the best cube that an optimizer finds in 960 evaluations."""
    changes = {"population": 24, "generations": 40, "encoding.type": "fourier"}
    changes |= {"encoding.waves": 2, "simulation.dt": 1e-3, "optimizer.type": name, "seed": 2}
    if name == "steady_state":
        changes["optimizer.living"] = 24
    search = Search(load("cube", changes))
    while not search.finished:
        search.step()
    assert search.optimizer.evaluations == 960
    return search.optimizer.best_fitness


@pytest.fixture(scope="module")
def random_robot() -> float:
    return best_robot("random")


@pytest.mark.parametrize("name", LEARNERS)
def test_every_optimizer_beats_random_search_on_a_robot(name, random_robot):
    assert best_robot(name) > 1.1 * random_robot


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_a_restored_optimizer_continues_with_the_same_bits(name):
    whole, first, second = make(name), make(name), make(name)
    everything = solve(whole, 9)
    before = solve(first, 4)
    everybody = {int(i): (h, k) for h in before for k, i in enumerate(h.ids)}

    def recall(ids):
        picked = [everybody[int(i)] for i in ids]
        genomes = np.stack([h.genomes[k] for h, k in picked])
        return Individuals(
            ids, genomes, Scores.concatenate([h.scores.take(np.array([k])) for h, k in picked])
        )

    second.restore({k: v.copy() for k, v in first.state().items()}, recall)
    after = solve(second, 5)
    for a, b in zip(everything, before + after, strict=True):
        np.testing.assert_array_equal(a.ids, b.ids)
        np.testing.assert_array_equal(a.genomes, b.genomes)
    assert second.state().keys() == whole.state().keys()
    for key, value in whole.state().items():
        np.testing.assert_array_equal(value, second.state()[key])


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_the_bookkeeping(name):
    optimizer = make(name)
    history = solve(optimizer, 6)
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
        if generation and name not in ("random", "cma"):
            assert len(parents) >= 20
        optimizer.tell(candidates, sphere(candidates.genomes))


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_a_population_without_any_fitness_is_survived(name):
    optimizer = make(name)
    for _ in range(3):
        candidates = optimizer.ask(10)
        nothing = {key: np.full(10, np.nan) for key in sphere(candidates.genomes).descriptors}
        optimizer.tell(candidates, Scores(np.full(10, np.nan), np.ones(10), nothing))
    assert optimizer.best_id == NOBODY and np.isnan(optimizer.best_fitness)
    assert optimizer.failures == 30
    candidates = optimizer.ask(10)
    found = {key: np.zeros(10) for key in nothing}
    optimizer.tell(candidates, Scores(np.arange(10.0), np.zeros(10), found))
    assert optimizer.best_fitness == 9.0


def test_a_score_of_a_stopped_robot_never_counts():
    scores = Scores(np.array([5.0, 1.0, np.inf]), status=np.array([3, 0, 0]))
    assert np.isnan(scores.fitness[0])
    np.testing.assert_array_equal(scores.worth, [-np.inf, 1.0, -np.inf])


def test_elites_stay_and_are_not_asked_for_again():
    optimizer = make("genetic", elites=0.1, mutation_rate=1.0)
    solve(optimizer, 1, n=50)
    best = optimizer.state()["survivors"][:5]
    solve(optimizer, 1, n=50)
    survivors = optimizer.state()["survivors"]
    assert len(survivors) == 50
    better = optimizer.state()["survivors"][:5]
    assert set(better) <= set(best) | set(range(51, 101))
    assert np.count_nonzero(survivors <= 50) <= 5


def test_one_hill_climber_moves_to_the_best_of_its_mutants():
    optimizer = make("hill_climber", climbers=1)
    solve(optimizer, 1)
    for _ in range(5):
        at = optimizer._survivors
        told = solve(optimizer, 1)[0]
        best = int(np.argmax(told.scores.worth))
        better = told.scores.worth[best] >= at.scores.worth[0]
        expected = told.ids[best] if better else at.ids[0]
        np.testing.assert_array_equal(optimizer._survivors.ids, [expected])
        assert (optimizer.ask(40).parents[:, 0] == expected).all()


def test_hill_climbers_never_step_down():
    optimizer = make("hill_climber")
    worth = np.full(40, -np.inf)
    for _ in range(6):
        told = solve(optimizer, 1)[0].scores.worth
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


@pytest.mark.parametrize("name", ["rank", "truncation", "tournament"])
def test_selection_prefers_the_fit_as_its_settings_say(name):
    settings = SelectionSettings(selection=name, pressure=1.8, truncation=0.1, tournament=3)
    rng = np.random.default_rng(1)
    drawn = select(settings, 50, (200_000,), rng)
    share = np.bincount(drawn, minlength=50) / len(drawn)
    k = np.arange(50)
    expected = {
        "rank": (1.8 - 1.6 * k / 49) / 50,
        "truncation": np.where(k < 5, 0.2, 0.0),
        "tournament": ((50 - k) ** 3 - (49 - k) ** 3) / 50.0**3,
    }[name]
    np.testing.assert_allclose(share, expected, atol=2e-3)


def test_crowding_keeps_two_peaks_where_a_genetic_algorithm_keeps_one():
    def peaks(genomes):
        x = genomes.astype(np.float64)
        apart = [np.sum((x - at) ** 2, axis=1) for at in (0.2, 0.8)]
        return Scores(-np.minimum(*apart), np.zeros(len(x)))

    kept = {}
    for name in ("crowding", "genetic"):
        optimizer = make(name)
        for _ in range(60):
            candidates = optimizer.ask(40)
            optimizer.tell(candidates, peaks(candidates.genomes))
        near = optimizer._survivors.genomes.mean(axis=1) < 0.5
        kept[name] = min(near.sum(), (~near).sum())
    assert kept["crowding"] >= 10 > kept["genetic"]


def test_ages_are_those_of_the_oldest_ancestor():
    optimizer, ages = make("age_fitness"), {NOBODY: -1}
    for generation in range(8):
        candidates = optimizer.ask(40)
        for i, parents in zip(candidates.ids, candidates.parents, strict=True):
            # Counted from birth: an ancestor grows older even when it left no trace.
            oldest = [ages[p] for p in parents.tolist() if p != NOBODY]
            ages[int(i)] = min(oldest) if oldest else generation
        optimizer.tell(candidates, sphere(candidates.genomes))
        born = np.array([ages[int(i)] for i in optimizer._survivors.ids])
        np.testing.assert_array_equal(optimizer._ages, generation - born)
    assert optimizer._ages.min() < 3 < optimizer._ages.max()


def test_nsga2_spreads_along_the_front():
    """Schaffer's problem: f1 = x^2 and f2 = (x - 1)^2; every x from 0 to 1 is a trade-off."""
    optimizer = make("nsga2", objectives=("fitness", "-energy"))
    for _ in range(60):
        candidates = optimizer.ask(80)
        x = candidates.genomes.astype(np.float64)
        f1, f2 = (x**2).mean(axis=1), ((x - 1.0) ** 2).mean(axis=1)
        optimizer.tell(candidates, Scores(-f1, np.zeros(80), {"energy": f2}))
    first, second = -optimizer._survivors.scores.worth, optimizer._survivors.scores.descriptors
    # On the front sqrt(f1) + sqrt(f2) = 1.
    ideal = np.sqrt(first) + np.sqrt(second["energy"])
    assert np.median(ideal) < 1.05
    assert np.sqrt(first).min() < 0.25 and np.sqrt(first).max() > 0.75


def test_what_cannot_be_an_objective_is_named():
    with pytest.raises(ValueError, match="'-fun': there is no 'fun'; there are fitness, energy"):
        solve(make("nsga2", objectives=("fitness", "-fun")), 1)
    with pytest.raises(ValueError, match="descriptor 'fun': there is none; there are energy"):
        solve(make("map_elites", descriptors=("fun", "energy")), 1)


def test_map_elites_keeps_the_best_of_every_cell():
    optimizer = make("map_elites")
    everybody = solve(optimizer, 12)
    pool = Individuals(
        np.concatenate([part.ids for part in everybody]),
        np.concatenate([part.genomes for part in everybody]),
        Scores.concatenate([part.scores for part in everybody]),
    )
    cells, worth = np.full(len(pool), -1), pool.scores.worth
    good = np.isfinite(worth)
    cells[good] = optimizer.cells(optimizer._take(pool, np.flatnonzero(good)))
    best = {c: worth[cells == c].max() for c in np.unique(cells[good])}
    np.testing.assert_array_equal(optimizer.cells(optimizer._survivors), sorted(best))
    np.testing.assert_array_equal(
        optimizer._survivors.scores.worth, [best[c] for c in sorted(best)]
    )


def test_cma_draws_from_its_own_stream():
    before = np.random.get_state()[1].copy()  # noqa: NPY002 (it must stay untouched)
    a, b = make("cma"), make("cma")
    solve(a, 5), solve(b, 5)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    np.testing.assert_array_equal(a.ask(9).genomes, b.ask(9).genomes)
    with pytest.raises(ValueError, match="no genomes of a fixed number of real genes"):
        OPTIMIZERS["cma"](object(), Streams(1), OPTIMIZERS["cma"].Settings())
