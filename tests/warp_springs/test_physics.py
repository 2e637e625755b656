"""The simulator against textbook solutions: oscillators, projectiles, losses, ground, friction.

Where the integrator itself has an exact solution the tolerance is rounding; elsewhere it is the
size of the integrator's error at the given step, with its order checked separately.
"""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.reference import continuum

G = 9.81
WEIGHTLESS = ws.Scene(gravity=(0, 0, 0), ground=None)
KICK_AND_DRIFT = ("leapfrog", "chin4")
INTEGRATORS = (*KICK_AND_DRIFT, "euler")
ORDER = {"euler": 1.0, "leapfrog": 2.0, "chin4": 4.0}


def point(position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), mass=0.1):
    """A robot of one mass and no spring."""
    return ws.Robot(
        masses=[mass],
        positions=[position],
        velocities=[velocity],
        springs=np.empty((0, 2), dtype=int),
        stiffness=[],
    )


def pair(stretch, **fields):
    """Two masses of 0.1 and 0.3 kg on the x axis, 0.2 m apart, their spring stretched."""
    return ws.Robot(
        masses=[0.1, 0.3],
        positions=[(0.0, 0.0, 0.0), (0.2 + stretch, 0.0, 0.0)],
        springs=[(0, 1)],
        stiffness=[1000.0],
        rest_length=[0.2],
        **fields,
    )


PAIR_FREQUENCY = np.sqrt(1000.0 * (1 / 0.1 + 1 / 0.3))  # sqrt(k / reduced mass) [rad/s]


def finish(robot, scene, duration, dt=1e-4, **options):
    """Positions and velocities (M, 3) of one robot at the end of a run."""
    result = ws.Simulation(robot, scene, dt=dt, **options).run(duration)
    assert result.status[0] == ws.Status.OK
    return result.positions(0), result.velocities(0)


def separation(vectors):
    return (vectors[1] - vectors[0])[0]


def order(errors, dts):
    """Slope of log error over log dt."""
    return np.polyfit(np.log(dts), np.log(errors), 1)[0]


def rms(errors):
    return np.sqrt(np.mean(errors**2))


def momenta(masses, positions, velocities):
    """Momentum and angular momentum about the origin, (3,) each."""
    momentum = masses[:, None] * velocities
    return momentum.sum(axis=0), np.cross(positions, momentum).sum(axis=0)


# Springs.


@pytest.mark.parametrize("integrator", ["leapfrog", "euler"])
def test_oscillator_follows_the_exact_solution_of_its_recursion(integrator):
    # Both methods obey r'' = (r[n+1] - 2 r[n] + r[n-1]) / dt^2 and differ in the first step, so
    # they oscillate with the angle theta per step, sin(theta / 2) = frequency dt / 2.
    dt, steps, stretch = 1e-3, 1000, 0.01
    theta = 2 * np.arcsin(PAIR_FREQUENCY * dt / 2)
    lag = 0.0 if integrator == "leapfrog" else np.tan(theta / 2)
    expected = stretch * (np.cos(steps * theta) - lag * np.sin(steps * theta))
    positions, _ = finish(pair(stretch), WEIGHTLESS, steps * dt, dt, integrator=integrator)
    # Rounding of 1,000 steps at a length of 0.2 m.
    assert separation(positions) - 0.2 == pytest.approx(expected, abs=1e-14)
    assert np.all(positions[:, 1:] == 0.0)


@pytest.mark.parametrize(
    ("integrator", "largest"), [("euler", 4e-4), ("leapfrog", 4e-4), ("chin4", 3.2e-3)]
)
def test_oscillator_error_has_the_order_of_the_integrator(integrator, largest):
    stretch, duration = 0.01, 0.32
    dts = largest / np.array([1, 2, 4, 8])
    phase = PAIR_FREQUENCY * duration
    errors = []
    for dt in dts:
        ends = finish(pair(stretch), WEIGHTLESS, duration, dt, integrator=integrator)
        positions, velocities = ends
        length_error = separation(positions) - 0.2 - stretch * np.cos(phase)
        rate_error = separation(velocities) / PAIR_FREQUENCY + stretch * np.sin(phase)
        errors.append(np.hypot(length_error, rate_error))
    assert order(errors, dts) == pytest.approx(ORDER[integrator], abs=0.1)


