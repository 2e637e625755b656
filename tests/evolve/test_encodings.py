"""What every encoding of a fixed body keeps to, and what each of them is for."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import warp_springs as ws
from evolve.encodings import ENCODINGS
from evolve.encodings.expression import Formulas
from evolve.encodings.networks import FUNCTIONS, Networks
from evolve.search import Search
from evolve.toml import load

BODY = ws.shapes.lattice(3, 1, 1)
SEEDS = st.integers(0, 2**32)
FIXED = [name for name, cls in ENCODINGS.items() if cls.fixed_body and name != "arena"]
"""An arena has robots of any encoding: see test_coevolution."""
SOME = {"period": 0.5, "amplitude": 0.2, "stiffness": (500.0, 5000.0), "mutation_rate": 0.1}
"""Settings that every encoding of a fixed body understands."""


def rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def make(name: str, body: ws.Robot = BODY, **changes):
    cls = ENCODINGS[name]
    return cls(body, cls.Settings(**(SOME | changes)))


def bytes_of(encoding, genomes) -> list[bytes]:
    return encoding.to_bytes(genomes)


def genomes_of(encoding, seed: int, n: int, steps: int = 6):
    """Genomes that have been mutated and crossed over some times."""
    genomes = encoding.random(n, rng(seed))
    for step in range(steps):
        shuffled = encoding.take(genomes, rng(seed + step).permutation(n))
        genomes = encoding.cross(genomes, shuffled, rng(seed + 10 + step))
        genomes = encoding.mutate(genomes, rng(seed + 20 + step))
    return genomes


@pytest.mark.parametrize("name", FIXED)
@settings(max_examples=12, deadline=None)
@given(seed=SEEDS)
def test_operators_are_pure_and_repeatable(name, seed):
    encoding, state = make(name), random.getstate()
    genomes = genomes_of(encoding, seed, 5)
    before = bytes_of(encoding, genomes)
    others = encoding.random(5, rng(seed + 1))
    for change in (
        lambda: encoding.mutate(genomes, rng(seed + 2)),
        lambda: encoding.cross(genomes, others, rng(seed + 3)),
    ):
        first, again = bytes_of(encoding, change()), bytes_of(encoding, change())
        assert first == again
        assert len(first) == 5
    assert bytes_of(encoding, genomes) == before
    assert random.getstate() == state


@pytest.mark.parametrize("name", FIXED)
@settings(max_examples=12, deadline=None)
@given(seed=SEEDS)
def test_genomes_survive_their_bytes(name, seed):
    encoding = make(name)
    genomes = genomes_of(encoding, seed, 6)
    blobs = bytes_of(encoding, genomes)
    again = encoding.from_bytes(blobs)
    assert bytes_of(encoding, again) == blobs
    assert list(encoding.express(again)) == list(encoding.express(genomes))
    both = encoding.concatenate([genomes, encoding.take(genomes, np.array([4, 0]))])
    assert bytes_of(encoding, both) == [*blobs, blobs[4], blobs[0]]
    with pytest.raises(ValueError, match="genome 1"):
        encoding.from_bytes([blobs[0], blobs[1][:-1]])


@pytest.mark.parametrize("name", FIXED)
@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_robots_are_within_their_bounds_at_all_times(name, seed):
    encoding = make(name)
    robots = encoding.express(genomes_of(encoding, seed, 4))
    assert isinstance(robots, ws.Variants) and len(robots) == 4
    lengths, settings = BODY.lengths, encoding.settings
    for robot in robots:
        np.testing.assert_array_equal(robot.springs, BODY.springs)
        assert robot.omega == pytest.approx(4.0 * np.pi)
        if name == "regions":
            continue  # its materials decide
        stiffness = np.array(settings.stiffness)
        assert (robot.stiffness >= stiffness[0] * (1 - 1e-9)).all()
        assert (robot.stiffness <= stiffness[1] * (1 + 1e-9)).all()
        low, high = settings.rest_length
        assert (robot.rest_length >= lengths * low * (1 - 1e-9)).all()
        assert (robot.rest_length <= lengths * high * (1 + 1e-9)).all()
        swing = np.abs(robot.amplitude)
        assert (swing <= settings.amplitude * lengths * (4.0 / np.pi + 1e-9)).all()


@pytest.mark.parametrize("name", FIXED)
def test_distance_is_zero_to_itself_small_to_a_mutant_and_about_one_to_a_stranger(name):
    encoding = make(name)
    a, b = encoding.random(200, rng(1)), encoding.random(200, rng(2))
    np.testing.assert_allclose(encoding.distance(a, a), 0.0, atol=1e-12)
    np.testing.assert_allclose(encoding.distance(a, b), encoding.distance(b, a), rtol=1e-6)
    near, far = encoding.distance(a, encoding.mutate(a, rng(3))).mean(), encoding.distance(a, b)
    assert 0.0 < near < 0.6 * far.mean()
    assert 0.4 < far.mean() < 1.6


@pytest.mark.parametrize("name", FIXED)
def test_mutants_differ(name):
    encoding = make(name)
    genomes = genomes_of(encoding, 5, 100)
    mutants = encoding.mutate(genomes, rng(6))
    same = [a == b for a, b in zip(bytes_of(encoding, genomes), bytes_of(encoding, mutants))]  # noqa: B905
    assert sum(same) <= 2  # a material may be drawn again


@pytest.mark.parametrize("name", FIXED)
def test_mirrored_springs_do_the_same_half_a_cycle_later(name):
    encoding = make(name, symmetry="x", symmetry_phase=0.5)
    robots = encoding.express(genomes_of(encoding, 7, 3))
    middles = BODY.positions[BODY.springs].mean(axis=1)
    ends = BODY.positions[BODY.springs]
    mirrored = ends * (-1.0, 1.0, 1.0) + (0.3, 0.0, 0.0)
    here = {tuple(sorted(map(tuple, np.round(e, 6).tolist()))): s for s, e in enumerate(ends)}
    image = np.array([here[tuple(sorted(map(tuple, np.round(e, 6).tolist())))] for e in mirrored])
    assert (image != np.arange(len(image))).sum() > 30
    left = np.flatnonzero(middles[:, 0] < 0.15 - 1e-9)
    for robot in robots:
        np.testing.assert_allclose(robot.stiffness[image], robot.stiffness)
        now, later = (robot.rest_length_at(t) for t in (0.11, 0.36))
        one_way = np.abs(now[left] - later[image[left]]).max()
        other = np.abs(now[image[left]] - later[left]).max()
        assert min(one_way, other) < 1e-9
    with pytest.raises(ValueError, match="not its own mirror image along y"):
        lopsided = BODY.replace(positions=BODY.positions * 1.0 + 0.01 * (BODY.positions[:, :1] > 0))
        bent = lopsided.replace(positions=lopsided.positions * (1, 1 + lopsided.positions[0, 0], 1))
        twisted = bent.positions.copy()
        twisted[0, 1] -= 0.03
        make(name, body=bent.replace(positions=twisted), symmetry="y")


@pytest.mark.parametrize("name", FIXED)
def test_springs_that_are_no_muscles_stay_as_the_body_has_them(name):
    body = ws.shapes.snake(3)
    cables = body.elements.slope == 0.0
    encoding = make(name, body, muscles="cables", symmetry="y")
    assert set(encoding.own) < set(np.flatnonzero(cables))
    robots = encoding.express(genomes_of(encoding, 3, 4))
    for robot in robots:
        for field in ("rest_length", "amplitude", "phase", "stiffness"):
            mine, its = getattr(robot, field), getattr(body, field)
            np.testing.assert_array_equal(mine[~cables], its[~cables])
        if robot.elements.harmonics is not None:
            assert not robot.elements.harmonics[~cables].any()
        assert robot.elements.slope.tolist() == body.elements.slope.tolist()
    assert (robots[0].stiffness[cables] != body.stiffness[cables]).any()


def test_a_body_without_cables_is_refused():
    with pytest.raises(ValueError, match="muscles: the body has no cables"):
        make("direct", muscles="cables")


@pytest.mark.parametrize("name", FIXED)
def test_a_run_changes_its_encoding_by_one_word(name):
    """And finds a faster robot than any of the first generation."""
    changes = {"encoding.type": name, "population": 48, "generations": 12, "task.measure": 2.0}
    search = Search(load("cube", changes))
    first = search.step().scores.fitness
    while not search.finished:
        search.step()
    assert search.optimizer.best_fitness > 1.1 * np.nanmax(first)


def test_a_body_without_springs_is_refused():
    lonely = ws.Robot(masses=1.0, positions=[[0, 0, 0]], springs=np.zeros((0, 2), int), stiffness=1)
    for name in FIXED:
        with pytest.raises(ValueError, match="needs a body with springs"):
            make(name, body=lonely)


# -- regions --------------------------------------------------------------------------------------


def test_regions_are_of_the_four_classic_materials():
    encoding = make("regions", shape="centroids", regions=2)
    genome = np.array([[[0.0, 0.5, 0.5, 0.0, 0.3], [1.0, 0.5, 0.5, 0.0, 0.9]]], np.float32)
    (robot,) = encoding.express(genome)
    left = BODY.positions[BODY.springs].mean(axis=1)[:, 0] < 0.149
    right = BODY.positions[BODY.springs].mean(axis=1)[:, 0] > 0.151
    assert (robot.stiffness[left] == 20_000.0).all() and (robot.amplitude[left] == 0.0).all()
    assert (robot.stiffness[right] == 5_000.0).all()
    np.testing.assert_allclose(robot.amplitude[right], 0.25 * BODY.lengths[right])
    np.testing.assert_allclose(robot.phase[right], np.pi)
    names = [robot.materials[label].name for label in robot.material[right]]
    assert set(names) == {"muscle2"}


def test_a_wider_gaussian_reaches_farther():
    encoding = make("regions", shape="gaussians", regions=2)
    genome = np.array([[[0.0, 0.5, 0.5, 1.0, 0.3], [1.0, 0.5, 0.5, 0.0, 0.9]]], np.float32)
    assert (encoding.chosen(genome) == 1).mean() > 0.8
    with pytest.raises(ValueError, match="names of materials, which are bone"):
        make("regions", materials=("bone", "cheese"))


# -- harmonics and expressions --------------------------------------------------------------------


def test_harmonics_are_those_of_the_genes():
    encoding = make("harmonics", harmonics=3)
    genome = np.full((1, *encoding.genome_shape), 0.25, np.float32)
    (robot,) = encoding.express(genome)
    t = np.linspace(0.0, 0.5, 17)
    w, b = 4.0 * np.pi, 0.2 * 0.25
    course = 0.95 + b * sum(np.sin(h * w * t + 0.5 * np.pi) / h for h in (1, 2, 3))
    ours = np.array([robot.rest_length_at(x) for x in t])
    np.testing.assert_allclose(ours, course[:, None] * BODY.lengths, atol=1e-12)


def test_a_formula_is_what_the_springs_do():
    encoding = make("expression", harmonics=8, rest_length=(0.5, 1.5))
    node = {a.value: a for a in _terminals()}
    tree = [_primitive("multiply"), node["x"], node["sin_wt"]]
    from deap import gp

    genome = Formulas(gp.PrimitiveTree(tree), gp.PrimitiveTree([node["x"]]))
    (robot,) = encoding.express([genome])
    for t in (0.0, 0.07, 0.21, 0.4):
        wave = np.tanh(encoding.places[:, 0] * np.sin(4.0 * np.pi * t))
        expected = BODY.lengths * (1.0 + 0.2 * wave)
        np.testing.assert_allclose(robot.rest_length_at(t), expected, atol=1e-6)
    share = np.log(robot.stiffness / 500.0) / np.log(10.0)
    np.testing.assert_allclose(share, 0.5 + 0.5 * np.tanh(encoding.places[:, 0]))


def _terminals():
    from evolve.encodings.expression import _is_variable, _primitives

    return [t for t in _primitives("length").terminals[object] if _is_variable(t)]


def _primitive(name):
    from evolve.encodings.expression import _primitives

    return _primitives("length").mapping[name]


def test_formulas_do_not_grow_beyond_their_limit():
    encoding = make("expression", nodes=12)
    for genome in genomes_of(encoding, 3, 30, steps=25):
        assert len(genome.length) <= 15 and len(genome.stiffness) <= 15


# -- fields and networks --------------------------------------------------------------------------


def test_neighbours_in_a_field_do_alike():
    encoding = make("fourier", body=ws.shapes.lattice(6, 1, 1), waves=1)
    robots = encoding.express(encoding.random(50, rng(8)))
    strain = robots.array("rest_length") / encoding.body.lengths
    places = encoding.places
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    near, far = (apart < 0.25) & (apart > 0.0), apart > 1.0
    gap = np.abs(strain[:, :, None] - strain[:, None, :]).mean(axis=0)
    assert gap[near].mean() < 0.3 * gap[far].mean()


def test_a_network_computes_what_its_genes_say():
    nets = Networks(2, 1, 1, 0.5, 0.1)
    genome = np.zeros((1, *nets.genome_shape), np.float32)
    weights, exists = np.full(nets.shape, 0.5, np.float32), np.zeros(nets.shape, np.float32)
    names = list(FUNCTIONS)
    for target, source, weight in ((0, 0, 1.0), (0, 1, -2.0), (1, 2, 3.0), (1, 0, 0.5)):
        weights[target, source], exists[target, source] = 0.5 + weight / 8.0, 1.0
    functions = [(names.index(n) + 0.5) / len(names) for n in ("sine", "tanh")]
    genome[0] = np.concatenate([weights.ravel(), exists.ravel(), functions])
    x, y = rng(1).random((2, 9))
    hidden = np.sin(np.pi * (x - 2.0 * y))
    (found,) = nets.evaluate(genome, np.stack([x, y]))
    np.testing.assert_allclose(found[0], np.tanh(3.0 * hidden + 0.5 * x), atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_splitting_a_connection_keeps_a_network_acyclic_and_within_its_places(seed):
    nets = Networks(3, 5, 2, 0.2, 0.2)
    genomes = nets.random(6, rng(seed))
    nodes = []
    for step in range(30):
        genomes = nets.mutate(genomes, rng(seed + step), 0.5, 0.3, 0.1)
        _, exists, _ = nets.parts(genomes)
        assert not (exists & ~nets.allowed).any()
        nodes.append(exists.any(axis=2)[:, :5].sum(axis=1))
    assert nodes[0].max() <= 1 and nodes[-1].max() > 2
    assert np.isfinite(nets.evaluate(genomes, rng(seed).standard_normal((3, 7)))).all()


def test_a_new_node_keeps_what_the_network_was_nearly():
    nets = Networks(1, 1, 1, 0.2, 0.2)
    genome = np.zeros((1, *nets.genome_shape), np.float32)
    size = nets.shape[0] * nets.shape[1]
    genome[0, :size] = 0.625  # weights of one
    genome[0, size + 2] = 1.0  # the output reads the input
    mutant = nets.mutate(genome, rng(2), 1.0, 0.0, 0.0)
    weights, exists, _ = nets.parts(mutant)
    np.testing.assert_array_equal(exists[0], [[True, False], [False, True]])
    np.testing.assert_allclose(weights[0][exists[0]], 1.0)
