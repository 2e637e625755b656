"""Wind, water and obstacles against their closed forms."""

import numpy as np
import pytest

import warp_springs as ws

POINT = ws.Robot(
    masses=[0.1],
    positions=[(0, 0, 0)],
    springs=np.empty((0, 2), int),
    stiffness=[],
)
INTEGRATORS = ("chin4", "leapfrog", "euler")


def run(robot, duration, integrator="chin4", dt=5e-4, fps=20, **scene):
    scene = ws.Scene(**({"ground": None} | scene))
    simulation = ws.Simulation(robot, scene, dt=dt, integrator=integrator)
    return simulation.run(duration, fps=fps, energy=True)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_falls_with_its_terminal_speed_relative_to_the_wind(integrator):
    result = run(POINT, 8.0, integrator, 1e-3, drag=0.05, wind=(3.0, 0.0, 1.0))
    terminal = np.sqrt(0.1 * 9.81 / 0.05)
    # Without a force along the wind, a mass takes its speed on, ever more slowly.
    assert result.velocities(0)[0, 2] == pytest.approx(1.0 - terminal, rel=2e-3)
    assert result.velocities(0)[0, 0] == pytest.approx(3.0, abs=1e-6)
    assert np.abs(result.energy.residual).max() < 1e-3 * result.energy.drag_loss.max()


@pytest.mark.parametrize(("density", "direction"), [(0.4, -1.0), (1.6, 1.0)])
def test_what_is_immersed_sinks_or_rises_with_its_terminal_speed(density, direction):
    water = ws.Water(level=100.0, density=density, drag=0.3)
    result = run(POINT, 3.0, water=water)
    expected = direction * np.sqrt(0.1 * 9.81 * 0.6 / 0.3)
    assert result.velocities(0)[0, 2] == pytest.approx(expected, rel=1e-6)
    assert np.abs(result.energy.residual).max() < 1e-6


def test_a_float_bobs_with_the_frequency_of_its_layer():
    # Half immersed it is in balance; in the layer the lift grows by 2 m g a layer.
    water = ws.Water(level=1.0, density=2.0, layer=0.1)
    period = 2 * np.pi / np.sqrt(2 * 9.81 / 0.1)
    result = run(POINT.moved((0, 0, 1.03)), period, dt=period / 400, fps=8 / period, water=water)
    heights = result.frames(0)[:, 0, 2] - 1.0
    assert heights == pytest.approx(0.03 * np.cos(np.arange(9) * np.pi / 4), abs=1e-6)
    assert np.abs(result.energy.residual).max() < 1e-7


def slope(angle, **friction):
    """A ramp, and the direction downhill."""
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    return ws.Plane(tuple(normal), **friction), -np.array([np.cos(angle), 0.0, np.sin(angle)])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_on_a_ramp_sticks_below_the_angle_of_friction_and_slides_above(integrator):
    for angle in (0.2, 0.5):
        plane, down = slope(angle, static_friction=0.4, kinetic_friction=0.3)
        sunk = 0.1 * 9.81 * np.cos(angle) / plane.stiffness  # where the ramp carries it
        start = POINT.moved(-sunk * np.array(plane.normal))
        result = run(start, 1.0, integrator, obstacles=plane)
        way = (result.positions(0)[0] - start.positions[0]) @ down
        slides = np.tan(angle) > 0.4
        expected = 9.81 * (np.sin(angle) - 0.3 * np.cos(angle)) / 2 if slides else 0.0
        assert way == pytest.approx(expected, rel=2e-3, abs=1e-12)
        speed = result.velocities(0)[0] @ down
        assert speed == pytest.approx(2 * expected, rel=2e-3, abs=1e-12)
        energy = result.energy
        lost = 0.3 * 0.1 * 9.81 * np.cos(angle) * expected
        assert energy.friction_loss[0, -1] == pytest.approx(lost, rel=2e-3, abs=1e-12)
        assert np.abs(energy.residual).max() < 1e-3


