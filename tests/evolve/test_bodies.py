"""What every encoding of evolving bodies keeps to, and that nothing it makes stalls a run."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import warp_springs as ws
from evolve.bodies.plan import connected_parts
from evolve.encodings import ENCODINGS
from evolve.fitness import FITNESS, Trial
from evolve.search import Search
from evolve.toml import load

EVOLVING = [name for name, encoding in ENCODINGS.items() if not encoding.fixed_body]
SEED_BODY = ws.shapes.lattice(2, 1, 1)


def rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


@cache
def make(name: str):
    cls = ENCODINGS[name]
    return cls(SEED_BODY if cls.needs_body else None, cls.Settings())


@cache
def genomes_of(name: str, n: int, steps: int = 4):
    """Genomes that have been mutated and crossed over some times."""
    encoding = make(name)
    genomes = encoding.random(n, rng(1))
    for step in range(steps):
        shuffled = encoding.take(genomes, rng(step).permutation(n))
        genomes = encoding.cross(genomes, shuffled, rng(10 + step))
        genomes = encoding.mutate(genomes, rng(20 + step))
    return genomes


def assert_is_a_body(robot: ws.Robot) -> None:
    assert robot.n_springs and robot.bounds[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(robot.positions).all() and (robot.masses > 0.0).all()
    assert len(set(connected_parts(robot.n_masses, robot.springs))) == 1
    assert len(np.unique(np.sort(robot.springs, axis=1), axis=0)) == robot.n_springs
    assert (robot.lengths > 0.0).all()
    assert (np.abs(robot.amplitude) < robot.rest_length).all()


@pytest.mark.parametrize("name", EVOLVING)
def test_every_genome_is_a_connected_body_on_the_ground_of_the_mass_that_all_have(name):
    encoding = make(name)
    robots = encoding.express(genomes_of(name, 100))
    for robot in robots:
        assert_is_a_body(robot)
        assert robot.mass == pytest.approx(encoding.settings.mass)
    assert len({robot.topology for robot in robots}) > 30


@pytest.mark.parametrize("name", EVOLVING)
def test_operators_are_pure_and_repeatable(name):
    encoding, genomes = make(name), genomes_of(name, 20)
    before, others = encoding.to_bytes(genomes), encoding.random(20, rng(7))
    for change in (
        lambda: encoding.mutate(genomes, rng(3)),
        lambda: encoding.cross(genomes, others, rng(4)),
    ):
        assert encoding.to_bytes(change()) == encoding.to_bytes(change())
    assert encoding.to_bytes(genomes) == before


@pytest.mark.parametrize("name", EVOLVING)
def test_genomes_survive_their_bytes(name):
    encoding, genomes = make(name), genomes_of(name, 20)
    blobs = encoding.to_bytes(genomes)
    again = encoding.from_bytes(blobs)
    assert encoding.to_bytes(again) == blobs
    assert list(encoding.express(again)) == list(encoding.express(genomes))
    both = encoding.concatenate([genomes, encoding.take(genomes, np.array([4, 0]))])
    assert encoding.to_bytes(both) == [*blobs, blobs[4], blobs[0]]
    with pytest.raises(ValueError, match="genome 1"):
        encoding.from_bytes([blobs[0], blobs[1][:-1]])


@pytest.mark.parametrize("name", EVOLVING)
def test_distance_is_zero_to_itself_and_smaller_to_a_mutant_than_to_a_stranger(name):
    encoding = make(name)
    a, b = encoding.random(100, rng(1)), encoding.random(100, rng(2))
    np.testing.assert_allclose(encoding.distance(a, a), 0.0, atol=1e-12)
    near, far = encoding.distance(a, encoding.mutate(a, rng(3))).mean(), encoding.distance(a, b)
    assert 0.0 < near < 0.7 * far.mean()
    assert 0.3 < far.mean() < 1.7


@pytest.mark.parametrize("name", EVOLVING)
def test_mutants_are_other_robots(name):
    encoding, genomes = make(name), genomes_of(name, 60)
    pairs = zip(
        encoding.express(genomes), encoding.express(encoding.mutate(genomes, rng(6))), strict=True
    )
    assert sum(a == b for a, b in pairs) <= 6


@pytest.mark.parametrize("name", ENCODINGS)
def test_whatever_a_genome_makes_a_run_goes_on(name):
    encoding = make(name)
    genomes = encoding.random(1000, rng(5))
    shuffled = encoding.take(genomes, rng(6).permutation(1000))
    genomes = encoding.mutate(encoding.cross(genomes, shuffled, rng(7)), rng(8))
    scene = ws.Scene(ground=ws.Ground(), damping=1.0)
    simulation = ws.Simulation(encoding.express(genomes), scene, dt=1e-3, precision="float32")
    result = simulation.run(0.1)
    good = np.asarray(result.status) == 0
    assert np.isfinite(result.center_of_mass[good]).all() and good.mean() > 0.5


def test_a_body_search_finds_faster_robots():
    search = Search(load("critter", {"population": 48, "generations": 8, "task.measure": 2.0}))
    first = search.step().scores.fitness
    while not search.finished:
        search.step()
    assert search.optimizer.best_fitness > 1.1 * np.nanmax(first)


def test_voxels_are_those_of_the_genes():
    cls = ENCODINGS["voxels"]
    encoding = cls(None, cls.Settings(cells=(3, 1, 2), least_voxels=1))
    genome = np.zeros((1, 6, 3), np.float32)
    genome[0, [0, 1, 2], 0] = 1.0  # an L of three
    genome[0, :, 1] = [0.1, 0.3, 0.9, 0.0, 0.0, 0.0]  # tissue, bone, muscle
    genome[0, :, 2] = 0.25
    (robot,) = encoding.express(genome)
    mask = np.array([1, 1, 1, 0, 0, 0], bool).reshape(3, 1, 2)
    body = ws.shapes.voxels(mask)
    np.testing.assert_array_equal(robot.springs, body.springs)
    np.testing.assert_array_equal(robot.faces, body.faces)
    x, _, z = body.positions[body.springs].mean(axis=1).T
    bone, muscle = z > 0.101, x > 0.101
    np.testing.assert_allclose(robot.stiffness[bone], 20000.0)
    np.testing.assert_allclose(robot.stiffness[muscle], 5000.0)
    np.testing.assert_allclose(robot.amplitude[muscle], 0.2 * body.lengths[muscle])
    np.testing.assert_allclose(robot.phase[muscle], np.pi / 2.0)
    assert (robot.amplitude[bone] == 0.0).all()
    shared = (np.abs(x - 0.1) < 1e-9) & (z < 0.099)  # between tissue and muscle
    np.testing.assert_allclose(robot.stiffness[shared & ~bone], np.sqrt(1000.0 * 5000.0))


def test_what_does_not_hang_together_is_left_out():
    cls = ENCODINGS["voxels"]
    encoding = cls(None, cls.Settings(cells=(4, 2, 1), least_voxels=1))
    presence = np.array([[0.9, -1, 0.5, -1, -1, 0.2, 0.3, 0.4], [-0.5, -0.1] + [-0.9] * 6])
    masks = encoding.masks(presence)
    assert np.flatnonzero(masks[0]).tolist() == [5, 6, 7]
    assert np.flatnonzero(masks[1]).tolist() == [1]
    full = cls(None, cls.Settings(cells=(4, 2, 1), least_voxels=4)).masks(presence)
    assert (full.sum(axis=1) == 4).all()


def test_a_tower_that_falls_is_not_steady():
    """It covers its own height once; a walker of the same mean speed goes on."""
    tower = ws.shapes.lattice(1, 1, 6).replace(omega=2.0 * np.pi)
    tipped = tower.rotated((0.0, 1.0, 0.0), 0.3, about=(0.1, 0.0, 0.0))
    tipped = tipped.moved((0.0, 0.0, -tipped.bounds[0, 2]))
    scene = ws.Scene(ground=ws.Ground(), damping=1.0)
    simulation = ws.Simulation([tipped], scene, dt=5e-4)
    settled = simulation.run(1e-3)
    pieces = [simulation.run(0.1) for _ in range(40)]
    trial = Trial([tipped], settled, pieces)
    assert FITNESS["speed"](trial)[0] > 0.08
    assert FITNESS["steady"](trial)[0] < 0.02


def test_descriptors_of_bodies():
    block, bent = ws.shapes.lattice(2, 1, 1), ws.shapes.voxels(np.array([[[1, 1], [1, 0]]]))
    lopsided = ws.shapes.tetrahedron().rotated((0, 0, 1), 0.4)
    walking = block.replace(amplitude=np.where(np.arange(block.n_springs) < 7, 0.01, 0.0))
    trial = Trial([block, bent, lopsided, walking], None, [])
    assert FITNESS["muscles"](trial).tolist() == [0.0, 0.0, 0.0, 7.0]
    found = FITNESS["symmetry"](trial)
    np.testing.assert_allclose(found[[0, 1]], 1.0, atol=1e-12)
    assert found[2] < 0.9
