"""Growth by local rules, before a trial and within it: towards light, no further than material."""

from __future__ import annotations

import numpy as np
import pytest

import warp_springs as ws
from evolve import Evaluator, load
from evolve.bodies.build import robot
from evolve.bodies.cells import LEFT, TIP, UP, Cells, Tissue
from evolve.bodies.growth import Light, Wish, grow
from evolve.encodings import ENCODINGS
from evolve.encodings.evolving import BodySettings
from evolve.encodings.sprout import CONTRAST, LEVEL, LIMIT, PATIENCE, READINESS, STRONGEST
from evolve.errors import ConfigError

AHEAD = Light((2.0, 0.0, 0.0))


def rng(seed):
    return np.random.Generator(np.random.Philox(seed))


def grown(urge, light=AHEAD, material=100.0, most=6, least=1, **more):
    """A body whose rule says how much a bud wants to grow, and more of it."""

    def rule(buds):
        return [Wish(urge(bud), Tissue(), **more) for bud in buds]

    return grow(Cells(0.1, most, 9.0), Tissue(), rule, light, material, least)


@pytest.mark.parametrize(
    ("place", "way"),
    [((9.0, 0, 0), (1, 0, 0)), ((0.05, 9.0, 0), (0, 1, 0)), ((0.05, 0, 9.0), (0, 0, 1))],
)
def test_cells_that_want_light_grow_towards_the_lamp(place, way):
    cells = grown(lambda bud: bud.facing - 0.9, Light(place))
    steps = np.diff(cells.centres, axis=0)
    np.testing.assert_allclose(steps, np.tile(0.1 * np.array(way), (5, 1)), atol=1e-9)


def test_the_strongest_wish_comes_first_and_nobody_grows_who_does_not_want():
    urges = {TIP: 0.2, UP: 0.8, LEFT: 0.5}
    cells = grown(lambda bud: urges.get(bud.side, -1.0) if bud.cell == 0 else 0.0, most=9)
    assert cells.parents == [-1, 0, 0, 0]
    np.testing.assert_allclose(cells.centres[1] - cells.centres[0], (0, 0, 0.1), atol=1e-9)
    np.testing.assert_allclose(cells.centres[2] - cells.centres[0], (0, 0.1, 0), atol=1e-9)


def test_growth_ends_with_the_material():
    for material, cells in [(0.9, 1), (1.3, 2), (3.8, 3), (3.95, 4)]:
        assert len(grown(lambda bud: float(bud.side == UP), material=material, length=1.3)) == cells


def test_a_body_of_few_cells_grows_where_it_is_minded_least():
    urges = {TIP: -0.2, UP: -0.8}
    cells = grown(lambda bud: urges.get(bud.side, -1.0), least=3, most=9)
    np.testing.assert_allclose(np.diff(cells.centres, axis=0), [(0.1, 0, 0)] * 2, atol=1e-9)


def test_what_a_cell_is_told_is_sensed_by_those_that_grow_on_it():
    def rule(buds):
        # Count to three, then stop.
        return [
            Wish(float(bud.side == TIP and bud.state < 0.5), Tissue(), state=bud.state + 0.2)
            for bud in buds
        ]

    assert len(grow(Cells(0.1, 20, 9.0), Tissue(), rule, AHEAD, 100.0)) == 1 + 3


def test_left_and_right_grow_alike():
    cells = grown(lambda bud: 0.5 + 0.3 * abs(bud.outward[1]), most=13, turn=(-0.2, 0.4))
    body = robot(cells.plan(), BodySettings())
    image = body.positions * [1.0, -1.0, 1.0]
    assert np.linalg.norm(image[:, None] - body.positions, axis=2).min(axis=1).max() < 1e-6
    assert np.ptp(body.positions[:, 1]) > 0.3


def test_a_lamp_on_the_other_side_makes_the_mirror_image():
    cls = ENCODINGS["growth"]
    left, right = (cls(None, cls.Settings(lamp=(0.3, y, 0.2))) for y in (0.8, -0.8))
    genomes = left.random(30, rng(5))
    bodies = [[e.body(g).centres for g in genomes] for e in (left, right)]
    mirrored = [
        len(a) == len(b) and np.abs(a * [1, -1, 1] - b).max() < 1e-9
        for a, b in zip(*bodies, strict=True)
        if len(a) > 4
    ]
    # Equal wishes are granted in an order of the sides, so few bodies are cut off otherwise.
    assert len(mirrored) > 10 and np.mean(mirrored) > 0.7
    assert any(np.abs(c[:, 1]).max() > 0.05 for c in bodies[0])


def sprout(genes, monkeypatch, cells=4, **changes):
    """A seedling whose plan is a column of cells."""
    cls = ENCODINGS["sprout"]
    encoding = cls(None, cls.Settings(stiffness=(400.0, 400.0), far=0.3, **changes))

    def column(self, genome):
        body = self.cells()
        body.seed(Tissue())
        for cell in range(cells - 1):
            body.grow(cell, TIP, Tissue())
        return body

    monkeypatch.setattr(cls, "body", column)
    genome = encoding.random(1, rng(1))
    genome[:, -4:] = 0.5 + 0.5 * np.array(genes) / STRONGEST
    return encoding.express(genome)[0]


