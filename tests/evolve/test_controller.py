"""Closed loops under evolution: networks as genomes, goals, lights, rough ground."""

import numpy as np
import pytest

import warp_springs as ws
from evolve import Evaluator, Search, load
from evolve.encodings.controller import spread_out
from evolve.errors import ConfigError
from evolve.judging.evaluate import _of_next_seeds

SMALL = {
    "encoding.type": "controller",
    "encoding.groups": 4,
    "encoding.hidden": 3,
    "encoding.period": 0.5,
    "population": 24,
    "task.settle": 1.0,
    "task.measure": 2.0,
    "simulation.dt": 1e-3,
}
GOALS = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
SEEING = SMALL | {
    "encoding.sensors": ["clock", "goal", "light"],
    "task.goals": GOALS,
    "task.fitness": "approach",
}


def genomes_of(encoding, n, seed=1):
    return encoding.random(n, np.random.Generator(np.random.Philox(seed)))


def test_a_genome_is_the_weights_of_the_network_and_the_body_of_its_groups():
    encoding = load("cube", SMALL).make_encoding()
    genomes = genomes_of(encoding, 5)
    robots = encoding.express(genomes)
    (brain,) = robots.body.elements.controllers
    assert brain.n_outputs == 4
    np.testing.assert_allclose(
        robots.stacked["weights"], 4.0 * (2.0 * genomes[:, : brain.n_weights] - 1.0), atol=1e-6
    )
    for group in range(4):
        stiffness = robots[2].stiffness[encoding.group == group]
        assert np.ptp(np.log(stiffness)) < 1e-9


def test_groups_have_a_rhythm_of_their_own_under_what_the_network_adds():
    changes = {"encoding.rhythm": 0.2, "encoding.response": 0.1, "encoding.symmetry": "x"}
    encoding = load("cube", SMALL | changes).make_encoding()
    genomes = genomes_of(encoding, 5)
    robots = encoding.express(genomes)
    (brain,) = robots.body.elements.controllers
    assert brain.response == 0.1 and encoding.genome_shape == (brain.n_weights + 4 * 4,)
    amplitude = robots.stacked["amplitude"] / robots.body.lengths
    assert 0.05 < amplitude.max() <= 0.2
    for group in range(4):
        own = np.intersect1d(np.flatnonzero(encoding.group == group), encoding.own)
        for values in (amplitude[:, own], robots.stacked["phase"][:, own]):
            assert np.abs(values - values[:, :1]).max(initial=0.0) < 1e-12
    apart = np.sin(
        robots.stacked["phase"] + 2 * np.pi * 0.5
    )  # mirrored springs, half a cycle later
    mirrored = np.setdiff1d(np.arange(28), encoding.own)
    sines = np.sin(robots.stacked["phase"])
    for spring in mirrored:
        image = encoding.own[encoding._row[spring]]
        np.testing.assert_allclose(sines[:, spring], apart[:, image], atol=1e-9)


def test_the_same_robot_sees_the_goal_where_it_is():
    """Aimed at different goals it goes different ways, and its fitness is the mean of both."""
    config = load("cube", SEEING)
    encoding, evaluator = config.make_encoding(), Evaluator(config)
    robots = encoding.express(genomes_of(encoding, 6))
    fitness, ways = evaluator(robots).fitness, []
    for goal in GOALS:
        aimed = robots.body.aimed(goal).variants(**robots.stacked)
        simulation = ws.Simulation(
            aimed, config.scene.build(), dt=1e-3, integrator=config.simulation.integrator
        )
        start = simulation.run(0.5).center_of_mass
        end = simulation.run(1.0).center_of_mass
        far = [np.hypot(*(x[:, :2] - goal[:2]).T) for x in (start, end)]
        ways.append(far[0] - far[1])
        assert np.abs(end - start).max() > 0.0
    np.testing.assert_allclose(fitness, np.mean(ways, axis=0), atol=1e-12)
    assert np.abs(ways[0] - ways[1]).max() > 1e-3


def test_brightness_is_the_mean_light_of_a_lamp_that_moves():
    config = load(
        "cube", SEEING | {"task.fitness": "brightness", "task.goal_motion": [0.3, 0.0, 0.0]}
    )
    encoding = config.make_encoding()
    robots = encoding.express(genomes_of(encoding, 2))
    fitness = Evaluator(config)(robots).fitness
    assert ((fitness > 0.2) & (fitness < 1.0)).all()
    nearer = load("cube", SEEING | {"task.fitness": "brightness", "task.goals": [[0.3, 0, 0]]})
    assert (Evaluator(nearer)(robots).fitness > fitness).all()


@pytest.mark.parametrize("optimizer", ["genetic", "cma"])
def test_seekers_learn_to_come_nearer(optimizer):
    search = Search(load("cube", SEEING | {"optimizer.type": optimizer, "generations": 10}))
    first = search.step().scores.fitness
    while not search.finished:
        search.step()
    assert search.optimizer.best_fitness > np.nanmax(first) + 0.01


def test_every_trial_has_hills_of_its_own():
    config = load("rough-walker")
    scenes = [_of_next_seeds(config.scene, trial).build() for trial in range(3)]
    hills = [scene.obstacles[0].heights for scene in scenes]
    assert not np.array_equal(hills[0], hills[1])
    np.testing.assert_array_equal(hills[1], ws.rough_terrain(2, 0.08, 0.4, 6.0).heights)
    assert hills[2].max() == 0.0 and hills[2].min() == pytest.approx(-0.08)


def test_goals_that_are_missing_are_asked_for():
    with pytest.raises(ConfigError, match=r"task.goals: none given, and 'goal'"):
        load("cube", SMALL | {"encoding.sensors": ["goal"]})
    with pytest.raises(ConfigError, match=r"task.goals: none given, and 'approach'"):
        load("cube", {"task.fitness": "approach"})


def test_points_spread_out():
    corners = ws.shapes.lattice(2, 1, 1).positions
    chosen = corners[spread_out(corners, 4)]
    gaps = np.linalg.norm(chosen[:, None] - chosen[None], axis=2)[np.triu_indices(4, 1)]
    assert gaps.min() > 0.14
    assert len(spread_out(np.zeros((3, 3)), 3)) == 1
