"""The data of a robot's elements: verbs, validation, joining, moving, variants."""

import pickle

import numpy as np
import pytest

import warp_springs as ws

RNG = np.random.default_rng(5)


@pytest.fixture
def full(cube):
    """A cube with one of everything."""
    return (
        cube.breathing(0.2, omega=6.0)
        .with_harmonics([0.01, 0.02], [0.5, 1.0], springs=range(4))
        .with_omegas(9.0, springs=[2])
        .with_cables([3])
        .with_hardening(1e6, [4, 5])
        .with_dashpots(0.1)
        .with_limits(breaks=50.0, springs=[6])
        .with_limits(yields=2e6, area=1e-5, springs=[7])
        .with_stiffness_in_time([0.0, 1.0], [1.0, 2.0], [8])
        .with_winch([0.0, 0.5], [0.0, -0.02], [3])
        .pushed([0], (1, 2, 3), start=0.1, duration=0.2)
        .tethered(1, 100.0, start=0.5, end=0.75)
        .fixed(2)
        .fixed(3, axes="x")
        .held_to(ws.Sphere((0, 0, 1), 0.5), 4)
        .shod([5], static_friction=0.2, kinetic_friction=0.1)
    )


def test_a_plain_robot_has_none_and_equals_itself_without(cube):
    assert cube.elements == ws.Elements()
    assert cube.moved((1, 0, 0)).elements is cube.elements
    assert cube.joined(cube).elements is cube.elements
    assert cube.pushed([0], (1, 0, 0)) != cube


def test_elements_are_part_of_a_robots_value(full):
    copy = pickle.loads(pickle.dumps(full))
    assert copy == full and hash(copy) == hash(full)
    assert copy.with_dashpots(0.2) != full
    assert "pushes" in repr(full.elements)
    with pytest.raises(ValueError, match="read-only"):
        full.elements.dashpot[0] = 1.0


def test_curve_is_the_integral_of_its_stiffness(cube):
    robot = cube.with_curve([-0.01, 0.0, 0.02], [2.0, 0.5, 1.0, 3.0]).with_hardening(5e5)
    positions = robot.positions * 1.3
    stretch = (robot.lengths * 1.3) - robot.rest_length
    part = [
        np.trapezoid(_steps(np.linspace(0, s, 20001)), np.linspace(0, s, 20001)) for s in stretch
    ]
    expected = robot.stiffness * part + 5e5 * stretch**3
    assert robot.tension(positions, 0.0) == pytest.approx(expected, rel=1e-4)


def _steps(s):
    return np.select([s < -0.01, s < 0.0, s < 0.02], [2.0, 0.5, 1.0], 3.0)


def test_cables_only_pull(cube):
    robot = cube.with_cables()
    assert robot.tension(robot.positions * 0.9, 0.0) == pytest.approx(np.zeros(28))
    assert robot.tension(robot.positions * 1.1, 0.0) == pytest.approx(
        cube.tension(cube.positions * 1.1, 0.0)
    )


def test_rest_length_with_harmonics_own_omegas_and_a_winch(full):
    t = 0.3
    a = full.amplitude[2]
    expected = full.rest_length[2] + a * np.sin(9 * t)
    expected += 0.01 * np.sin(2 * 9 * t + 0.5) + 0.02 * np.sin(3 * 9 * t + 1.0)
    assert full.rest_length_at(t)[2] == pytest.approx(expected)
    times = np.array([0.0, 0.25, 9.0])
    winch = (
        full.rest_length_at(times)[:, 3]
        - full.with_winch([0, 1], [0, 0], [3]).rest_length_at(times)[:, 3]
    )
    assert winch == pytest.approx([0.0, -0.01, -0.02])


def test_stiffness_in_time_interpolates_and_repeats(cube):
    robot = cube.with_stiffness_in_time([0.0, 1.0, 2.0], [1.0, 3.0, 1.0], [0], period=2.0)
    ratio = robot.tension(np.tile(cube.positions * 1.1, (4, 1, 1)), np.array([0, 0.5, 1, 3.0]))
    plain = cube.tension(cube.positions * 1.1, 0.0)
    assert ratio[:, 0] / plain[0] == pytest.approx([1, 2, 3, 3])
    assert ratio[:, 1] / plain[1] == pytest.approx(np.ones(4))


def test_elements_of_no_spring_change_nothing(cube):
    none = np.zeros(0, np.int64)
    robot = cube.with_winch([0, 1], [0, 1], none).with_stiffness_in_time([0, 1], [1, 2], none)
    robot = robot.with_cables(none).with_dashpots(0.1, none).with_harmonics([0.1], [0.0], none)
    assert robot.tension(cube.positions * 1.1, 0.5) == pytest.approx(
        cube.tension(cube.positions * 1.1, 0.5)
    )