def genes(**given):
    found = [0.0] * 4
    for name, value in given.items():
        found[
            {"level": LEVEL, "contrast": CONTRAST, "patience": PATIENCE, "readiness": READINESS}[
                name
            ]
        ] = value
    return found


SCENE = ws.Scene(damping=4.0)


def test_a_seedling_is_at_rest_and_becomes_what_was_planned(monkeypatch):
    seedling = sprout(genes(readiness=3.0), monkeypatch, material=20.0)
    np.testing.assert_allclose(seedling.rest_length, seedling.lengths)
    assert np.ptp(seedling.positions[:, 2]) == pytest.approx(0.4 * 0.4)
    assert seedling.mass == pytest.approx(10.0)
    assert seedling.masses[:4].sum() > 9.0
    weightless = ws.Scene(gravity=(0, 0, 0), ground=None, damping=8.0)
    end = ws.Simulation([seedling], weightless, dt=1e-3).run(6.0)
    np.testing.assert_allclose(end.signals(0), LIMIT, atol=1e-9)
    upper = (seedling.springs >= 4).all(axis=1)
    # Every spring above the pot is 0.4 + 1.2 (1 - 0.4) of what was planned, and at rest.
    full = seedling.rest_length[upper] / 0.4
    wanted = full * (0.4 + 0.6 * LIMIT)
    np.testing.assert_allclose(end.rest_lengths(0)[upper], wanted, rtol=1e-6)
    i, j = seedling.springs[upper].T
    x = end.positions(0)
    np.testing.assert_allclose(np.linalg.norm(x[i] - x[j], axis=1), wanted, rtol=0.02)


def test_who_waits_grows_after_the_cell_below(monkeypatch):
    seedling = sprout(genes(readiness=0.5, patience=2.0), monkeypatch, material=20.0)
    simulation = ws.Simulation([seedling], SCENE, dt=1e-3)
    half = []
    for _ in range(60):
        growth = simulation.run(0.25).signals(0).reshape(4, 4).mean(axis=1)
        half.append(growth > 0.5)
    first = np.argmax(half, axis=0)
    assert np.all(half[-1]) and (np.diff(first) >= 2).all()


def test_it_leans_to_the_lamp_and_ends_with_the_material(monkeypatch):
    seedling = sprout(genes(readiness=0.3, contrast=-40.0), monkeypatch, material=2.5)
    tips = []
    for x in (0.5, -0.5):
        lit = seedling.aimed((x, 0.0, 0.3))
        end = ws.Simulation([lit], SCENE, dt=1e-3).run(8.0)
        assert end.status[0] == 0
        assert end.signals(0).sum() == pytest.approx(10.0, abs=1e-9)
        assert end.signals(0).max() <= LIMIT + 1e-12
        tips.append(end.positions(0)[-4:, 0].mean())
    assert tips[0] > 0.03 and tips[1] < -0.03
    assert tips[0] == pytest.approx(-tips[1], abs=0.01)


def test_nothing_grows_in_the_dark(monkeypatch):
    seedling = sprout(genes(level=6.0, readiness=-1.0), monkeypatch)
    light, dark = (seedling.aimed((0.0, 0.0, z)) for z in (0.4, 3.0))
    end = ws.Simulation([light, dark], SCENE, dt=1e-3).run(3.0)
    assert end.signals(0).sum() > 3.0 and (end.signals(1) == 0.0).all()


def test_the_work_of_growing_is_in_the_ledger(monkeypatch):
    seedling = sprout(genes(readiness=0.5), monkeypatch)
    left = []
    for dt in (1e-3, 2.5e-4):
        energy = ws.Simulation([seedling], SCENE, dt=dt).run(4.0, fps=20, energy=True).energy
        lifted = energy.gravity[0, -1] - energy.gravity[0, 0]
        assert lifted > 0.2 and energy.work[0, -1] > lifted
        left.append(np.abs(energy.residual[0]).max() / energy.work[0, -1])
    assert left[0] < 0.03 and left[1] < 0.5 * left[0]


def test_random_sprouts_keep_to_their_limits_and_live_through_a_trial():
    config = load("sprout", {"task.measure": 1.5})
    encoding, evaluator = config.make_encoding(), Evaluator(config)
    seedlings = encoding.express(encoding.random(48, rng(3)))
    assert max(s.n_springs for s in seedlings) == 28 + 22 * 11, "more buds than material"
    assert min(s.bounds[0, 2] for s in seedlings) == pytest.approx(0.0, abs=1e-12)
    scores = evaluator(seedlings)
    assert (scores.status == 0).mean() > 0.95
    assert np.nanmax(scores.fitness) > np.nanmin(scores.fitness) + 0.05


def test_a_sprout_without_a_lamp_is_refused():
    with pytest.raises(ConfigError, match=r"task.goals: none given, and 'light' needs one"):
        load("sprout", {"task.goals": []})
