import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import warp_springs as ws
from evolve.encodings import DirectEncoding, DirectSettings
from evolve.encodings.direct import AMPLITUDE, PHASE, REST, STIFFNESS

BODY = ws.shapes.lattice(2, 1, 1)
SEEDS = st.integers(0, 2**32)


def rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


@pytest.fixture(scope="module")
def encoding() -> DirectEncoding:
    return DirectEncoding(BODY, DirectSettings(period=0.5))


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, n=st.integers(1, 9), region=st.sampled_from([0.0, 0.5, 1.0]))
def test_mutants_are_valid_and_changed_and_their_parents_are_not(seed, n, region):
    encoding = DirectEncoding(BODY, DirectSettings(region_mutation=region, mutation_step=2.0))
    genomes = encoding.random(n, rng(seed))
    before = genomes.copy()
    mutants = encoding.mutate(genomes, rng(seed + 1))
    np.testing.assert_array_equal(genomes, before)
    assert mutants.shape == genomes.shape and mutants.dtype == np.float32
    assert mutants.min() >= 0.0 and mutants.max() <= 1.0
    assert (mutants != genomes).any(axis=(1, 2)).all()


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, region=st.sampled_from([0.0, 0.5, 1.0]))
def test_a_child_takes_each_spring_whole_from_one_of_its_parents(seed, region):
    encoding = DirectEncoding(BODY, DirectSettings(region_crossover=region))
    a, b = encoding.random(6, rng(seed)), encoding.random(6, rng(seed + 1))
    children = encoding.cross(a, b, rng(seed + 2))
    from_a, from_b = (children == a).all(axis=1), (children == b).all(axis=1)
    assert (from_a | from_b).all()


def test_a_region_crossover_cuts_the_body_by_a_plane():
    encoding = DirectEncoding(BODY, DirectSettings(region_crossover=1.0))
    a, b = encoding.random(20, rng(1)), encoding.random(20, rng(2))
    from_b = (encoding.cross(a, b, rng(3)) == b).all(axis=1)
    middles = BODY.positions[BODY.springs].mean(axis=1)
    for side in from_b:
        if side.any():
            # Two sides of a plane have disjoint convex hulls: their means are apart.
            assert np.linalg.norm(middles[side].mean(axis=0) - middles[~side].mean(axis=0)) > 0.02


def test_a_region_mutation_shifts_neighbours_alike():
    encoding = DirectEncoding(BODY, DirectSettings(region_mutation=1.0, mutation_step=0.01))
    genomes = np.full((30, 4, BODY.n_springs), 0.5, dtype=np.float32)
    shifts = encoding.mutate(genomes, rng(4)) - genomes
    for kinds in shifts.reshape(-1, BODY.n_springs):
        assert len(np.unique(kinds[kinds != 0.0])) <= 1


def test_genes_are_uniform_at_the_start(encoding):
    genes = encoding.random(4000, rng(5))
    np.testing.assert_allclose(genes.mean(axis=(0, 2)), 0.5, atol=0.01)
    np.testing.assert_allclose(genes.var(axis=(0, 2)), 1.0 / 12.0, atol=0.003)


def test_bytes_return_the_same_genomes(encoding):
    genomes = encoding.random(5, rng(6))
    blobs = encoding.to_bytes(genomes)
    assert [len(blob) for blob in blobs] == [16 * BODY.n_springs] * 5
    back = encoding.from_bytes(blobs)
    assert back.dtype == np.float32
    np.testing.assert_array_equal(back, genomes)
    with pytest.raises(ValueError, match=f"genome 1 has 3 bytes, expected {16 * BODY.n_springs}"):
        encoding.from_bytes([blobs[0], b"abc"])


def test_take_and_concatenate(encoding):
    genomes = encoding.random(4, rng(7))
    both = encoding.concatenate([encoding.take(genomes, np.array([3, 1])), genomes[:1]])
    np.testing.assert_array_equal(both, genomes[[3, 1, 0]])


def test_distance_is_a_distance(encoding):
    a, b = encoding.random(200, rng(8)), encoding.random(200, rng(9))
    np.testing.assert_array_equal(encoding.distance(a, a), 0.0)
    np.testing.assert_array_equal(encoding.distance(a, b), encoding.distance(b, a))
    assert encoding.distance(a, b).mean() == pytest.approx(1.0, abs=0.02)
    almost = a.copy()
    almost[:, PHASE] = 0.999
    a[:, PHASE] = 0.001
    assert encoding.distance(a, almost).max() < 0.01, "the phase is circular"


def test_expression_follows_the_formulas(encoding):
    genomes = np.zeros((3, 4, BODY.n_springs), dtype=np.float32)
    genomes[1] = 1.0
    genomes[2] = 0.5
    robots = encoding.express(genomes)
    lengths, expected = BODY.lengths, encoding.settings
    for robot, gene in zip(robots, (0.0, 1.0, 0.5), strict=True):
        np.testing.assert_allclose(robot.rest_length, lengths * (0.9 + 0.2 * gene))
        np.testing.assert_allclose(robot.amplitude, lengths * expected.amplitude * gene)
        np.testing.assert_allclose(robot.phase, 2.0 * np.pi * gene)
        low, high = expected.stiffness
        np.testing.assert_allclose(robot.stiffness, low ** (1.0 - gene) * high**gene)
        assert robot.omega == pytest.approx(4.0 * np.pi)
    assert {REST, AMPLITUDE, PHASE, STIFFNESS} == {0, 1, 2, 3}


def test_a_body_without_springs_is_refused():
    point = ws.Robot(masses=1.0, positions=[[0, 0, 0]], springs=np.empty((0, 2)), stiffness=1.0)
    with pytest.raises(ValueError, match="needs a body with springs"):
        DirectEncoding(point, DirectSettings())


def test_mutants_differ_in_how_bold_they_are():
    spreads = []
    for spread in (0.0, 1.0):
        settings = DirectSettings(
            region_mutation=0.0, mutation_step=1e-3, mutation_rate=1.0, mutation_spread=spread
        )
        encoding = DirectEncoding(BODY, settings)
        genomes = np.full((500, *encoding.genome_shape), 0.5, np.float32)
        shifts = encoding.mutate(genomes, rng(5)) - genomes
        sizes = [np.std(one[one != 0.0]) for one in shifts]
        assert np.median(sizes) == pytest.approx(1e-3, rel=0.15)
        spreads.append(np.std(np.log(sizes)))
    assert spreads[0] < 0.15 and spreads[1] == pytest.approx(1.0, rel=0.15)
