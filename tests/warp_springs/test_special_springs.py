"""Nonlinear, damped, breaking and changing springs against closed forms and an ODE solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import warp_springs as ws

K, MASS, REST = 100.0, 0.1, 0.1
FREE = ws.Scene(gravity=(0, 0, 0), ground=None)


def pair(length):
    """Two equal masses, their spring at a length; it moves as one mass MASS / 2."""
    return ws.Robot(
        masses=[MASS, MASS],
        positions=[(0, 0, 0), (length, 0, 0)],
        springs=[(0, 1)],
        stiffness=[K],
        rest_length=[REST],
    )


def run(robots, duration, dt=1e-3, scene=FREE, integrator="chin4", fps=50):
    simulation = ws.Simulation(robots, scene, dt=dt, integrator=integrator)
    return simulation.run(duration, fps=fps, energy=True)


def length(result, robot=0):
    x = result.positions(robot)
    return np.linalg.norm(x[1] - x[0])


def solved(robot, duration, dashpot=0.0):
    """The length of a pair at the end, by an ODE solver from Robot.tension."""

    def rates(t, state):
        tension = robot.tension(np.array([(0, 0, 0), (state[0], 0, 0)]), t)[0]
        return [state[1], -2.0 / MASS * (tension + dashpot * state[1])]

    start = [np.linalg.norm(robot.positions[1] - robot.positions[0]), 0.0]
    return solve_ivp(rates, (0, duration), start, rtol=1e-10, atol=1e-12).y[0, -1]


def test_a_hardening_spring_has_duffings_period():
    # s'' = -a s - b s^3 from rest at A: the period is that of a pendulum of the elliptic kind.
    amplitude, cubic = 0.03, 2e5
    a, b = 2 * K / MASS, 2 * cubic / MASS
    m = b * amplitude**2 / (2 * (a + b * amplitude**2))
    one, two = 1.0, np.sqrt(1 - m)
    for _ in range(6):
        one, two = (one + two) / 2, np.sqrt(one * two)
    period = 4 * np.pi / (2 * one) / np.sqrt(a + b * amplitude**2)
    robot = pair(REST + amplitude).with_hardening(cubic)
    errors = []
    for steps in (160, 320):
        result = run(robot, 2.25 * period, period / steps, fps=4 / period)
        errors.append(abs(length(result) - REST))  # it passes the middle
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.2)
    assert errors[1] < 1e-6
    assert np.abs(result.energy.residual).max() < 1e-6


def test_a_cable_pulls_and_does_not_push():
    cable = pair(REST - 0.02).with_cables()
    v = 0.5
    out = cable.replace(velocities=[(0, 0, 0), (v, 0, 0)])
    w = np.sqrt(2 * K / MASS)
    # Free for 0.02 / v, half a period of the spring, and free again the other way.
    back = 0.02 / v + np.pi / w
    result = run(out, back + 0.01, dt=1e-4)
    assert length(result) == pytest.approx(REST - v * 0.01, abs=5e-5)  # to half a step
    assert np.abs(result.energy.residual).max() < 1e-7


def test_a_cable_pendulum_swings_with_its_period():
    angle, span = 0.3, 0.5
    bob = np.array([np.sin(angle), 0, -np.cos(angle)]) * span
    pendulum = ws.Robot(
        masses=[1.0, MASS], positions=[(0, 0, 0), bob], springs=[(0, 1)], stiffness=[1e5]
    ).with_cables()
    one, two = 1.0, np.cos(angle / 2)
    for _ in range(5):
        one, two = (one + two) / 2, np.sqrt(one * two)
    quarter = np.pi / 2 * np.sqrt(span / 9.81) / one
    result = run(pendulum.fixed(0), quarter, dt=2e-4, scene=ws.Scene(ground=None))
    assert result.positions(0)[1, 0] == pytest.approx(0, abs=1e-4)
    assert result.positions(0)[1, 2] == pytest.approx(-span, abs=1e-4)


def test_a_dashpot_decays_by_its_ratio():
    ratio = 0.05
    w0 = np.sqrt(2 * K / MASS)
    w = w0 * np.sqrt(1 - ratio**2)
    result = run(pair(REST + 0.03).with_dashpots(ratio), 10 * np.pi / w, dt=np.pi / w / 100)
    assert length(result) - REST == pytest.approx(0.03 * np.exp(-ratio * w0 * 10 * np.pi / w), 1e-4)
    energy, total = result.energy, result.energy.total[0]
    assert energy.dashpot_loss[0, -1] == pytest.approx(total[0] - total[-1], 1e-3)
    assert np.abs(energy.residual).max() < 1e-4 * total[0]
    critical = run(pair(REST + 0.03).with_dashpots(1.0), 0.1, dt=5e-4)
    assert length(critical) - REST == pytest.approx(0.03 * np.exp(-w0 * 0.1) * (1 + w0 * 0.1), 1e-3)


STRETCHED = pair(0.13)
SPRINGS = {
    "curve": STRETCHED.with_curve([-0.01, 0.01], [3.0, 1.0, 0.3]),
    "harmonics": STRETCHED.breathing(0.2, 20.0).with_harmonics([0.01, 0.005], [0.3, 0.4]),
    "own omega": STRETCHED.breathing(0.2, 20.0).with_omegas(33.0).with_harmonics([0.01]),
    "winch": STRETCHED.with_winch([0, 0.1, 0.3], [0, -0.03, 0.05]),
    "stiffness in time": STRETCHED.with_stiffness_in_time([0, 0.05, 0.1], [1, 3, 1], period=0.1),
    "all": STRETCHED.breathing(0.2, 20.0)
    .with_hardening(1e5)
    .with_omegas(33.0)
    .with_curve([0.02], [1.0, 1.5])
    .with_stiffness_in_time([0, 0.1, 0.3], [1, 3, 0.5])
    .with_winch([0, 0.1, 0.3], [0, -0.01, 0.01])
    .with_harmonics([0.01, 0.005], [0.3, 0.4])
    .with_dashpots(0.1),
}


@pytest.mark.parametrize("name", SPRINGS)
def test_special_springs_follow_an_ode_solver(name):
    robot = SPRINGS[name]
    dashpot = 0.2 * np.sqrt(K * MASS / 2) if name == "all" else 0.0
    result = run(robot, 0.5, dt=5e-4)
    assert length(result) == pytest.approx(solved(robot, 0.5, dashpot), abs=1e-6)
    assert np.abs(result.energy.residual).max() < 2e-3  # the kinks of the tables
    assert result.energy.spring[0, 0] > 0.0


def test_breathing_and_its_own_omegas_are_the_same_course():
    robot = pair(0.13).breathing(0.2, 20.0, phase=0.7)
    own = robot.with_omegas(20.0)
    a, b = run([robot, own], 0.5).positions(0), run([own, robot], 0.5).positions(0)
    assert a == pytest.approx(b, abs=1e-13)


def test_a_spring_breaks_at_its_strength_and_says_when():
    # Pulled apart at 0.5 m/s from rest: s = v / w sin(w t) reaches the limit at t.
    w, v, limit = np.sqrt(2 * K / MASS), 1.0, 1.5
    fast = pair(REST).replace(velocities=[(0, 0, 0), (v, 0, 0)]).with_limits(breaks=limit)
    result = run([fast, pair(REST)], 0.2, dt=1e-4)
    when = np.arcsin(limit / K * w / v) / w
    assert result.broken(0)[0] == pytest.approx(when, abs=2e-4)
    assert np.isnan(result.broken(1)).all()
    speed = v * np.cos(w * when)
    assert length(result) == pytest.approx(REST + limit / K + speed * (0.2 - when), abs=4e-4)
    assert result.energy.plastic_loss[0, -1] == pytest.approx(limit**2 / K / 2, rel=0.02)
    assert np.abs(result.energy.residual).max() < 5e-5  # a part of a step's kick
    assert result.status[0] == ws.Status.OK


def test_a_spring_yields_at_its_stress_and_keeps_the_set():
    area, stress = 1e-4, 1e4  # 1 N
    soft = pair(REST).with_limits(yields=stress, area=area).with_dashpots(0.3)
    result = run(soft.replace(velocities=[(-0.5, 0, 0), (0.5, 0, 0)]), 2.0, dt=2e-4)
    assert result.yielded(0)[0] > 0.002
    assert length(result) == pytest.approx(REST + result.yielded(0)[0], abs=1e-5)
    energy = result.energy
    # Plastic work: the force of yielding times the way.
    assert energy.plastic_loss[0, -1] == pytest.approx(1.0 * result.yielded(0)[0], rel=0.02)
    assert np.abs(energy.residual).max() < 1e-4


def test_wear_is_reported_in_the_order_of_the_springs(cube, tmp_path):
    weak = cube.fixed([0]).with_limits(breaks=np.where(np.arange(28) == 17, 0.5, 1e9))
    order = np.random.default_rng(3).permutation(28)
    shuffled = weak.replace(
        springs=weak.springs[order],
        stiffness=weak.stiffness[order],
        rest_length=weak.rest_length[order],
        elements=weak.elements.replace(breaks=weak.elements.breaks[order]),
    )
    robots = [weak, shuffled, *[weak.replace(stiffness=k) for k in (900.0, 950.0)]]
    result = ws.Simulation(robots, ws.Scene(ground=None), dt=5e-4).run(0.1, fps=10)
    for robot, elements in enumerate(robots):
        gone = np.flatnonzero(~np.isnan(result.broken(robot)))
        assert gone.tolist() == [int(np.argmin(elements.elements.breaks))]
    saved = ws.Result.load(result.save(tmp_path / "worn.npz"))
    assert np.array_equal(saved.broken(1), result.broken(1), equal_nan=True)
    assert saved.robots[1] == shuffled


def test_variants_of_harmonics_and_dashpots_move_as_single_robots(walker):
    rng = np.random.default_rng(4)
    n, s = 9, walker.n_springs
    body = walker.with_dashpots(0.1).with_harmonics(np.zeros((s, 2)))
    waves = rng.uniform(-0.01, 0.01, (n, s, 2, 2))
    many = body.variants(harmonics=waves, dashpot=rng.uniform(0, 0.2, (n, s)))
    crowd = ws.Simulation(many, ws.Scene(), dt=5e-4).run(0.2)
    for i in (0, 5, 8):
        alone = ws.Simulation(many[i], ws.Scene(), dt=5e-4).run(0.2)
        assert np.array_equal(alone.positions(0), crowd.positions(i))


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog"])
def test_the_stable_step_of_special_springs_is_stable(cube, integrator):
    special = (
        cube.with_hardening(3e5)
        .with_dashpots(0.4)
        .with_stiffness_in_time([0, 0.1], [1, 4])
        .with_curve([0.001], [1.0, 3.0])
        .tethered(0, 500.0)
    )
    dt = ws.stable_dt(special, FREE, integrator)
    assert dt < 0.7 * ws.stable_dt(cube, FREE, integrator)
    shaken = special.replace(velocities=np.random.default_rng(1).normal(0, 0.3, (8, 3)))
    result = run(shaken, 600 * dt, dt=dt, integrator=integrator, fps=5 / dt / 100)
    assert result.status[0] == ws.Status.OK
    total = result.energy.total[0]
    assert total[-1] < 3 * total[0]  # the stiffness rises to four times
