"""Friction against closed forms: sliding distance, sticking, slopes."""

import numpy as np
import pytest

import warp_springs as ws

from .test_physics import INTEGRATORS, KICK_AND_DRIFT, G, finish, point


def plate(depth):
    """A square of four 0.1 kg masses, braced by its diagonals, `depth` into the ground."""
    corners = [(0, 0, -depth), (0.1, 0, -depth), (0.1, 0.1, -depth), (0, 0.1, -depth)]
    sides = [(0, 1), (1, 2), (2, 3), (0, 3), (0, 2), (1, 3)]
    return ws.Robot(masses=[0.1] * 4, positions=corners, springs=sides, stiffness=2000.0)


def feet(depth, cube):
    """Bodies that stand `depth` in the ground, by name."""
    lowered = (0.0, 0.0, -depth)
    return {"point": point(lowered), "plate": plate(depth), "cube": cube.moved(lowered)}


def slope(angle, **ground):
    """A scene whose gravity leans by `angle` towards x: the ground becomes a slope."""
    gravity = (G * np.sin(angle), 0.0, -G * np.cos(angle))
    return ws.Scene(gravity=gravity, ground=ws.Ground(**ground))


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("kind", ["point", "plate", "cube"])
def test_sliding_distance(kind, integrator, cube):
    mu, speed = 0.3, 1.0
    depth = (0.2 if kind == "cube" else 0.1) * G / 1e5  # each foot carries its share of the weight
    body = feet(depth, cube)[kind]
    direction = np.array([0.6, 0.8, 0.0])
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=mu))
    robot = body.moving(speed * direction)
    result = ws.Simulation(robot, scene, dt=1e-4, integrator=integrator).run(0.6)
    path = result.center_of_mass[0] - robot.center_of_mass
    expected = speed**2 / (2 * mu * G)
    assert path[:2] @ direction[:2] == pytest.approx(expected, rel=5e-3)
    assert abs(path[0] * 0.8 - path[1] * 0.6) < 5e-3 * expected  # straight on


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
@pytest.mark.parametrize("mass", [0.05, 0.2])
def test_sliding_deceleration_does_not_depend_on_the_mass(mass, integrator):
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3))
    robot = point((0, 0, -mass * G / 1e5), (1.0, 0.0, 0.0), mass)
    dt = 1e-4
    _, velocities = finish(robot, scene, 0.1, dt, integrator=integrator)
    assert velocities[0, 0] == pytest.approx(1.0 - 0.3 * G * 0.1, abs=1e-9)


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
@pytest.mark.parametrize("kind", ["point", "plate", "cube"])
def test_body_on_a_slope_below_the_static_threshold_does_not_creep(kind, integrator, cube):
    scene = slope(np.arctan(0.7), static_friction=1.0, kinetic_friction=0.8)
    scene = ws.Scene(gravity=scene.gravity, ground=scene.ground, damping=20.0)
    body = feet(1e-6, cube)[kind]
    result = ws.Simulation(body, scene, dt=5e-4, integrator=integrator).run(4.0, fps=1)
    frames = result.frames(0)
    standing = frames[-1, :, 2] < 0
    assert standing.any()
    # The first second is for settling: a mass lands, slides and sticks, as the slope is below both
    # coefficients. Then it keeps its place.
    creep = np.abs(frames[-1] - frames[1])[standing]
    assert creep[:, :2].max() == 0.0
    assert creep[:, 2].max() < 1e-8  # what is left of the bouncing


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("kind", ["point", "plate"])
def test_body_on_a_slope_above_the_static_threshold_slides_with_the_known_acceleration(
    kind, integrator, cube
):
    angle, duration = np.arctan(0.5), 1.0
    scene = slope(angle, static_friction=0.4, kinetic_friction=0.3)
    depth = 0.1 * G * np.cos(angle) / 1e5
    body = feet(depth, cube)[kind]
    dt = 1e-4
    positions, _ = finish(body, scene, duration, dt, integrator=integrator)
    friction = 0.3 * G * np.cos(angle)
    acceleration = G * np.sin(angle) - friction
    travelled = (positions - body.positions)[:, 0]
    # The friction of a step acts as a whole at its start: half a step early on average.
    early = friction * duration * dt / 2
    assert travelled == pytest.approx(acceleration * duration**2 / 2, abs=1.001 * early)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_static_threshold_separates_sticking_from_sliding(integrator):
    for tangent, slides in ((0.39, False), (0.41, True)):
        scene = slope(np.arctan(tangent), static_friction=0.4, kinetic_friction=0.3)
        depth = 0.1 * -scene.gravity[2] / 1e5
        body = point((0, 0, -depth))
        positions, velocities = finish(body, scene, 0.5, integrator=integrator)
        assert (positions[0, 0] > 0.01) == slides
        assert (velocities[0, 0] > 0.0) == slides


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_course_friction_stops_a_sliding_mass_that_no_force_pulls(integrator):
    # The classroom's rule to the letter: a horizontal force below mu_s F_n also zeroes the speed.
    scene = ws.Scene(ground=ws.Ground(friction="course"))
    robot = point((0, 0, -0.1 * G / 1e5), (1.0, 0.5, 0.0))
    positions, velocities = finish(robot, scene, 0.01, integrator=integrator)
    assert np.all(positions[0, :2] == 0.0)
    assert np.all(velocities[0, :2] == 0.0)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_course_friction_reduces_the_force_above_the_threshold(integrator):
    scene = slope(np.arctan(0.5), static_friction=0.4, kinetic_friction=0.3, friction="course")
    depth = 0.1 * -scene.gravity[2] / 1e5
    _, velocities = finish(point((0, 0, -depth)), scene, 0.1, integrator=integrator)
    expected = (scene.gravity[0] + 0.3 * scene.gravity[2]) * 0.1
    assert velocities[0, 0] == pytest.approx(expected, rel=1e-6)