@pytest.mark.parametrize(("integrator", "largest"), [("leapfrog", 5e-4), ("chin4", 4e-3)])
def test_breathing_spring_drives_the_pair_like_the_driven_oscillator(integrator, largest):
    # y'' = -F^2 (y - b sin(w t + c)) has the steady part b F^2 / (F^2 - w^2) sin(w t + c).
    amplitude, phase, omega, duration = 0.02, 0.7, 40.0, 0.5
    robot = pair(0.0, amplitude=[amplitude], phase=[phase], omega=omega)
    gain = amplitude * PAIR_FREQUENCY**2 / (PAIR_FREQUENCY**2 - omega**2)
    cosine, sine = -gain * np.sin(phase), -gain * omega * np.cos(phase) / PAIR_FREQUENCY
    angle = PAIR_FREQUENCY * duration
    expected = cosine * np.cos(angle) + sine * np.sin(angle)
    expected += gain * np.sin(omega * duration + phase)
    dts = largest / np.array([1, 2, 4])
    ends = [finish(robot, WEIGHTLESS, duration, dt, integrator=integrator)[0] for dt in dts]
    errors = [abs(separation(positions) - 0.2 - expected) for positions in ends]
    assert order(errors, dts) == pytest.approx(ORDER[integrator], abs=0.1)
    assert errors[-1] < 1e-3 * amplitude


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_breathing_keeps_its_phase_over_thousands_of_cycles(precision):
    # Damped, the pair forgets how it began: the response to b sin(w t + c) is the imaginary part
    # of b F^2 / (F^2 - w^2 + i gamma w) exp(i (w t + c)).
    amplitude, phase, omega, damping = 0.02, 0.7, 40.0, 1.0
    robot = pair(0.0, amplitude=[amplitude], phase=[phase], omega=omega)
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, damping=damping)
    simulation = ws.Simulation(robot, scene, dt=1e-3, precision=precision, integrator="leapfrog")
    simulation.run(1000.0)
    result = simulation.run(0.2, fps=100)
    response = PAIR_FREQUENCY**2 / (PAIR_FREQUENCY**2 - omega**2 + 1j * damping * omega)
    wave = amplitude * response * np.exp(1j * (omega * result.times + phase))
    lengths = result.frames(0)[:, 1, 0] - result.frames(0)[:, 0, 0]
    # Measured: 2e-5 of the amplitude, leapfrog's own error at this step, in both precisions.
    assert np.abs(lengths - 0.2 - wave.imag).max() < 1e-4 * amplitude


def test_zero_length_spring_exerts_no_force():
    robot = ws.Robot(
        masses=[0.1, 0.2],
        positions=[(0.1, 0.2, 0.3)] * 2,
        springs=[(0, 1)],
        stiffness=[1000.0],
        rest_length=[0.1],
    )
    positions, velocities = finish(robot, WEIGHTLESS, 0.1)
    assert np.array_equal(positions, robot.positions)
    assert np.all(velocities == 0.0)


# Free flight.


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
@pytest.mark.parametrize("ground", [None, ws.Ground()], ids=["no ground", "ground far below"])
def test_projectile_is_exact_with_kicks_and_drifts(ground, integrator):
    gravity, duration = np.array([0.5, -0.3, -G]), 1.0
    start, velocity = np.array([1.0, 2.0, 100.0]), np.array([3.0, -1.0, 4.0])
    scene = ws.Scene(gravity=gravity, ground=ground)
    body = point(start, velocity)
    positions, velocities = finish(body, scene, duration, integrator=integrator)
    expected = start + velocity * duration + gravity * duration**2 / 2
    # Rounding of 10,000 steps at heights of 100 m.
    assert positions[0] == pytest.approx(expected, rel=1e-12)
    assert velocities[0] == pytest.approx(velocity + gravity * duration, rel=1e-12)


