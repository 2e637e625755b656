"""Random lattices: against a k-d tree, against what a maximal sample is, and the course's worm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from tests.warp_springs.test_shapes import assert_closed
from warp_springs import shapes
from warp_springs.shapes.points import pairs_within

BOX, SPACING = (0.5, 0.2, 0.3), 0.05
WORM = (0.1875, 0.0375, 0.1875)


def pairs_of_the_tree(points, reach):
    pairs = np.sort(cKDTree(points).query_pairs(reach, output_type="ndarray"), axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 200),
    size=st.tuples(*[st.sampled_from([1e-6, 0.3, 1.0, 7.0])] * 3),
)
def test_pairs_are_those_of_a_tree(seed, count, size):
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3)) * size
    assert np.array_equal(pairs_within(points, 0.4), pairs_of_the_tree(points, 0.4))


def test_masses_keep_their_distance_and_leave_no_gap():
    robot = shapes.random_lattice(BOX, SPACING, seed=3)
    tree = cKDTree(robot.positions)
    assert tree.query(robot.positions, k=2)[0][:, 1].min() >= SPACING * (1 - 1e-12)
    anywhere = np.random.default_rng(1).uniform(0.0, BOX, (200_000, 3))
    assert tree.query(anywhere)[0].max() < SPACING
    assert (robot.positions >= 0.0).all() and (robot.positions <= BOX).all()


def test_springs_join_all_masses_within_reach():
    robot = shapes.random_lattice(BOX, SPACING, seed=3, reach=1.7, mass=2.0, stiffness=50.0)
    assert np.array_equal(robot.springs, pairs_of_the_tree(robot.positions, 1.7 * SPACING))
    assert robot.mass == pytest.approx(2.0)
    assert set(robot.stiffness) == {50.0}
    assert np.array_equal(robot.rest_length, robot.lengths)


def test_the_skin_is_closed_and_wraps_the_lattice():
    robot = shapes.random_lattice((0.5, 0.4, 0.3), 0.03, seed=3)
    assert_closed(robot)
    assert robot.volume == pytest.approx(0.06, rel=0.15)
    outer = np.unique(robot.faces)
    depth = np.minimum(robot.positions, np.array([0.5, 0.4, 0.3]) - robot.positions).min(axis=1)
    assert depth[outer].max() < 0.03
    assert len(outer) > 0.8 * (depth < 0.3 * 0.03).sum()


@pytest.mark.parametrize("count", [1, 500, 3000])
def test_as_many_springs_as_asked_for_and_the_shortest(count):
    robot = shapes.random_lattice(BOX, SPACING, seed=3, n_springs=count)
    assert robot.n_springs == count
    every = shapes.random_lattice(BOX, SPACING, seed=3, reach=10.0)
    assert np.array_equal(np.sort(robot.lengths), np.sort(every.lengths)[:count])


def test_the_seed_decides():
    one, again, other = (shapes.random_lattice(BOX, SPACING, seed) for seed in (1, 1, 2))
    assert one == again
    assert one != other


def test_a_box_may_lie_anywhere():
    here = shapes.random_lattice(BOX, SPACING, seed=5)
    there = shapes.random_lattice([(1, 2, 3), (1.5, 2.2, 3.3)], SPACING, seed=5)
    assert there.bounds == pytest.approx(here.bounds + np.array([1, 2, 3]), abs=2 * SPACING)


def test_a_flat_box_and_one_smaller_than_the_spacing():
    sheet = shapes.random_lattice((1.0, 1.0, 1e-6), 0.1, seed=1)
    assert sheet.n_masses > 50
    assert shapes.random_lattice((0.01, 0.01, 0.01), 1.0).n_masses == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0.1, 0.1), 0.01), "bounds"),
        (((0.1, 0.0, 0.1), 0.01), "bounds"),
        (([(0, 0, 0), (1, np.nan, 1)], 0.01), "bounds"),
        ((BOX, 0.0), "spacing"),
        ((BOX, SPACING, -1), "seed"),
        ((BOX, SPACING, 1.5), "seed"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ValueError, match=message):
        shapes.random_lattice(*arguments)


def test_refused_options():
    with pytest.raises(ValueError, match="reach"):
        shapes.random_lattice(BOX, SPACING, reach=0.5)
    with pytest.raises(ValueError, match="n_springs = 0"):
        shapes.random_lattice(BOX, SPACING, n_springs=0)
    with pytest.raises(ValueError, match="only 0 pairs"):
        shapes.random_lattice((0.01, 0.01, 0.01), 1.0, n_springs=1)


def test_the_worm_of_the_course():
    worm = shapes.random_lattice(WORM, 0.004)
    assert worm.n_springs == pytest.approx(270_033, rel=0.005)
    assert worm.n_masses == pytest.approx(16_700, rel=0.01)
    assert worm.lengths.min() >= 0.004 and worm.lengths.max() <= 2.3 * 0.004
