"""Pushes, tethers, constraints and skins of single masses against their closed forms."""

import numpy as np
import pytest

import warp_springs as ws

POINT = ws.Robot(
    masses=[0.1],
    positions=[(0, 0, 0)],
    springs=np.empty((0, 2), int),
    stiffness=[],
)
WEIGHTLESS = ws.Scene(gravity=(0, 0, 0), ground=None)
FREE = ws.Scene(ground=None)
INTEGRATORS = ("chin4", "leapfrog", "euler")


def run(robot, scene, duration, integrator="chin4", dt=1e-3, fps=50, energy=True):
    simulation = ws.Simulation(robot, scene, dt=dt, integrator=integrator)
    return simulation.run(duration, fps=fps, energy=energy)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_push_gives_its_impulse_whatever_the_step(integrator):
    pushed = POINT.pushed([0], (1, 2, 3), start=0.0123456, duration=0.0777)
    result = run(pushed, WEIGHTLESS, 0.2, integrator)
    assert result.velocities(0)[0] == pytest.approx(np.array((1, 2, 3)) * 0.777, rel=1e-13)
    kinetic = 0.05 * (0.777**2) * 14
    assert result.energy.outer_work[0, -1] == pytest.approx(kinetic, rel=1e-12)
    assert np.abs(result.energy.residual).max() < 1e-13


def test_a_brief_push_on_one_mass_gives_a_spin(cube):
    result = run(cube.pushed([7], (0, 5, 0), duration=0.01), WEIGHTLESS, 0.5, dt=5e-4)
    v, x = result.velocities(0), result.positions(0)
    arm = cube.positions[7] - cube.center_of_mass
    assert (cube.masses @ v) == pytest.approx((0, 0.05, 0), abs=1e-12)
    spin = np.cross(x - result.center_of_mass[0], cube.masses[:, None] * v).sum(axis=0)
    assert spin == pytest.approx(np.cross(arm, (0, 0.05, 0)), rel=0.02)
    assert np.abs(result.energy.residual).max() < 1e-5


def test_a_constant_force_is_a_gravity_of_its_own(cube):
    weight = cube
    for mass in range(8):
        weight = weight.pushed(mass, (0, 0, -0.981))
    hung = run(weight.fixed([0]), WEIGHTLESS, 0.5, energy=False)
    fell = run(cube.fixed([0]), FREE, 0.5, energy=False)
    assert hung.positions(0) == pytest.approx(fell.positions(0), abs=1e-11)


@pytest.mark.parametrize(("integrator", "error"), [("chin4", 1e-8), ("leapfrog", 2e-4)])
def test_a_tether_is_a_spring_to_a_point_for_a_time(integrator, error):
    w, end = np.sqrt(1000.0), 0.3
    tethered = POINT.moved((0.3, 0, 0)).tethered(0, 100.0, point=(0, 0, 0), end=end)
    result = run(tethered, WEIGHTLESS, 0.5, integrator)
    x, v = 0.3 * np.cos(w * end), -0.3 * w * np.sin(w * end)
    assert result.positions(0)[0, 0] == pytest.approx(x + v * 0.2, abs=20 * error)
    assert result.velocities(0)[0, 0] == pytest.approx(v, abs=100 * error)
    assert np.abs(result.energy.residual).max() < 1e-12


# Constraints.

LENGTH = 0.5


def pendulum(angle):
    return POINT.moved((LENGTH * np.sin(angle), 0, 1 - LENGTH * np.cos(angle)))


def quarter_period(angle):
    """By the arithmetic-geometric mean."""
    a, b = 1.0, np.cos(angle / 2)
    for _ in range(6):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return np.pi / 2 * np.sqrt(LENGTH / 9.81) / a


@pytest.mark.parametrize("ground", [None, ws.Ground()], ids=["free", "ground"])
@pytest.mark.parametrize(("integrator", "order"), [("chin4", 4), ("leapfrog", 2), ("euler", 1)])
def test_a_mass_on_a_sphere_is_a_pendulum_of_the_integrators_order(integrator, order, ground):
    angle = 1.0
    errors = []
    for steps in (100, 200):
        quarter = quarter_period(angle)
        bob = pendulum(angle).held_to(ws.Sphere((0, 0, 1), LENGTH))
        scene = ws.Scene(ground=ground and ws.Ground(stiffness=1e3))
        result = run(bob, scene, quarter, integrator, quarter / steps, 20 / quarter)
        errors.append(abs(result.positions(0)[0, 0]))  # it passes the lowest point
        distance = np.linalg.norm(result.frames(0)[:, 0] - (0, 0, 1), axis=1)
        assert np.abs(distance - LENGTH).max() < 1e-15
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_a_robot_on_a_sphere_stays_on_it_to_rounding_for_the_whole_run(cube):
    center = cube.positions[7] + (0.3, 0, 0.4)
    swung = cube.held_to(ws.Sphere(center, 0.5), 7).spinning((3, 2, 1))
    scene = ws.Scene(ground=None, damping=0.1, drag=0.02, wind=(1, 2, 0))
    for integrator in INTEGRATORS:
        result = run(swung, scene, 5.0, integrator, 5e-4, energy=False)
        distance = np.linalg.norm(result.frames(0)[:, 7] - center, axis=1)
        assert np.abs(distance - 0.5).max() < 1e-12
        arm = result.positions(0)[7] - center
        assert abs(result.velocities(0)[7] @ arm) < 1e-12


