"""Robot: what it refuses, what it derives, and how it moves, spins and joins."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_springs.body.fields import FIELDS
from warp_springs.robot import Robot
from warp_springs.shapes import cube, lattice, octahedron, tetrahedron, voxels

TRIANGLE = {
    "masses": [1.0, 2.0, 3.0],
    "positions": [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
    "springs": [[0, 1], [1, 2], [2, 0]],
    "stiffness": [10.0, 20.0, 30.0],
}


def triangle(**changes):
    return Robot(**(TRIANGLE | changes))


def lively(seed=0):
    """A lattice with every field set to something of its own."""
    rng = np.random.default_rng(seed)
    body = lattice(2, 1, 1)
    m, s = body.n_masses, body.n_springs
    return body.replace(
        masses=rng.uniform(0.1, 1.0, m),
        positions=body.positions + rng.normal(0.0, 0.01, (m, 3)),
        velocities=rng.normal(size=(m, 3)),
        stiffness=rng.uniform(500.0, 5000.0, s),
        amplitude=rng.uniform(0.0, 0.02, s),
        phase=rng.uniform(0.0, 6.0, s),
        omega=5.0,
    )


def angular_momentum(robot):
    arms = robot.positions - robot.center_of_mass
    return (robot.masses[:, None] * np.cross(arms, robot.velocities)).sum(axis=0)


def inertia(robot):
    arms = robot.positions - robot.center_of_mass
    squares = (arms**2).sum(axis=1)[:, None, None] * np.eye(3)
    return (robot.masses[:, None, None] * (squares - arms[:, :, None] * arms[:, None, :])).sum(0)


# -- making one ------------------------------------------------------------------------------


def test_defaults_and_types():
    robot = triangle()
    assert robot.rest_length.tolist() == [3.0, 5.0, 4.0]
    assert not robot.velocities.any()
    assert not robot.is_actuated
    assert robot.omega == 0.0
    assert isinstance(robot.omega, float)
    assert robot.faces.shape == (0, 3)
    for name in FIELDS.keys() - {"omega", "materials"}:
        array = getattr(robot, name)
        assert array.dtype == (np.int32 if name in ("springs", "faces", "material") else np.float64)
        assert array.flags.c_contiguous


def test_numbers_are_spread_over_masses_and_springs():
    robot = triangle(masses=2, stiffness=np.float32(50.0), rest_length=1.5, amplitude=0.1, phase=1)
    assert robot.masses.tolist() == [2.0] * 3
    assert robot.stiffness.tolist() == [50.0] * 3
    assert robot.rest_length.tolist() == [1.5] * 3
    assert robot.amplitude.tolist() == [0.1] * 3
    assert robot.phase.tolist() == [1.0] * 3


def test_a_single_mass_without_springs_is_a_robot():
    robot = Robot(masses=1.0, positions=[[0, 0, 1]], springs=[], stiffness=[])
    assert (robot.n_masses, robot.n_springs, robot.diameter) == (1, 0, 0.0)
    assert robot.moved((0, 0, 1)).tension([[0, 0, 2]], 0.0).shape == (0,)


def test_unwise_bodies_are_allowed():
    robot = triangle(
        positions=np.zeros((3, 3)), springs=[[0, 1], [0, 1], [1, 0]], amplitude=9.0, stiffness=1e12
    )
    assert robot.lengths.tolist() == [0.0] * 3
    assert robot.diameter == 0.0


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("masses", [1.0, 0.0, 3.0], r"masses\[1\] = 0.0: must be finite and greater than 0 \(kg\)"),
        ("masses", -1.0, r"masses = -1.0: .*greater than 0"),
        ("masses", [1.0, 2.0, NAN], r"masses\[2\] = nan"),
        ("masses", [1.0, 2.0], r"masses: shape \(2,\) given, \(3,\) expected"),
        ("masses", None, "masses: object given, real numbers expected"),
        ("masses", "heavy", "masses: <U5 given, real numbers expected"),
        ("masses", [1.0, [2.0], 3.0], "masses: cannot be read as an array"),
        ("masses", [1j, 2j, 3j], "masses: complex128 given, real numbers expected"),
        ("positions", np.zeros((3, 2)), r"positions: shape \(3, 2\) given, \(any, 3\) expected"),
        ("positions", np.zeros(3), r"positions: shape \(3,\) given, \(any, 3\) expected"),
        ("positions", 1.0, r"positions: shape \(\) given"),
        ("positions", np.zeros((0, 3)), "at least one mass"),
        ("positions", [[0, 0, 0], [1, 0, INF], [0, 1, 0]], r"positions\[1, 2\] = inf: .*\(m\)"),
        ("velocities", np.zeros((2, 3)), r"velocities: shape \(2, 3\) given, \(3, 3\) expected"),
        ("velocities", np.full((3, 3), -INF), r"velocities\[0, 0\] = -inf: must be finite"),
        ("springs", [[0, 1], [1, 3]], r"springs\[1\] = \(1, 3\): .*two different.* 0 to 2"),
        ("springs", [[0, 1], [-1, 2]], r"springs\[1\] = \(-1, 2\)"),
        ("springs", [[0, 1], [1, 2], [2, 2]], r"springs\[2\] = \(2, 2\): must name two different"),
        ("springs", [[0.0, 1.0]], "springs: float64 given, indices"),
        ("springs", [[0, 2**32 + 1]], "springs: an index beyond 32 bits"),
        ("springs", [0, 1], r"springs: shape \(2,\) given, \(any, 2\) expected"),
        ("stiffness", [10.0, 20.0, 0.0], r"stiffness\[2\] = 0.0: .*\(N/m\)"),
        ("stiffness", INF, "stiffness = inf"),
        ("stiffness", [10.0, 20.0], r"stiffness: shape \(2,\) given, \(3,\) expected"),
        ("rest_length", [1.0, -0.1, 1.0], r"rest_length\[1\] = -0.1: must be finite and at least"),
        ("amplitude", [0.0, NAN, 0.0], r"amplitude\[1\] = nan: must be finite \(m\)"),
        ("phase", [[0.0, 0.0, 0.0]], r"phase: shape \(1, 3\) given, \(3,\) expected"),
        ("phase", NAN, "phase = nan"),
        ("omega", NAN, r"omega = nan: must be finite \(rad/s\)"),
        ("omega", [1.0, 2.0], r"omega: shape \(2,\) given, \(\) expected"),
        ("omega", [], "omega: shape"),
        ("omega", "fast", "omega: <U4 given"),
        ("faces", [[0, 1, 3]], r"faces\[0\] = \(0, 1, 3\): must name three different masses"),
        ("faces", [[0, 1, 2], [0, 2, 0]], r"faces\[1\] = \(0, 2, 0\)"),
        ("faces", [[0, 1]], r"faces: shape \(1, 2\) given, \(any, 3\) expected"),
    ],
)
def test_what_is_malformed_is_refused_by_name(field, value, message):
    given_fields = {field: value}
    if field == "springs":
        given_fields |= {"stiffness": 1.0, "rest_length": 1.0}
    with pytest.raises(ValueError, match=message):
        triangle(**given_fields)
    if value is not None:
        with pytest.raises(ValueError, match=message):
            triangle().replace(**given_fields)


def test_bad_indices_are_found_before_the_initial_lengths_are_taken():
    with pytest.raises(ValueError, match=r"springs\[0\] = \(0, 3\)"):
        triangle(springs=[[0, 3]], stiffness=1.0)


def test_initial_lengths_too_large_for_a_number_are_refused():
    with np.errstate(over="ignore"), pytest.raises(ValueError, match=r"rest_length\[0\] = inf"):
        triangle(positions=np.array(TRIANGLE["positions"]) * 1e200)


# -- a value among values --------------------------------------------------------------------


def test_nothing_can_be_changed_afterwards():
    robot = triangle(faces=[[0, 1, 2]])
    with pytest.raises(AttributeError, match="immutable"):
        robot.masses = 1.0
    with pytest.raises(AttributeError, match="immutable"):
        robot.colour = "red"
    with pytest.raises(AttributeError, match="immutable"):
        del robot.masses
    for name in FIELDS.keys() - {"omega", "materials"}:
        array = getattr(robot, name)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.setflags(write=True)


def test_inputs_are_copied():
    masses = np.ones(3)
    locked = np.ones(3)
    locked.setflags(write=False)  # whoever owns it can unlock it again
    robot = triangle(masses=masses, stiffness=locked)
    masses[0] = 5.0
    locked.setflags(write=True)
    locked[0] = 5.0
    assert robot.masses[0] == robot.stiffness[0] == 1.0
    fortran = np.asfortranarray(TRIANGLE["positions"])
    assert triangle(positions=fortran) == triangle()


def test_unchanged_arrays_are_shared():
    robot = lively()
    for changed, names in [
        (robot.moved((0, 0, 1)), {"positions"}),
        (robot.moving((0, 0, 1)), {"velocities"}),
        (robot.spinning((0, 0, 1)), {"velocities"}),
        (robot.rotated((0, 0, 1), 1.0), {"positions", "velocities"}),
        (robot.scaled(2.0), {"positions", "rest_length", "amplitude"}),
        (robot.replace(omega=1.0, stiffness=7.0), {"stiffness"}),
        (Robot(**{name: getattr(robot, name) for name in FIELDS}), set()),
    ]:
        for name in FIELDS.keys() - {"omega", "materials"}:
            assert (getattr(changed, name) is getattr(robot, name)) == (name not in names), name
    resting = cube()
    assert resting.rotated((0, 0, 1), 1.0).velocities is resting.velocities


def test_equality_hash_and_pickle():
    robot = lively()
    assert robot == lively()
    assert hash(robot) == hash(lively())
    assert robot != robot.replace(omega=6.0)
    assert robot != robot.moved((0, 0, 1e-15))
    assert robot != "robot"
    still = triangle()
    assert hash(still) == hash(triangle(velocities=-np.zeros((3, 3))))
    again = pickle.loads(pickle.dumps(robot))
    assert again == robot
    assert again.topology == robot.topology
    with pytest.raises(ValueError, match="read-only"):
        again.masses[0] = 1.0


def test_repr_is_short():
    assert repr(cube()) == "Robot(8 masses, 28 springs, 12 faces, 0.8 kg)"
    assert "actuated at 5 rad/s" in repr(lively())


def test_topology_is_masses_and_springs_in_order():
    robot = triangle()
    assert robot.topology == triangle(stiffness=1.0, amplitude=1.0, omega=3.0).topology
    assert robot.moved((1, 0, 0)).topology is robot.topology
    swapped = triangle(springs=[[1, 2], [0, 1], [2, 0]])
    turned = triangle(springs=[[1, 0], [1, 2], [2, 0]])
    positions = [*TRIANGLE["positions"], [0, 0, 1]]
    larger = triangle(masses=1.0, positions=positions)
    keys = {
        r.topology for r in (robot, swapped, turned, larger, robot.replace(springs=[[0, 1]] * 3))
    }
    assert len(keys) == 5


def test_replace_checks_what_depends_on_the_change():
    robot = triangle(faces=[[0, 1, 2]])
    with pytest.raises(TypeError, match="no field 'colour'"):
        robot.replace(colour=1)
    with pytest.raises(ValueError, match=r"stiffness: shape \(3,\) given, \(1,\) expected"):
        robot.replace(springs=[[0, 1]])
    with pytest.raises(ValueError, match=r"springs\[1\] = \(1, 2\)"):
        robot.replace(positions=np.zeros((2, 3)), masses=1.0, velocities=None)
    longer = robot.replace(positions=2.0 * robot.positions)
    assert longer.rest_length is robot.rest_length
    assert longer.replace(rest_length=None).rest_length.tolist() == [6.0, 10.0, 8.0]
    assert lively().replace(velocities=None, amplitude=None) == lively().replace(
        velocities=np.zeros((12, 3)), amplitude=0.0
    )


# -- derived quantities ----------------------------------------------------------------------


def test_mass_centre_and_bounds_by_hand():
    robot = triangle()
    assert robot.mass == 6.0
    assert robot.center_of_mass == pytest.approx([1.0, 2.0, 0.0], abs=1e-15)
    assert robot.bounds.tolist() == [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]
    assert robot.diameter == 5.0


@given(st.integers(0, 2**32), st.integers(2, 60))
@settings(max_examples=40, deadline=None)
def test_diameter_is_the_largest_distance(seed, n):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * rng.uniform(0.0, 3.0, 3) + 100.0
    robot = Robot(masses=1.0, positions=points, springs=[], stiffness=1.0)
    largest = np.linalg.norm(points[:, None] - points, axis=-1).max()
    assert robot.diameter == pytest.approx(largest, rel=1e-12)


def test_diameter_of_many_points_on_a_sphere():
    points = np.random.default_rng(0).normal(size=(1500, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    points[7] = -points[1200]
    robot = Robot(masses=1.0, positions=points, springs=[], stiffness=1.0)
    assert robot.diameter == pytest.approx(2.0, rel=1e-14)


def test_rest_length_and_tension_by_hand():
    robot = Robot(
        masses=1.0,
        positions=[[0, 0, 0], [1, 0, 0], [0, 2, 0]],
        springs=[[0, 1], [0, 2]],
        stiffness=[10.0, 100.0],
        amplitude=[0.25, 0.5],
        phase=[0.0, np.pi],
        omega=np.pi,
    )
    assert robot.is_actuated
    assert robot.rest_length_at(0.5) == pytest.approx([1.25, 1.5])
    times = np.array([0.0, 0.5, 1.5])
    lengths = robot.rest_length_at(times)
    assert lengths == pytest.approx(np.array([[1.0, 2.0], [1.25, 1.5], [0.75, 2.5]]))
    # Stretched against a short rest length: positive; squeezed against a long one: negative.
    assert robot.tension(robot.positions, 0.5) == pytest.approx([-2.5, 50.0])
    frames = np.stack([robot.positions, 2.0 * robot.positions, robot.positions])
    by_hand = [[0.0, 0.0], [10.0 * 0.75, 100.0 * 2.5], [2.5, -50.0]]
    assert robot.tension(frames, times) == pytest.approx(np.array(by_hand), abs=1e-12)
    with pytest.raises(ValueError, match=r"shape \(3, 3\) given, \(3, 3, 3\) expected"):
        robot.tension(robot.positions, times)


# -- moving ----------------------------------------------------------------------------------


def test_moved_and_moving():
    robot = lively()
    moved = robot.moved((1.0, -2.0, 3.0)).moving((0.5, 0.0, -1.0))
    assert moved.positions - robot.positions == pytest.approx(np.tile([1.0, -2.0, 3.0], (12, 1)))
    assert moved.velocities - robot.velocities == pytest.approx(np.tile([0.5, 0, -1.0], (12, 1)))
    assert moved.lengths == pytest.approx(robot.lengths, rel=1e-12)


def test_rotation_by_hand():
    robot = triangle(velocities=[[1.0, 0.0, 0.0]] * 3)
    turned = robot.rotated((0, 0, 9.0), math.pi / 2, about=(0, 0, 5.0))
    assert turned.positions == pytest.approx(
        np.array([[0, 0, 0], [0, 3, 0], [-4, 0, 0]]), abs=1e-15
    )
    assert turned.velocities == pytest.approx(np.array([[0, 1, 0]] * 3), abs=1e-15)
    around = robot.rotated((1, 1, 1), 2.0 * math.pi / 3.0, about=(0, 0, 0))  # x -> y -> z -> x
    assert around.positions == pytest.approx(np.roll(robot.positions, 1, axis=1), abs=1e-14)


@given(
    st.tuples(*[st.floats(-5.0, 5.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-3),
    st.floats(-10.0, 10.0),
)
@settings(max_examples=40, deadline=None)
def test_rotation_preserves_shape_and_energy(axis, angle):
    robot = lively()
    turned = robot.rotated(axis, angle)
    assert turned.center_of_mass == pytest.approx(robot.center_of_mass, abs=1e-14)
    assert turned.lengths == pytest.approx(robot.lengths, rel=1e-12)
    speeds = np.linalg.norm(robot.velocities, axis=1)
    assert np.linalg.norm(turned.velocities, axis=1) == pytest.approx(speeds, rel=1e-12)
    offset = (robot.positions - robot.center_of_mass) @ axis
    assert (turned.positions - turned.center_of_mass) @ axis == pytest.approx(offset, abs=1e-13)
    back = turned.rotated(axis, -angle)
    assert back.positions == pytest.approx(robot.positions, abs=1e-14)


def test_scaled():
    robot = lively()
    larger = robot.scaled(3.0)
    assert larger.lengths == pytest.approx(3.0 * robot.lengths, rel=1e-14)
    assert larger.rest_length_at(0.3) == pytest.approx(3.0 * robot.rest_length_at(0.3), rel=1e-14)
    assert cube().scaled(2.0).bounds[0].tolist() == [0.0, 0.0, 0.0]


def test_spinning_is_a_rigid_rotation():
    w = np.array([3.0, -2.0, 4.0])
    robot = lively().replace(velocities=None)
    spun = robot.spinning(w)
    momentum = spun.masses @ spun.velocities
    assert momentum == pytest.approx(np.zeros(3), abs=1e-14)
    assert angular_momentum(spun) == pytest.approx(inertia(robot) @ w, rel=1e-12)
    i, j = robot.springs.T
    rate = (
        (spun.positions[j] - spun.positions[i]) * (spun.velocities[j] - spun.velocities[i])
    ).sum(axis=1)
    assert rate == pytest.approx(np.zeros(robot.n_springs), abs=1e-15)
    faster = lively().moving((1, 2, 3)).spinning(w)
    assert faster.masses @ faster.velocities == pytest.approx(
        lively().masses @ lively().velocities + lively().mass * np.array([1, 2, 3]), rel=1e-12
    )


def test_turning_a_spin_equals_spinning_about_the_turned_axis():
    robot = lively().replace(velocities=None)
    one = robot.spinning((0, 0, 2.0)).rotated((0, 1, 0), math.pi / 2)
    two = robot.rotated((0, 1, 0), math.pi / 2).spinning((2.0, 0, 0))
    assert one.velocities == pytest.approx(two.velocities, abs=1e-14)


@pytest.mark.parametrize(
    ("verb", "message"),
    [
        (lambda r: r.moved((0, 1)), r"offset = \(0, 1\): must be three finite numbers"),
        (lambda r: r.moved((0, 1, NAN)), "offset"),
        (lambda r: r.moving((0, INF, 0)), "velocity"),
        (lambda r: r.spinning(3.0), "angular_velocity"),
        (lambda r: r.rotated((0, 0, 0), 1.0), "axis = .*needs a direction"),
        (lambda r: r.rotated((0, 0, 1), NAN), "angle = nan"),
        (lambda r: r.rotated((0, 0, 1), 1.0, about=(1, 2)), "about"),
        (lambda r: r.scaled(0.0), "factor = 0.0"),
        (lambda r: r.scaled(-1.0), "factor = -1.0"),
        (lambda r: r.joined(r, merge=True, tolerance=-1.0), "tolerance = -1.0"),
    ],
)
def test_verbs_refuse_nonsense(verb, message):
    with pytest.raises(ValueError, match=message):
        verb(triangle())


# -- joining ---------------------------------------------------------------------------------


def content(robot, edge=0.1):
    """Masses, springs and faces of a voxel body, by place instead of by index."""
    place = [tuple(p) for p in np.rint(robot.positions / edge).astype(int).tolist()]
    masses = dict(zip(place, robot.masses.tolist(), strict=True))
    springs = sorted(
        (*sorted((place[i], place[j])), round(length, 9), k)
        for (i, j), length, k in zip(
            robot.springs.tolist(), robot.rest_length, robot.stiffness.tolist(), strict=True
        )
    )
    faces = []
    for face in robot.faces.tolist():
        corners = [place[i] for i in face]
        first = corners.index(min(corners))
        faces.append(tuple(corners[first:] + corners[:first]))
    return masses, springs, sorted(faces)


def test_joined_without_merging_keeps_everything():
    one, two = lively(1), lively(2).moved((5, 0, 0))
    both = one.joined(two)
    assert both.mass == pytest.approx(one.mass + two.mass)
    assert both.springs.tolist() == [*one.springs.tolist(), *(two.springs + 12).tolist()]
    assert both.faces.tolist() == [*one.faces.tolist(), *(two.faces + 12).tolist()]
    for name in ("masses", "positions", "velocities", "stiffness", "amplitude", "phase"):
        parts = [getattr(one, name), getattr(two, name)]
        assert np.array_equal(getattr(both, name), np.concatenate(parts))
    assert both.omega == 5.0
    assert cube().joined(cube()).n_masses == 16


def test_merging_two_voxels_gives_the_body_of_two_voxels():
    one = cube()
    both = one.joined(one.moved((0.1, 0, 0)), merge=True)
    assert (both.n_masses, both.n_springs, len(both.faces)) == (12, 50, 20)
    assert content(both) == content(voxels(np.ones((2, 1, 1))))


@given(st.integers(1, 2**12 - 1))
@settings(max_examples=30, deadline=None)
def test_any_voxel_body_can_be_joined_from_cubes(bits):
    mask = np.array([bits >> i & 1 for i in range(12)]).reshape(3, 2, 2)
    cells = np.argwhere(mask)
    cells[:, 2] -= cells[:, 2].min()
    body, *others = (cube().moved(0.1 * cell) for cell in cells)
    for other in others:
        body = body.joined(other, merge=True)
    assert content(body) == content(voxels(mask))


def test_bodies_of_any_orientation_merge():
    whole = lattice(2, 1, 1).rotated((1, 2, 3), 0.7, about=(0, 0, 0))
    parts = [cube().moved((x, 0, 0)).rotated((1, 2, 3), 0.7, about=(0, 0, 0)) for x in (0, 0.1)]
    both = parts[0].joined(parts[1], merge=True)
    assert (both.n_masses, both.n_springs, len(both.faces)) == (12, 50, 20)
    assert np.sort(both.positions, axis=0) == pytest.approx(np.sort(whole.positions, axis=0))


def test_merged_masses_keep_the_first_place_and_the_larger_mass():
    light = triangle(velocities=np.ones((3, 3)))
    heavy = triangle(masses=[5.0, 1.0, 3.5], stiffness=99.0).moved((1e-10, 0, 0))
    both = light.joined(heavy, merge=True)
    assert both.masses.tolist() == [5.0, 2.0, 3.5]
    assert np.array_equal(both.positions, light.positions)
    assert np.array_equal(both.velocities, light.velocities)
    assert both.stiffness.tolist() == [10.0, 20.0, 30.0]
    assert light.joined(heavy, merge=True, tolerance=1e-11).n_masses == 6
    assert light.joined(light, merge=True, tolerance=0.0) == light
    assert light.joined(heavy, merge=False).n_masses == 6


def test_a_mass_merges_with_the_nearest_and_collapsed_parts_vanish():
    points = Robot(masses=1.0, positions=[[0, 0, 0], [1, 0, 0]], springs=[[0, 1]], stiffness=1.0)
    small = tetrahedron(edge=0.1).moved((0.9, 0, 0))
    both = points.joined(small, merge=True, tolerance=0.3)
    assert both.n_masses == 2
    assert both.springs.tolist() == [[0, 1]]
    assert len(both.faces) == 0


def test_both_windings_cancel_and_equal_faces_stay_once():
    front = triangle(faces=[[0, 1, 2]])
    back = triangle(faces=[[2, 1, 0]])
    assert len(front.joined(back, merge=True).faces) == 0
    assert len(front.joined(back, merge=False).faces) == 2
    assert front.joined(triangle(faces=[[1, 2, 0]]), merge=True).faces.tolist() == [[0, 1, 2]]


def test_of_duplicates_inside_one_body_only_springs_are_merged():
    doubled = Robot(
        masses=1.0,
        positions=[[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]],
        springs=[[0, 2], [2, 0], [1, 2]],
        stiffness=[1.0, 2.0, 3.0],
        faces=[[0, 2, 3], [2, 3, 0]],
    )
    apart = doubled.joined(doubled.moved((5, 0, 0)), merge=True)
    assert (apart.n_masses, len(apart.faces)) == (8, 4)
    assert apart.springs.tolist() == [[0, 2], [1, 2], [4, 6], [5, 6]]
    assert apart.stiffness.tolist() == [1.0, 3.0, 1.0, 3.0]
    # One mass of the first takes in both of the second's that coincide with it.
    assert triangle().joined(doubled, merge=True, tolerance=0.0).n_masses == 5


def test_joined_robots_share_one_omega():
    still = triangle(omega=7.0)  # not actuated: its omega means nothing
    slow, fast = triangle(amplitude=0.1, omega=2.0), triangle(amplitude=0.1, omega=3.0)
    with pytest.raises(ValueError, match=r"omega: 2.0 rad/s and 3.0 rad/s given.*both"):
        slow.joined(fast)
    assert slow.joined(slow).omega == 2.0
    assert slow.joined(still).omega == still.joined(slow).omega == 2.0


def test_joined_shapes_of_another_kind():
    both = octahedron().joined(tetrahedron(), merge=True)  # they share the triangle they stand on
    assert (both.n_masses, both.n_springs) == (7, 15 + 6 - 3)