def test_projectile_with_euler_falls_one_step_further():
    # The sum of v[n] dt is v0 t + g t (t + dt) / 2.
    dt, duration = 1e-3, 1.0
    scene = ws.Scene(gravity=(0, 0, -G), ground=None)
    positions, velocities = finish(
        point((0, 0, 0), (1, 0, 4)), scene, duration, dt, integrator="euler"
    )
    height = 4.0 * duration - G * duration * (duration + dt) / 2
    assert positions[0] == pytest.approx([1.0, 0.0, height], rel=1e-12)
    assert velocities[0] == pytest.approx([1.0, 0.0, 4.0 - G * duration], rel=1e-12)


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
@pytest.mark.parametrize("ground", [None, ws.Ground()], ids=["no ground", "ground far below"])
def test_centre_of_mass_of_a_tumbling_breathing_body_follows_the_parabola(
    walker, ground, integrator
):
    body = walker.moved((0, 0, 50)).spinning((3, -2, 4)).moving((1.0, 0.5, 2.0))
    scene = ws.Scene(gravity=(0.2, 0, -G), ground=ground)
    result = ws.Simulation(body, scene, dt=5e-4, integrator=integrator).run(1.0, fps=10)
    t = result.times[:, None]
    expected = body.center_of_mass + t * (1.0, 0.5, 2.0) + t**2 / 2 * (0.2, 0, -G)
    measured = np.average(result.frames(0), axis=1, weights=body.masses)
    # Internal forces cancel to rounding at each of 2,000 steps.
    assert np.abs(measured - expected).max() < 1e-12
    assert result.center_of_mass[0] == pytest.approx(expected[-1], rel=1e-13)
    assert np.ptp(result.frames(0) - measured[:, None], axis=0).max() > 0.05  # it did tumble


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
def test_momentum_and_angular_momentum_are_conserved_in_free_flight(walker, integrator):
    body = walker.moved((0.3, -0.2, 0.1)).spinning((3, -2, 4)).moving((1.0, 0.5, 2.0))
    before = momenta(body.masses, body.positions, body.velocities)
    after = momenta(body.masses, *finish(body, WEIGHTLESS, 2.0, 5e-4, integrator=integrator))
    # Leapfrog conserves both exactly: rounding of 4,000 steps remains. The gradient kick of chin4
    # pulls along springs a little displaced, so its angular momentum is exact to its order only.
    assert after[0] == pytest.approx(before[0], rel=1e-12)
    assert after[1] == pytest.approx(before[1], rel=1e-12 if integrator == "leapfrog" else 1e-8)


@pytest.mark.parametrize(
    ("integrator", "losses", "expected", "smallest"),
    [
        ("euler", {"damping": 1.5, "drag": 0.05}, 1.0, 2.5e-5),
        ("leapfrog", {"damping": 1.5, "drag": 0.05}, 2.0, 2.5e-5),
        ("chin4", {}, 4.0, 2e-4),
        ("chin4", {"damping": 1.5, "drag": 0.05}, 2.0, 1e-4),  # losses are split
    ],
)
def test_converges_to_the_differential_equations(walker, integrator, losses, expected, smallest):
    body = walker.spinning((3, -2, 4)).moving((1.0, 0.5, 2.0))
    scene = ws.Scene(gravity=(1.0, -2.0, -G), ground=None, **losses)
    duration = 0.2
    truth, truth_velocities = continuum(body, scene, duration, 8000)  # good to 1e-10 m
    dts = np.array([4, 2, 1]) * smallest
    runs = [finish(body, scene, duration, dt, integrator=integrator) for dt in dts]
    errors = [rms(x - truth) for x, _ in runs]
    assert order(errors, dts) == pytest.approx(expected, abs=0.1)
    if integrator != "euler":  # whose velocities are better than first order at these steps
        errors = [rms(v - truth_velocities) for _, v in runs]
        assert order(errors, dts) == pytest.approx(expected, abs=0.1)


# Losses.


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4])
def test_damping_is_a_rate_independent_of_the_step(integrator, dt):
    damping, duration = 0.7, 1.0
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, damping=damping)
    _, velocities = finish(point(velocity=(1, 2, 3)), scene, duration, dt, integrator=integrator)
    expected = np.array([1, 2, 3]) * np.exp(-damping * duration)
    assert velocities[0] == pytest.approx(expected, rel=1e-11)  # rounding of 10,000 factors