def test_waveform_fits_and_states_its_error():
    square = ws.Waveform.fit(lambda x: np.sign(np.sin(x)), harmonics=9)
    odd = 4 / np.pi / np.arange(1, 10, 2)
    assert square.amplitudes[::2] == pytest.approx(odd, rel=1e-3)
    assert square.amplitudes[1::2] == pytest.approx(np.zeros(4), abs=1e-3)
    assert 0.5 < square.error <= 1.2  # a jump cannot be met
    table = 0.3 + 0.2 * np.sin(2 * np.pi * np.arange(4096) / 4096 + 0.4)
    exact = ws.Waveform.fit(table, harmonics=2)
    assert (exact.mean, exact.amplitudes[0], exact.phases[0]) == pytest.approx((0.3, 0.2, 0.4))
    assert exact.error < 1e-6
    with pytest.raises(ValueError, match="17 values or more"):
        ws.Waveform.fit(np.zeros(16))


def test_a_robot_follows_its_waveform(cube):
    wave = ws.Waveform.fit(lambda x: 0.1 * np.exp(np.sin(x)) - 0.1, harmonics=6)
    robot = cube.with_waveform(wave, omega=3.0)
    t = np.linspace(0, 3, 7)
    expected = cube.rest_length * (1 + wave(3 * t)[:, None])
    assert robot.rest_length_at(t) == pytest.approx(expected, rel=1e-12)
    assert wave.error < 1e-6


def test_what_moves_with_the_body(full):
    moved = full.moved((1, 2, 3)).rotated((0, 0, 1), np.pi / 2, about=(0, 0, 0))
    assert moved.elements.pushes[0].force == pytest.approx((-2, 1, 3))
    point = np.add(full.elements.tethers[0].point, (1, 2, 3))
    assert moved.elements.tethers[0].point == pytest.approx((-point[1], point[0], point[2]))
    # v_x = 0 became v_y = 0.
    assert np.diag(moved.elements.bonds.projectors[1]) == pytest.approx((1, 0, 1))
    assert moved.elements.bonds.points[2] == pytest.approx((-2, 1, 4))
    grown = full.scaled(2.0)
    assert grown.elements.bonds.radii[2] == pytest.approx(1.0)
    assert grown.elements.harmonics[0, :, 0] == pytest.approx((0.02, 0.04))
    assert grown.elements.harmonics[0, :, 1] == pytest.approx((0.5, 1.0))


def test_held_masses_are_put_on_their_shapes(cube):
    robot = cube.moving((1, 1, 1)).held_to(ws.Circle((0, 0, 0.5), (0, 0, 1), 0.3), [7])
    x, v = robot.positions[7], robot.velocities[7]
    assert x == pytest.approx((0.3 / np.sqrt(2), 0.3 / np.sqrt(2), 0.5))
    assert v == pytest.approx((0, 0, 0), abs=1e-15)  # (1, 1, 1) is radial and vertical there
    plane = cube.held_to(ws.Plane((1, 2, 2), 3.0), [0])
    assert plane.positions[0] @ (1, 2, 2) == pytest.approx(3.0)
    line = cube.moving((0, 3, 4)).held_to(ws.Line((1, 0, 0), (0, 0, 2)), [6])
    assert line.positions[6] == pytest.approx((1, 0, cube.positions[6, 2]))
    assert line.velocities[6] == pytest.approx((0, 0, 4))


def test_two_constraints_of_one_mass_meet(cube):
    circle = cube.held_to(ws.Sphere((0, 0, 0), 0.5), 7).held_to(ws.Plane((0, 0, 1), 0.3), 7)
    bonds = circle.elements.bonds
    assert bonds.radii == pytest.approx([0.4]) and bonds.points[0] == pytest.approx((0, 0, 0.3))
    assert circle.positions[7, 2] == pytest.approx(0.3)
    line = cube.held_to(ws.Plane((1, 0, 0), 0.2), 0).held_to(ws.Plane((0, 1, 0), 0.1), 0)
    assert line.elements.bonds.projectors[0] == pytest.approx(np.diag([0, 0, 1]), abs=1e-12)
    with pytest.raises(ValueError, match="no point in common"):
        cube.held_to(ws.Plane((1, 0, 0), 0.2), 0).held_to(ws.Plane((1, 0, 0), 0.3), 0)
    with pytest.raises(ValueError, match="already"):
        circle.held_to(ws.Sphere((0, 0, 0), 0.6), 7)


