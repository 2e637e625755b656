"""Robots that go on move to the places of those that were stopped, and nobody notices."""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.kernels.dialect import native_width

SCENE = ws.Scene(ground=ws.Ground(), damping=1.0)


def some_wild(count: int) -> list[ws.Robot]:
    """Cubes, of which two in three are too fast from the start or after a while."""
    rng, robots = np.random.default_rng(5), []
    for index in range(count):
        cube = ws.shapes.cube(stiffness=1000.0 + index).moved((0.0, 0.0, 0.02))
        cube = cube.replace(
            amplitude=0.1 * cube.rest_length, phase=rng.uniform(0, 6, cube.n_springs), omega=6.0
        )
        if index % 3:
            speeds = cube.velocities.copy()
            speeds[index % 8] = (2e4 * (index % 3), 0.0, 0.0)
            cube = cube.replace(velocities=speeds)
        robots.append(cube)
    return robots


@pytest.mark.parametrize("precision", ["float64", "float32", "mixed"])
def test_those_who_go_on_fill_as_few_bundles_as_they_can(precision, monkeypatch):
    from warp_springs.engine.slices import Slice

    monkeypatch.setattr(Slice, "launch_work", 1.0)  # a launch for each step
    width = native_width(precision)
    robots, options = some_wild(6 * width), {"dt": 1e-3, "precision": precision, "threads": 1}
    sim = ws.Simulation(robots, SCENE, **options)
    first = sim.run(0.2, fps=50, energy=True)
    then = sim.run(0.1, fps=50)
    good = np.flatnonzero(then.status == ws.Status.OK)
    assert len(good) == 2 * width
    assert len(np.unique(sim._batch.slots.bundle[good])) == 2
    for i in (0, 3, 1, 2, 6 * width - 3):  # two of them are stopped
        alone = ws.Simulation(robots[i], SCENE, **options)
        one, two = alone.run(0.2, fps=50, energy=True), alone.run(0.1, fps=50)
        for together, apart in ((first, one), (then, two)):
            assert together.status[i] == apart.status[0]
            assert (together.frames(i) == apart.frames(0)).all()
            assert (together.positions(i) == apart.positions(0)).all()
            assert (together.center_of_mass[i] == apart.center_of_mass[0]).all()
        assert (first.energy.residual[i] == one.energy.residual[0]).all()
        assert (first.energy.work[i] == one.energy.work[0]).all()


def test_robots_of_several_topologies_close_their_ranks_at_once(monkeypatch):
    from warp_springs.engine.slices import Slice

    monkeypatch.setattr(Slice, "launch_work", 1.0)
    width = native_width("float64")
    cubes = some_wild(6 * width)
    reduced = [
        cube.replace(
            springs=cube.springs[1:],
            **{
                name: getattr(cube, name)[1:]
                for name in ("stiffness", "rest_length", "amplitude", "phase")
            },
        )
        for cube in cubes[: 3 * width]
    ]
    robots, options = cubes + reduced, {"dt": 1e-3, "precision": "float64", "threads": 1}
    sim = ws.Simulation(robots, SCENE, **options)
    end = sim.run(0.1)
    good = np.flatnonzero(end.status == ws.Status.OK)
    assert len(good) == 3 * width
    assert len(np.unique(sim._batch.slots.bundle[good])) == 3
    for i in good[:: width // 2]:
        alone = ws.Simulation(robots[i], SCENE, **options).run(0.1)
        assert (end.positions(i) == alone.positions(0)).all()