def test_damping_rate_converts_the_factor_of_a_step():
    rate = ws.damping_rate(per_step=0.999, dt=1e-4)
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, damping=rate)
    _, velocities = finish(point(velocity=(1, 0, 0)), scene, 0.1, 1e-4, integrator="euler")
    assert velocities[0, 0] == pytest.approx(0.999**1000, rel=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_drag_makes_the_inverse_speed_grow_linearly(integrator):
    drag, mass, duration = 0.05, 0.1, 2.0
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, drag=drag)
    start = np.array([3.0, -4.0, 12.0])
    body = point((0, 0, 0), start, mass)
    _, velocities = finish(body, scene, duration, 1e-3, integrator=integrator)
    speed = 1.0 / (1.0 / 13.0 + drag / mass * duration)
    assert velocities[0] == pytest.approx(start * speed / 13.0, rel=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_falling_with_drag_approaches_the_terminal_speed(integrator):
    drag, mass = 0.05, 0.1
    scene = ws.Scene(gravity=(0, 0, -G), ground=None, drag=drag)
    _, velocities = finish(point(mass=mass), scene, 4.0, 5e-4, integrator=integrator)
    # Euler is off by the fraction g dt / (2 v) = 0.055 %, the others by the order of its square.
    terminal = np.sqrt(mass * G / drag)
    tolerance = 1e-3 if integrator == "euler" else 1e-6
    assert -velocities[0, 2] == pytest.approx(terminal, rel=tolerance)


# Ground.


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
def test_dropped_mass_bounces_like_the_closed_form(integrator):
    # A parabola from height h, a half-wave in the ground, a parabola again, for ever.
    mass, stiffness, height = 0.1, 1e5, 0.1
    frequency, impact = np.sqrt(stiffness / mass), np.sqrt(2 * G * height)
    fall = impact / G
    contact = 2 * (np.pi - np.arctan(impact * frequency / G)) / frequency
    scene = ws.Scene(ground=ws.Ground(stiffness=stiffness))
    dropped = point((0, 0, height), mass=mass)
    result = ws.Simulation(dropped, scene, dt=1e-4, integrator=integrator).run(2.0, fps=100)
    into_cycle = (result.times + fall) % (2 * fall + contact)  # 0: leaves the ground
    flying = into_cycle < 2 * fall
    expected = impact * into_cycle - G * into_cycle**2 / 2
    angle = frequency * (into_cycle - 2 * fall)
    in_ground = -G / frequency**2 * (1 - np.cos(angle)) - impact / frequency * np.sin(angle)
    expected = np.where(flying, expected, in_ground)
    heights = result.frames(0)[:, 0, 2]
    # Seven bounces, each of which may shift the flight by a fraction of a sub-step.
    assert np.abs(heights - expected).max() < 2e-3 * height


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_damped_mass_rests_at_the_depth_that_carries_its_weight(integrator):
    mass, stiffness = 0.1, 1e4
    scene = ws.Scene(ground=ws.Ground(stiffness=stiffness), damping=50.0)
    positions, velocities = finish(
        point((0.3, 0.2, 1e-3), mass=mass), scene, 2.0, integrator=integrator
    )
    # The damping acts between the kicks of the ground, hence not exactly there.
    assert positions[0] == pytest.approx([0.3, 0.2, -mass * G / stiffness], rel=1e-3)
    assert np.abs(velocities[0]).max() < 1e-3


@pytest.mark.parametrize("integrator", KICK_AND_DRIFT)
def test_bouncing_cube_error_with_contact_substeps(tumbling_cube, integrator):
    ground = ws.Ground(stiffness=1e5, static_friction=0.0, kinetic_friction=0.0)
    scene = ws.Scene(ground=ground)
    truth, _ = continuum(tumbling_cube, scene, 0.5, 10_000)  # itself good to 2e-5 m
    positions, _ = finish(tumbling_cube, scene, 0.5, 1e-3, integrator=integrator)
    # Without sub-steps the error is 2.4e-2 m.
    assert rms(positions - truth) < 1.5e-3