def test_joined_bodies_keep_their_elements(full, cube):
    both = cube.joined(full.moved((1, 0, 0)))
    e = both.elements
    assert e.dashpot[:28] == pytest.approx(np.zeros(28)) and np.all(e.dashpot[28:] == 0.1)
    assert np.all(np.isinf(e.breaks[:28])) and e.breaks[34] == 50.0
    assert e.pushes[0].masses == (8,) and e.tethers[0].mass == 9
    assert e.bonds.masses.tolist() == [10, 11, 12]
    assert e.timetable.factors[36].tolist()[-1] == 2.0 and np.all(e.timetable.factors[:36] == 1.0)
    assert e.contact[13, 0] == 0.2 and np.isnan(e.contact[5, 0])
    assert both.tension(both.positions * 1.1, 0.4)[28:] == pytest.approx(
        full.moved((1, 0, 0)).tension(full.moved((1, 0, 0)).positions * 1.1, 0.4)
    )
    shifted = cube.moved((0.1, 0, 0)).fixed()  # four of its masses become the cube's
    bonds = cube.joined(shifted, merge=True).elements.bonds
    assert len(bonds) == 8 and bonds.masses.max() == 11
    assert cube.joined(shifted, merge=True).positions[bonds.masses] == pytest.approx(bonds.points)


def test_variants_may_differ_in_their_elements(full):
    ratios = RNG.uniform(0, 1, (5, 28))
    waves = RNG.uniform(0, 0.01, (5, 28, 2, 2))
    many = full.variants(dashpot=ratios, harmonics=waves)
    assert np.all(many[3].elements.dashpot == ratios[3])
    assert np.all(many[1:3][1].elements.harmonics == waves[2])
    assert many[3].elements.pushes == full.elements.pushes
    assert many[0].elements.structure == many[4].elements.structure
    with pytest.raises(ValueError, match=r"dashpot: shape .* rows of \(28,\) expected"):
        full.variants(dashpot=np.zeros((5, 3)))


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda c: c.with_dashpots(-0.1), r"dashpot\[0\] = -0.1"),
        (lambda c: c.with_hardening([1.0, 2.0]), "cubic: shape"),
        (lambda c: c.with_limits(breaks=0.0), "greater than 0"),
        (lambda c: c.with_cables([28]), "indices of 28 springs"),
        (lambda c: c.with_cables([0.5]), "expected indices or 28 bools"),
        (lambda c: c.with_curve([1, 0], [1, 1, 1]), "increasing"),
        (lambda c: c.with_curve([0], [1]), "2 parts"),
        (lambda c: c.with_winch([0, 0], [1, 1]), "times"),
        (lambda c: c.with_winch([0, 1], [1, 1, 1]), "offsets: shape"),
        (lambda c: c.with_stiffness_in_time([0, 1], [1, -1]), "negative"),
        (lambda c: c.pushed([8], (1, 0, 0)), "indices of 8 masses"),
        (lambda c: c.pushed([0], (1, 0)), "force"),
        (lambda c: c.pushed([0], (1, 0, 0), duration=0.0), "duration"),
        (lambda c: c.tethered([0], -1.0), "stiffness"),
        (lambda c: c.tethered([0], 1.0, start=1.0, end=0.5), "end"),
        (lambda c: c.fixed(axes="w"), "axes"),
        (lambda c: c.fixed([0]).replace(positions=c.positions[:4], masses=1.0), "springs"),
        (lambda c: c.shod(static_friction=-1.0), "static_friction"),
        (lambda c: ws.Plane((0, 0, 0)), "must not be zero"),
        (lambda c: ws.Sphere((0, 0, 0), -1.0), "radius"),
        (lambda c: ws.Box((0, 0, 0), (1, 1, 0)), "size"),
        (lambda c: ws.HeightField(np.zeros(4), 1.0), "at least 2 by 2"),
        (lambda c: ws.Scene(wind=(1, 0, 0)), "without drag"),
        (lambda c: ws.Water(layer=0.0), "layer"),
    ],
)
def test_malformed_elements_are_refused(cube, do, says):
    with pytest.raises(ValueError, match=says):
        do(cube)


def test_wrong_kinds_are_refused(cube):
    with pytest.raises(TypeError, match="Plane, Line, Circle or Sphere"):
        cube.held_to(3)
    with pytest.raises(TypeError, match=r"obstacles\[0\]"):
        ws.Scene(obstacles=(ws.Circle((0, 0, 0), (0, 0, 1), 1.0),))
    with pytest.raises(TypeError, match="Elements"):
        cube.replace(elements=3)
    assert ws.Scene(obstacles=ws.Plane()).obstacles == (ws.Plane(),)


def test_height_map_reads_a_picture(tmp_path):
    from PIL import Image

    path = tmp_path / "hill.png"
    Image.fromarray(np.array([[0, 255, 0], [0, 51, 0]], np.uint8)).save(path)
    heights = ws.height_map(path, -1.0, 1.0)
    assert heights.shape == (3, 2)
    assert heights[1] == pytest.approx([-0.6, 1.0])  # the upper edge is at the largest y
    with pytest.raises(ValueError, match="cannot be read as a picture"):
        ws.height_map(tmp_path / "none.png", 0, 1)