WEDGES = {
    "edge": ((-4, 0, -8), [(0, 0, 1), (1, 0, 0)]),
    "corner": ((-4, -4, -8), [(0, 0, 1), (1, 0, 0), (0, 1, 0)]),
    "valley": ((0, 0, -9.81), [(1, 0, 1), (-1, 0, 1)]),
}


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog"])
@pytest.mark.parametrize("wedge", WEDGES)
def test_what_rests_against_several_surfaces_rests(cube, wedge, integrator):
    # Friction of one surface must not take, or give, what another pushes along it.
    gravity, normals = WEDGES[wedge]
    if wedge == "valley":
        cube = cube.moved(-cube.center_of_mass).rotated((0, 1, 0), np.pi / 4)
        cube = cube.moved((0, 0, -cube.bounds[0, 2]))
    planes = [ws.Plane(normal) for normal in normals]
    for dt in (5e-4, 1.4e-3):  # the latter is nine tenths of the stable step in a corner
        options = {"dt": dt, "gravity": gravity, "obstacles": planes, "integrator": integrator}
        laid = cube.replace(positions=run(cube, 3.0, damping=20.0, **options).positions(0))
        result = run(laid, 20.0, **options)
        assert result.status[0] == ws.Status.OK
        assert np.abs(result.frames(0) - result.frames(0)[0]).max() < 1e-8
        assert np.abs(result.energy.residual).max() < 1e-5  # J; 0.8 J lift it by an edge
        assert result.energy.kinetic.max() < 1e-5


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_slides_along_a_groove_as_far_as_both_its_sides_let_it(integrator):
    sides = [ws.Plane((x, 0, 1), static_friction=0.6, kinetic_friction=0.4) for x in (1, -1)]
    start = POINT.moved((0, 0, -0.1 * 9.81 / 1e5)).moving((0, 2.0, 0))
    result = run(start, 2.0, integrator, 2e-4, obstacles=sides)
    expected = 2.0**2 / (2 * np.sqrt(2) * 0.4 * 9.81)
    assert result.positions(0)[0, 1] == pytest.approx(expected, rel=1e-3)
    assert result.energy.friction_loss[0, -1] == pytest.approx(0.2, rel=1e-4)