def test_a_mass_on_a_tilted_circle_or_line_is_a_pendulum_or_slides():
    tilt = 0.6
    normal = (0, -np.cos(tilt), np.sin(tilt))  # the circle's plane is steep by pi/2 - tilt
    low = np.array([0, -np.sin(tilt), -np.cos(tilt)]) * LENGTH
    turn = ws.Robot.rotated(POINT.moved(low), normal, 0.01, about=(0, 0, 0))
    w = np.sqrt(9.81 * np.cos(tilt) / LENGTH)
    result = run(turn.held_to(ws.Circle((0, 0, 0), normal, LENGTH)), FREE, np.pi / w)
    other = POINT.moved(low).rotated(normal, -0.01, about=(0, 0, 0)).positions[0]
    assert result.positions(0)[0] == pytest.approx(other, abs=2e-6)
    down = np.array([np.cos(tilt), 0, -np.sin(tilt)])
    slid = run(POINT.held_to(ws.Line((0, 0, 0), tuple(down))), FREE, 0.5)
    way = 9.81 * np.sin(tilt) * 0.125
    assert slid.positions(0)[0] == pytest.approx(way * down, abs=1e-12)
    across = np.cross(slid.frames(0)[:, 0], down)
    assert np.abs(across).max() < 1e-15


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_fixed_masses_and_axes_do_not_move_by_a_bit(cube, integrator):
    robot = cube.moved((0, 0, 0.3)).fixed([0], axes="xyz").fixed([5], axes="x").spinning((2, 1, 3))
    scene = ws.Scene(ground=ws.Ground(), damping=0.5)
    result = run(robot, scene, 0.5, integrator, energy=False)
    frames = result.frames(0)
    assert np.all(frames[:, 0] == robot.positions[0])
    assert np.all(frames[:, 5, 0] == robot.positions[5, 0])
    assert np.abs(frames[:, 5, 1:] - robot.positions[5, 1:]).max() > 0.01
    assert np.all(result.velocities(0)[0] == 0.0) and result.velocities(0)[5, 0] == 0.0


def test_a_planar_robot_is_the_robot_in_its_plane(walker):
    # All masses move in planes of constant y, as the symmetric ones do that no force takes out.
    flat = walker.fixed(axes="y")
    result = run(flat, ws.Scene(), 0.5, dt=5e-4)
    assert np.all(result.frames(0)[:, :, 1] == walker.positions[:, 1])
    assert result.positions(0)[:, 2].min() > -1e-3
    assert np.abs(result.energy.residual).max() < 1e-2 * np.abs(result.energy.total).max()


def test_constraints_do_no_work(cube):
    # Two masses on wires, one on a sphere, the others free.
    x = cube.positions
    robot = (
        cube.held_to(ws.Line(x[0], (1, 1, 0)), 0)
        .held_to(ws.Circle(x[7] + (0, 0, 0.3), (1, 0, 0), 0.3), 7)
        .held_to(ws.Sphere(x[3] + (0, 0.2, 0), 0.2), 3)
    )
    errors = []
    for dt in (1e-3, 5e-4):
        result = run(robot, FREE, 1.0, dt=dt)
        errors.append(np.abs(result.energy.residual).max())
    assert errors[0] / errors[1] > 12  # fourth order
    assert errors[0] < 1e-4


def test_robots_that_differ_in_their_constraints_share_a_batch(cube):
    robots = [
        cube.fixed([0]),
        cube.fixed([1]),
        cube,
        *[cube.fixed([0]).replace(stiffness=k) for k in (500.0, 900.0)],
        cube.pushed([2], (0, 0, 1)),
    ]
    batch = ws.Simulation(robots, FREE, dt=1e-3).run(0.2)
    for i, robot in enumerate(robots):
        alone = ws.Simulation(robot, FREE, dt=1e-3).run(0.2)
        assert np.array_equal(batch.positions(i), alone.positions(0))
    many = cube.fixed([0]).variants(stiffness=np.linspace(400, 1600, 11)[:, None] * np.ones(28))
    family = ws.Simulation(many, FREE, dt=1e-3).run(0.2)
    assert family.positions(1) == pytest.approx(
        ws.Simulation(many[1], FREE, dt=1e-3).run(0.2).positions(0), abs=0
    )


# Skins.


@pytest.mark.parametrize("obstacle", [False, True], ids=["ground", "plane"])
def test_feet_of_rubber_stick_where_a_belly_of_teflon_slides(obstacle):
    both = POINT.joined(POINT.moved((0, 1, 0)))
    shod = both.shod([0], static_friction=1.0, kinetic_friction=0.8)
    shod = shod.shod([1], static_friction=0.04, kinetic_friction=0.04)
    angle = 0.3
    gravity = (9.81 * np.sin(angle), 0, -9.81 * np.cos(angle))
    slippery = {"static_friction": 0.0, "kinetic_friction": 0.01, "stiffness": 1e4}
    surface = (
        {"ground": None, "obstacles": ws.Plane(**slippery)}
        if obstacle
        else {"ground": ws.Ground(**slippery)}
    )
    sunk = 0.1 * 9.81 * np.cos(angle) / 1e4
    result = run(shod.moved((0, 0, -sunk)), ws.Scene(gravity=gravity, **surface), 0.5)
    slides = 9.81 * (np.sin(angle) - 0.04 * np.cos(angle)) * 0.125
    assert result.positions(0)[:, 0] == pytest.approx([0.0, slides], rel=3e-3, abs=1e-12)


def test_a_soft_skin_sinks_deeper():
    soft = POINT.shod(stiffness=2e3)
    result = run([POINT, soft], ws.Scene(damping=20.0), 1.0, energy=False)
    depths = [-result.positions(i)[0, 2] for i in range(2)]
    assert depths == pytest.approx([0.981 / 1e5, 0.981 / 2e3], rel=1e-3)
