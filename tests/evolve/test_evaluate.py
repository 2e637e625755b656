from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import warp_springs as ws
from evolve.errors import ConfigError
from evolve.fitness import FITNESS, UNITS, Trial, body_diameters, measure, omegas
from evolve.judging.evaluate import Evaluator
from evolve.toml import load
from tests.evolve.conftest import TINY

FRICTION = {"static": 1.0, "kinetic": 0.8}


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
    trial = Trial(robots, simulation.run(0.5), [simulation.run(2.0)])
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
    trial = Trial([ws.shapes.cube()], results["settled"], [results["measured"]])
    assert FITNESS["distance"](trial) == pytest.approx([5.0])


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
    assert tuple(scores.descriptors) == config.descriptors
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


EVERYTHING = ("jump", "energy", "economy", "smoothness", "straightness", "forward", "mass")


def test_measures_of_a_thrown_ball():
    """Closed forms of a flight: rise v^2 / 2g, constant acceleration, a straight way."""
    config = load(
        "cube",
        {
            "simulation.integrator": "chin4",
            "simulation.dt": 1e-3,
            "task.settle": 0.02,
            "task.measure": 1.0,
            "task.descriptors": list(EVERYTHING),
            "task.direction": [0.0, 2.0],
            "scene.damping": 0.0,
        },
    )
    cube = ws.shapes.cube().moved((0, 0, 2.0)).moving((0.3, 0.4, 2.0)).replace(omega=4 * np.pi)
    evaluate = Evaluator(config)
    found = {name: value[0] for name, value in evaluate([cube]).descriptors.items()}
    g, t0 = 9.81, evaluate.settle
    expected = (2.0 - g * t0) ** 2 / (2.0 * g)
    assert found["jump"] == pytest.approx(expected, rel=2e-3)  # 20 looks a cycle
    assert found["smoothness"] == pytest.approx(-g, rel=1e-9)
    assert found["straightness"] == pytest.approx(1.0, rel=1e-9)
    assert found["forward"] == pytest.approx(0.4 * 0.5 / cube.diameter, rel=1e-9)
    assert found["mass"] == pytest.approx(0.8)
    assert found["energy"] == found["economy"] == 0.0


def test_nobody_is_economical_by_hardly_breathing():
    # An exploit: way and work were both rounding, at 1e8 m/J.
    config = load("cube", TINY | {"task.fitness": "economy"})
    encoding = config.make_encoding()
    robots = encoding.express(encoding.random(32, np.random.Generator(np.random.Philox(1))))
    stacked = {name: np.array(values) for name, values in robots.stacked.items()}
    evaluate = Evaluator(config)
    honest = np.nanmax(evaluate(robots).fitness)
    for part in (1e-2, 1e-5, 1e-8):
        still = robots.body.variants(**stacked | {"amplitude": part * stacked["amplitude"]})
        assert np.nanmax(evaluate(still).fitness) < max(1.0, 10 * honest)


def test_energy_is_the_work_of_the_springs(config, robots):
    wide = load("cube", TINY | {"task.descriptors": ["energy", "economy", "jump"]})
    evaluate = Evaluator(wide)
    scores = evaluate(robots)
    simulation = ws.Simulation(robots, evaluate.scene, dt=wide.simulation.dt, integrator="leapfrog")
    start = simulation.run(evaluate.settle)
    end = simulation.run(evaluate.measure, energy=True)
    work = np.abs(end.energy.work[:, -1])
    np.testing.assert_allclose(scores.descriptors["energy"], work, rtol=1e-9)
    way = np.hypot(*(end.center_of_mass - start.center_of_mass)[:, :2].T)
    ledger = end.energy
    had = np.maximum(ledger.total[:, 0] - ledger.total[:, -1], ledger.kinetic[:, 0])
    cycles = np.abs(robots.array("omega")) * evaluate.measure / (2 * np.pi)
    walks = way > 0.01 * robots.body.diameter * cycles
    economy = np.where(walks, way / (work + had), 0.0)
    np.testing.assert_allclose(scores.descriptors["economy"], economy, rtol=1e-9)
    # Cutting the measurement into pieces changes no bit of the motion.
    np.testing.assert_array_equal(scores.fitness, Evaluator(config)(robots).fitness)


def test_an_unknown_measure_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"task\.fitness: expected measures, .* not 'fun'"):
        load("cube", {"task.fitness": "fun"})
    with pytest.raises(ConfigError, match="expected measures, which are"):
        load("cube", {"optimizer.type": "nsga2", "optimizer.objectives": ["fitness", "-fun"]})


def test_a_new_measure_is_a_small_function(config, robots):
    @measure("m")
    def wandering(trial):
        """How far it strays from the x axis."""
        return np.abs(trial.displacement[:, 1])

    try:
        changed = load("cube", TINY | {"task.fitness": "wandering"})
        scores = Evaluator(changed)(robots)
        expected = np.abs(scores.descriptors["displacement_y"])
        np.testing.assert_array_equal(scores.fitness, expected)
        assert FITNESS["wandering"].about == "How far it strays from the x axis."
    finally:
        del FITNESS["wandering"], UNITS["wandering"]


def test_several_trials_are_several_starts_on_several_floors(robots):
    still = {f"task.trials.{k}": 0.0 for k in ("position", "velocity", "rotation", "height")}
    rough = load("cube", TINY | still | {"task.trials.count": 3, "task.trials.friction": 0.5})
    scores = Evaluator(rough)(robots)
    parts = []
    for factor in (0.5, 1.0, 1.5):
        floor = {f"scene.ground.{k}_friction": factor * mu for k, mu in FRICTION.items()}
        parts.append(Evaluator(load("cube", TINY | floor))(robots))
    assert (parts[0].fitness != parts[2].fitness).all()
    np.testing.assert_allclose(scores.fitness, np.mean([p.fitness for p in parts], axis=0))
    cost = sum(p.spring_evaluations for p in parts)
    np.testing.assert_array_equal(scores.spring_evaluations, cost)


def test_perturbed_trials_do_not_depend_on_company_and_the_worst_counts(robots):
    settings = TINY | {"task.trials.count": 4, "task.trials.aggregate": "worst"}
    evaluate = Evaluator(load("cube", settings))
    whole = evaluate(robots)
    np.testing.assert_array_equal(evaluate(robots[3:5]).fitness, whole.fitness[3:5])
    np.testing.assert_array_equal(evaluate(list(robots)[3:5]).fitness, whole.fitness[3:5])
    mean = Evaluator(load("cube", settings | {"task.trials.aggregate": "mean"}))(robots)
    assert (whole.fitness < mean.fitness).all()
    wild = [*list(robots)[:2], robots[2].replace(stiffness=1e12)]
    scores = evaluate(wild)
    assert scores.status[2] != 0 and np.isnan(scores.fitness[2])
    np.testing.assert_array_equal(scores.fitness[:2], whole.fitness[:2])