def test_a_ramp_as_an_obstacle_is_the_ground_under_a_tilted_gravity(cube):
    angle = 0.4
    plane, _ = slope(angle, static_friction=0.6, kinetic_friction=0.3)
    back = {"axis": (0, 1, 0), "angle": angle, "about": (0, 0, 0)}
    level = cube.moved((0, 0, 0.02)).spinning((1, 2, 3))
    tilted = level.rotated(axis=(0, 1, 0), angle=-angle, about=(0, 0, 0))
    on_ramp = run(tilted, 0.5, dt=2e-4, obstacles=plane)
    gravity = (-9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    ground = ws.Ground(static_friction=0.6, kinetic_friction=0.3)
    on_ground = run(level, 0.5, dt=2e-4, gravity=gravity, ground=ground)
    seen = tilted.replace(positions=on_ramp.positions(0)).rotated(**back).positions
    # Not the same steps: gravity is in the kicks there, in the drifts here.
    assert seen == pytest.approx(on_ground.positions(0), abs=2e-4)


def test_a_ball_throws_a_mass_back_as_hard_as_it_came():
    ball = ws.Sphere((0, 0, 0), 0.5, static_friction=0.0, kinetic_friction=0.0)
    tip = np.array([0.6, 0.0, 0.8])
    start = POINT.moved(0.7 * tip).moving(-2.0 * tip)
    result = run(start, 0.3, gravity=(0, 0, 0), obstacles=ball)
    assert result.velocities(0)[0] == pytest.approx(2.0 * tip, abs=1e-3)
    assert np.abs(result.energy.residual).max() < 1e-4
    # Contact lasts half a period of the surface's spring, in which the mass would have gone on.
    there = 0.5 + 2.0 * (0.3 - 0.1 - np.pi * np.sqrt(0.1 / 1e5))
    assert np.linalg.norm(result.positions(0)[0]) == pytest.approx(there, abs=1e-3)


def test_a_box_carries_what_stands_on_it_and_stops_what_comes_from_the_side(cube):
    box = ws.Box((0, 0, 0.25), (0.4, 0.4, 0.5), axis=(0, 0, 1), angle=0.3)
    on_top = cube.moved((-0.05, -0.05, 0.5))
    against = POINT.moved((1.0, 0.0, 0.3)).moving((-3.0, 0.0, 0.0))
    scene = ws.Scene(obstacles=box, damping=10.0)
    result = ws.Simulation([on_top, against], scene, dt=5e-4).run(1.0)
    assert np.abs(result.positions(0) - on_top.positions).max() < 2e-3
    assert result.positions(1)[0, 0] > 0.19
    assert result.velocities(0) == pytest.approx(np.zeros((8, 3)), abs=0.02)


def test_terrain_is_what_its_table_says():
    x, y = np.meshgrid(np.arange(9) * 0.25, np.arange(5) * 0.25, indexing="ij")
    field = ws.HeightField(0.3 * x - 0.1 * y, 0.25, origin=(-1.0, -0.5, 0.2), static_friction=2.0)
    normal = np.array([-0.3, 0.1, 1.0]) / np.sqrt(1.1)
    plane = ws.Plane(tuple(normal), normal @ (-1.0, -0.5, 0.2), static_friction=2.0)
    start = POINT.moved((0.1, 0.0, 0.8)).moving((0.2, -0.1, 0.0))
    rough, flat = (run(start, 0.5, obstacles=surface) for surface in (field, plane))
    assert rough.positions(0) == pytest.approx(flat.positions(0), abs=1e-9)
    # A bump and the flat rim: a mass rests where it is put.
    bump = np.zeros((3, 3))
    bump[1, 1] = 0.1
    terrain = ws.HeightField(bump, 1.0)
    for place, height in (((1.0, 1.0), 0.1), ((1.5, 1.0), 0.05), ((7.0, -3.0), 0.0)):
        rests = run(POINT.moved((*place, height)), 0.2, obstacles=terrain, damping=50.0)
        assert rests.positions(0)[0, 2] == pytest.approx(height, abs=1e-4)


def test_robots_of_one_topology_and_lone_ones_meet_obstacles_alike(cube):
    stones = (ws.Sphere((0.05, 0.05, -0.1), 0.2), ws.Box((0.3, 0, 0), (0.2, 0.2, 0.2)))
    scene = ws.Scene(obstacles=stones, water=ws.Water(0.1, drag=0.1), drag=0.01, wind=(1, 0, 0))
    body = cube.moved((0, 0, 0.25)).spinning((1, 2, 3))
    alone = ws.Simulation(body, scene, dt=5e-4).run(0.5)
    crowd = ws.Simulation([body] * 9, scene, dt=5e-4).run(0.5)
    assert np.array_equal(alone.positions(0), crowd.positions(3))
    assert np.array_equal(alone.positions(0), crowd.positions(8))
    assert crowd.status.tolist() == [0] * 9


def test_what_is_far_inside_an_obstacle_is_stopped():
    inside = POINT.moved((0, 0, -3.0))
    result = ws.Simulation(inside, ws.Scene(ground=None, obstacles=ws.Plane()), dt=1e-4).run(0.1)
    assert result.status[0] == ws.Status.TOO_DEEP


def test_the_classrooms_friction_is_for_a_flat_ground_alone():
    with pytest.raises(ValueError, match="flat ground alone"):
        ws.Scene(ground=ws.Ground(friction="course"), obstacles=ws.Plane())


def test_hills_are_the_sum_of_their_waves():
    waves = [(0.8, 0.3, 1.0, 1.0), (1.6, 2.0, 0.0, 0.5)]
    field = ws.hills(waves, height=0.2, size=2.0, spacing=0.1)
    assert field.heights.max() == 0.0 and field.heights.min() == pytest.approx(-0.2)
    x, y = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21), indexing="ij")
    shape = sum(
        weight * long * np.sin(2 * np.pi * (x * np.cos(turn) + y * np.sin(turn)) / long + phase)
        for long, turn, phase, weight in waves
    )
    steps = np.diff(field.heights.ravel()) / np.diff(shape.ravel())
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    assert field.origin == (-1.0, -1.0, 0.0)


def test_rough_terrain_follows_from_its_seed():
    one, again, other = (ws.rough_terrain(seed, height=0.1) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.heights, again.heights)
    assert np.abs(one.heights - other.heights).max() > 0.02
    with pytest.raises(ValueError, match="shorter than two grid points"):
        ws.rough_terrain(1, feature=0.15)
