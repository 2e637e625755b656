from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import warp_springs as ws
from evolve.evaluate import Evaluator
from evolve.fitness import FITNESS, UNITS, Trial, body_diameters, omegas
from evolve.toml import load
from tests.evolve.conftest import TINY


@pytest.fixture(scope="module")
def config():
    return load("cube", TINY)


@pytest.fixture(scope="module")
def robots(config):
    rng = np.random.Generator(np.random.Philox(1))
    encoding = config.make_encoding()
    return encoding.express(encoding.random(20, rng))


def sliding(speed: float, omega: float = 2.0 * np.pi) -> ws.Robot:
    """A rigid little body that has a speed and an actuation without amplitude."""
    return ws.shapes.cube().moving((speed, 0.0, 0.0)).replace(omega=omega)


def test_speed_counts_body_diameters_per_cycle():
    # Without friction, gravity and damping a body keeps its speed: 0.3 m/s for 2 s at 3 cycles
    # per second are 0.6 m in 6 cycles, and a cube of 0.1 m has the diameter 0.1 sqrt(3) m.
    scene = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)
    robots = [sliding(0.3, omega=6.0 * np.pi), sliding(-0.3, omega=6.0 * np.pi), sliding(0.3, 0.0)]
    simulation = ws.Simulation(robots, scene, dt=1e-3)
    trial = Trial(robots, simulation.run(0.5), simulation.run(2.0))
    expected = 0.6 / (0.1 * np.sqrt(3.0)) / 6.0
    np.testing.assert_allclose(FITNESS["speed"](trial), [expected, expected, 0.0], rtol=1e-9)
    np.testing.assert_allclose(FITNESS["distance"](trial), 0.6, rtol=1e-9)
    assert trial.duration == pytest.approx(2.0)
    assert FITNESS.keys() == UNITS.keys()


def test_height_is_not_distance():
    centers = {"settled": [[0.0, 0.0, 1.0]], "measured": [[3.0, -4.0, 9.0]]}
    results = {
        name: SimpleNamespace(center_of_mass=np.array(center), end_time=float(i))
        for i, (name, center) in enumerate(centers.items())
    }
    assert FITNESS["distance"](Trial([ws.shapes.cube()], **results)) == pytest.approx([5.0])


def test_diameters_and_omegas_of_lists_and_variants():
    cube = ws.shapes.cube()
    positions = np.stack([cube.positions, 2.0 * cube.positions])
    several = cube.variants(positions=positions, omega=[1.0, 2.0])
    np.testing.assert_allclose(body_diameters(several), 0.1 * np.sqrt(3.0) * np.array([1, 2]))
    np.testing.assert_allclose(body_diameters(list(several)), body_diameters(several))
    np.testing.assert_array_equal(omegas(several), [1.0, 2.0])
    np.testing.assert_array_equal(omegas(list(several)), [1.0, 2.0])


def test_a_stopped_robot_has_no_fitness_and_disturbs_nobody(config, robots):
    evaluate = Evaluator(config)
    healthy = evaluate(robots)
    wild = list(robots)
    wild[3] = wild[3].replace(stiffness=1e12)
    scores = evaluate(wild)
    assert healthy.status.tolist() == [0] * 20 and np.isfinite(healthy.fitness).all()
    assert scores.status[3] != 0 and np.isnan(scores.fitness[3])
    assert all(np.isnan(values[3]) for values in scores.descriptors.values())
    assert scores.spring_evaluations[3] < scores.spring_evaluations[2]
    others = np.arange(20) != 3
    np.testing.assert_array_equal(scores.fitness[others], healthy.fitness[others])


def test_scores_do_not_depend_on_company_or_threads(config, robots):
    whole = Evaluator(config)(robots)
    part = Evaluator(config)(robots[5:7])
    np.testing.assert_array_equal(part.fitness, whole.fitness[5:7])
    two = load("cube", TINY | {"simulation.threads": 2})
    np.testing.assert_array_equal(Evaluator(two)(robots).fitness, whole.fitness)


def test_scores_tell_what_they_cost_and_describe(config, robots):
    scores = Evaluator(config)(robots)
    steps = round(1.0 / config.simulation.dt)  # one cycle to settle, one measured, of 0.5 s each
    np.testing.assert_array_equal(scores.spring_evaluations, steps * 28)
    assert tuple(scores.descriptors) == Evaluator.descriptors
    assert scores.wall_time > 0.0
    way = np.hypot(scores.descriptors["displacement_x"], scores.descriptors["displacement_y"])
    np.testing.assert_allclose(scores.fitness, way / (0.1 * np.sqrt(3.0)))


def test_a_step_of_its_own_for_each_robot_costs_what_it_takes(robots):
    auto = load("cube", TINY | {"simulation.dt": "auto", "simulation.integrator": "chin4"})
    stiff = [robots[0], robots[1].replace(stiffness=4e5)]
    scores = Evaluator(auto)(stiff)
    dt = ws.Simulation(stiff, auto.scene.build(), dt="auto", integrator="chin4").robot_dt
    assert dt[1] < dt[0] < 1e-3
    np.testing.assert_array_equal(scores.spring_evaluations, np.rint(1.0 / dt) * 28 * 3)


def test_a_film_shows_the_whole_trial(config, robots):
    film = Evaluator(config).film(robots[:2], fps=20.0)
    assert len(film.times) == 21 and film.end_time == pytest.approx(1.0)
    assert film.recorded == (0, 1)
