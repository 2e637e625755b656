"""Shapes: counts by closed formula, closed outward surfaces, volumes, refusals."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from warp_springs import shapes

MASKS = npst.arrays(
    bool, st.tuples(*[st.integers(1, 4)] * 3), elements=st.booleans(), fill=st.nothing()
).filter(np.any)


def volume(robot):
    """The volume inside a closed surface, by the divergence theorem."""
    a, b, c = robot.positions[robot.faces].transpose(1, 0, 2)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def area(robot):
    a, b, c = robot.positions[robot.faces].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0


def assert_closed(robot):
    """Each edge of the surface is walked as often in one direction as in the other."""
    walks = Counter(
        pair for f in robot.faces.tolist() for pair in zip(f, f[1:] + f[:1], strict=True)
    )
    assert walks == Counter({(b, a): n for (a, b), n in walks.items()})


def assert_springs_in_order(robot):
    assert (robot.springs[:, 0] < robot.springs[:, 1]).all()
    pairs = robot.springs.tolist()
    assert pairs == sorted(pairs)
    assert len({tuple(pair) for pair in pairs}) == len(pairs)
    assert np.array_equal(robot.rest_length, robot.lengths)


# -- single bodies ---------------------------------------------------------------------------


def test_cube():
    robot = shapes.cube()
    assert (robot.n_masses, robot.n_springs, len(robot.faces)) == (8, 28, 12)
    assert robot.mass == pytest.approx(0.8)
    assert np.ptp(robot.masses) == 0.0
    assert set(robot.stiffness) == {1000.0}
    assert robot.bounds.tolist() == [[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]]
    lengths = Counter(np.round(robot.rest_length, 12).tolist())
    root2, root3 = round(0.1 * math.sqrt(2), 12), round(0.1 * math.sqrt(3), 12)
    assert lengths == {0.1: 12, root2: 12, root3: 4}
    assert volume(robot) == pytest.approx(1e-3, rel=1e-13)
    assert_closed(robot)
    assert_springs_in_order(robot)
    assert not robot.is_actuated
    assert not robot.velocities.any()
    assert shapes.cube(0.2, 1.6, 50.0) == shapes.lattice(1, 1, 1, 0.2, 0.2, 50.0)


@pytest.mark.parametrize(
    ("make", "counts", "solid", "surface", "diameter"),
    [
        (shapes.tetrahedron, (4, 6, 4), 1 / (6 * math.sqrt(2)), math.sqrt(3), 1.0),
        (shapes.octahedron, (6, 15, 8), math.sqrt(2) / 3, 2 * math.sqrt(3), math.sqrt(2)),
    ],
)
def test_regular_bodies(make, counts, solid, surface, diameter):
    robot = make(edge=0.3, mass=1.2, stiffness=70.0)
    assert (robot.n_masses, robot.n_springs, len(robot.faces)) == counts
    assert robot.mass == pytest.approx(1.2)
    assert np.ptp(robot.masses) == 0.0
    assert volume(robot) == pytest.approx(solid * 0.3**3, rel=1e-12)
    assert area(robot) == pytest.approx(surface * 0.3**2, rel=1e-12)
    assert robot.diameter == pytest.approx(diameter * 0.3)
    edges = np.isclose(robot.rest_length, 0.3, rtol=1e-12)
    assert edges.sum() == {6: 6, 15: 12}[robot.n_springs]
    assert robot.rest_length[~edges] == pytest.approx(0.3 * math.sqrt(2))
    assert (robot.positions[:, 2] == 0.0).sum() == 3  # it stands on a face
    assert robot.bounds[0, 2] == 0.0
    assert robot.center_of_mass[:2] == pytest.approx([0, 0], abs=1e-15)
    assert_closed(robot)
    assert_springs_in_order(robot)


# -- lattices --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [(1, 1, 1), (4, 2, 2), (3, 1, 5), (2, 3, 4), (17, 16, 16)])
def test_lattice_counts_by_formula(n):
    x, y, z = n
    robot = shapes.lattice(x, y, z, edge=0.5, mass_per_vertex=0.25)
    assert robot.n_masses == (x + 1) * (y + 1) * (z + 1)
    edges = x * (y + 1) * (z + 1) + y * (z + 1) * (x + 1) + z * (x + 1) * (y + 1)
    squares = x * y * (z + 1) + y * z * (x + 1) + z * x * (y + 1)
    assert robot.n_springs == edges + 2 * squares + 4 * x * y * z
    assert len(robot.faces) == 4 * (x * y + y * z + z * x)
    assert robot.mass == pytest.approx(0.25 * robot.n_masses)
    assert volume(robot) == pytest.approx(x * y * z * 0.5**3, rel=1e-12)
    assert robot.diameter == pytest.approx(0.5 * math.hypot(x, y, z))


def test_vertices_run_x_major_with_z_fastest():
    robot = shapes.lattice(2, 1, 3, edge=1.0)
    by_hand = list(itertools.product(range(3), range(2), range(4)))
    assert robot.positions.tolist() == [list(map(float, p)) for p in by_hand]
    assert_springs_in_order(robot)


def test_lattice_is_the_full_mask():
    assert shapes.lattice(3, 2, 1) == shapes.voxels(np.ones((3, 2, 1), int))


# -- voxels ----------------------------------------------------------------------------------


def counted_by_hand(mask):
    """Vertices, springs and exterior squares of a mask, voxel by voxel."""
    cells = {tuple(cell) for cell in np.argwhere(mask).tolist()}
    corners = list(itertools.product((0, 1), repeat=3))
    vertices, springs, squares = set(), set(), 0
    for cell in cells:
        own = [tuple(np.add(cell, corner).tolist()) for corner in corners]
        vertices.update(own)
        springs.update(itertools.combinations(own, 2))
        for axis, step in itertools.product(range(3), (-1, 1)):
            beyond = list(cell)
            beyond[axis] += step
            squares += tuple(beyond) not in cells
    return vertices, springs, squares


@given(MASKS)
@settings(max_examples=60, deadline=None)
def test_random_masks(mask):
    robot = shapes.voxels(mask, edge=1.0)
    vertices, springs, squares = counted_by_hand(mask)
    lowest = min(z for _, _, z in vertices)
    place = [(x, y, z + lowest) for x, y, z in robot.positions.astype(int).tolist()]
    assert place == sorted(vertices)
    assert {(place[i], place[j]) for i, j in robot.springs.tolist()} == springs
    assert len(robot.faces) == 2 * squares
    assert robot.bounds[0, 2] == 0.0
    assert volume(robot) == pytest.approx(mask.sum(), rel=1e-12)
    assert area(robot) == pytest.approx(squares)
    assert_closed(robot)
    assert_springs_in_order(robot)
    assert_faces_separate_solid_from_void(robot, mask, lowest)


def assert_faces_separate_solid_from_void(robot, mask, lowest):
    solid = np.pad(mask, 1)
    a, b, c = robot.positions[robot.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    centre = (a + b + c) / 3.0 + [1, 1, 1 + lowest]
    inside = np.floor(centre - 0.5 * normal).astype(int)
    outside = np.floor(centre + 0.5 * normal).astype(int)
    assert solid[tuple(inside.T)].all()
    assert not solid[tuple(outside.T)].any()


def test_masks_of_numbers_and_any_memory_order():
    mask = np.random.default_rng(0).random((3, 4, 2)) < 0.5
    robot = shapes.voxels(mask)
    assert shapes.voxels(mask.astype(np.uint8)) == robot
    assert shapes.voxels(mask.astype(float).tolist()) == robot
    assert shapes.voxels(np.asfortranarray(mask)) == robot


def test_bodies_of_one_mask_share_a_topology():
    mask = np.random.default_rng(1).random((3, 3, 3)) < 0.4
    other = mask.copy()
    other[0, 0, 0] ^= True
    assert shapes.voxels(mask).topology == shapes.voxels(mask, edge=0.3, stiffness=9.0).topology
    assert shapes.voxels(mask).topology != shapes.voxels(other).topology


def test_a_layer_in_the_air_is_put_on_the_ground():
    mask = np.zeros((2, 2, 3), bool)
    mask[1, 0, 2] = True
    assert shapes.voxels(mask, edge=0.5).bounds.tolist() == [[0.5, 0.0, 0.0], [1.0, 0.5, 0.5]]


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.ones((2, 2)), r"mask: shape \(2, 2\) given, \(nx, ny, nz\) expected"),
        (True, r"mask: shape \(\) given"),
        (np.zeros((2, 2, 2)), "no voxel is set"),
        (np.ones((0, 2, 2), bool), "no voxel is set"),
        ([[[0, 1], [1, 2]]], r"mask\[0, 1, 1\] = .*2.*: must be a boolean, or 0 or 1"),
        ([[[0.5]]], r"mask\[0, 0, 0\]"),
        ([[[math.nan]]], r"mask\[0, 0, 0\]"),
    ],
)
def test_masks_refused(mask, message):
    with pytest.raises(ValueError, match=message):
        shapes.voxels(mask)


@pytest.mark.parametrize("make", [shapes.cube, shapes.tetrahedron, shapes.octahedron])
@pytest.mark.parametrize("name", ["edge", "mass", "stiffness"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "1"])
def test_parameters_of_single_bodies_refused(make, name, value):
    with pytest.raises(ValueError, match=f"{name} = .*: must be a finite number greater than 0"):
        make(**{name: value})


@pytest.mark.parametrize("name", ["edge", "mass_per_vertex", "stiffness"])
def test_parameters_of_lattices_refused(name):
    with pytest.raises(ValueError, match=f"{name} = 0: must be"):
        shapes.lattice(1, 1, 1, **{name: 0})
    with pytest.raises(ValueError, match=f"{name} = -2.0: must be"):
        shapes.voxels(np.ones((1, 1, 1)), **{name: -2.0})


@pytest.mark.parametrize(("n", "name"), [((0, 1, 1), "nx"), ((1, -2, 1), "ny"), ((1, 1, 0), "nz")])
def test_counts_refused(n, name):
    with pytest.raises(ValueError, match=f"{name} = .*at least 1 voxel"):
        shapes.lattice(*n)


def test_counts_that_are_not_whole_refused():
    with pytest.raises(TypeError, match=r"ny = 2.5: must be a whole number"):
        shapes.lattice(1, 2.5, 1)
