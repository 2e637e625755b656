"""Different robots cut from one lattice share bundles; each keeps the bits it has alone."""

import numpy as np
import pytest

import warp_springs as ws

SCENE = ws.Scene(ground=ws.Ground(), damping=1.0, drag=0.01)
MASK = np.array([[[1, 1], [1, 1]], [[1, 1], [1, 1]], [[1, 1], [1, 1]]], bool)


def cut_from_a_lattice(count: int) -> list[ws.Robot]:
    """Robots of one lattice, no two alike, that breathe and fall onto the ground."""
    rng, found = np.random.default_rng(3), {}
    while len(found) < count:
        mask = MASK.copy()
        mask[tuple(rng.integers(0, MASK.shape, (rng.integers(1, 5), 3)).T)] = False
        body = ws.shapes.voxels(mask) if mask.any() else None
        if body is not None:
            found.setdefault(body.topology, body)
    robots = []
    for body in found.values():
        phase = rng.uniform(0.0, 2.0 * np.pi, body.n_springs)
        moving = body.replace(amplitude=0.1 * body.rest_length, phase=phase, omega=6.0)
        robots.append(moving.moved((0.0, 0.0, 0.01)).spinning((1.0, -2.0, 0.5)))
    return robots


def merged(sim: ws.Simulation) -> int:
    """Bundles that different robots share."""
    return sum(group.count for group in sim._batch.groups if group.features.traits.merged)


@pytest.mark.parametrize("precision", ["float64", "float32", "mixed"])
def test_a_robot_keeps_its_bits_beside_different_ones(precision):
    robots = cut_from_a_lattice(20)
    options = {"dt": 1e-3, "precision": precision}
    sim = ws.Simulation(robots, SCENE, **options)
    assert merged(sim) >= 1
    together = sim.run(0.3, fps=20, energy=True)
    for i in (0, 7, 13, 19):
        alone = ws.Simulation(robots[i], SCENE, **options).run(0.3, fps=20, energy=True)
        assert (together.positions(i) == alone.positions(0)).all()
        assert (together.velocities(i) == alone.velocities(0)).all()
        assert (together.frames(i) == alone.frames(0)).all()
        assert (together.center_of_mass[i] == alone.center_of_mass[0]).all()
        for part in ("kinetic", "gravity", "spring", "ground", "work", "residual"):
            assert (getattr(together.energy, part)[i] == getattr(alone.energy, part)[0]).all(), part
    springs = sum(robot.n_springs for robot in robots)
    assert together.spring_evaluations == 3 * 300 * springs


def test_who_is_stopped_disturbs_nobody():
    robots = cut_from_a_lattice(20)
    wild = robots[4].velocities.copy()
    wild[0] = (5e4, 0.0, 0.0)
    robots[4] = robots[4].replace(velocities=wild)
    sim = ws.Simulation(robots, SCENE, dt=1e-3)
    assert merged(sim) >= 1
    together = sim.run(0.2)
    alone = ws.Simulation(robots[4], SCENE, dt=1e-3).run(0.2)
    assert together.status[4] == alone.status[0] != ws.Status.OK
    assert together.status_time[4] == alone.status_time[0]
    assert (np.delete(together.status, 4) == ws.Status.OK).all()
    for i in (3, 5):
        alone = ws.Simulation(robots[i], SCENE, dt=1e-3).run(0.2)
        assert (together.positions(i) == alone.positions(0)).all()


def test_robots_off_the_lattice_or_with_obstacles_stay_alone():
    robots = cut_from_a_lattice(20)
    bent = [r.replace(positions=r.positions + 0.003 * np.sin(9.0 * r.positions)) for r in robots]
    assert merged(ws.Simulation(bent, SCENE, dt=1e-3)) == 0
    ball = ws.Scene(ground=ws.Ground(), obstacles=(ws.Sphere(center=(9.0, 9.0, 0.0), radius=1.0),))
    assert merged(ws.Simulation(robots, ball, dt=1e-3)) == 0


@pytest.mark.parametrize("precision", ["float64", "float32", "mixed"])
@pytest.mark.parametrize(
    "cells", [(1, 1, 1), (3, 2, 2), (3, 3, 3), (4, 3, 3), (5, 4, 3), (5, 4, 4)]
)
def test_a_lone_robot_has_the_bits_of_a_bundle_whatever_its_size(precision, cells):
    """Masses as lanes, one to many registers of them, or quads, or a robot in each lane."""
    body = ws.shapes.lattice(*cells)
    phase = np.linspace(0.0, 6.0, body.n_springs)
    body = body.replace(amplitude=0.1 * body.rest_length, phase=phase, omega=6.0)
    body = body.moved((0.0, 0.0, 0.01)).spinning((1.0, -2.0, 0.5))
    options = {"dt": 1e-3, "precision": precision, "layout": "lanes"}
    alone = ws.Simulation(body, SCENE, **options).run(0.1)
    many = ws.Simulation([body] * 3, SCENE, **options).run(0.1)
    assert (alone.positions(0) == many.positions(2)).all()
    assert (alone.velocities(0) == many.velocities(2)).all()


def test_a_few_of_each_kind_share_bundles_with_others():
    """Copies of many bodies, moved apart: each keeps the bits that it has alone."""
    kinds = cut_from_a_lattice(24)
    robots = [body.moved((0.0, 0.0, 0.001 * i)) for body in kinds for i in range(3)]
    sim = ws.Simulation(robots, SCENE, dt=1e-3)
    shared = sum(g.count for g in sim._batch.groups if g.features.width > 1)
    assert merged(sim) == shared >= 72 // 8, "nobody has a bundle for three"
    together = sim.run(0.1)
    for i in (0, 1, 40, 71):
        alone = ws.Simulation(robots[i], SCENE, dt=1e-3).run(0.1)
        assert (together.positions(i) == alone.positions(0)).all()
    # Off a lattice three of a kind share a bundle of their own.
    bent = [r.replace(positions=r.positions + 0.003 * np.sin(9.0 * r.positions)) for r in robots]
    sim = ws.Simulation(bent, SCENE, dt=1e-3)
    assert merged(sim) == 0
    assert sum(g.count for g in sim._batch.groups if g.features.width > 1) == 24
