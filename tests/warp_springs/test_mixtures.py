"""Random scenes that mix all elements: healthy, finite, and in every layout the same."""

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import warp_springs as ws

DT, DURATION = 5e-4, 0.04
number = st.floats
chance = st.booleans()


@st.composite
def scenes(draw):
    """A world with some of all surroundings."""
    obstacles = [
        ws.Plane((draw(number(-0.3, 0.3)), 0.1, 1.0), -0.002, kinetic_friction=0.2),
        ws.Sphere((0.1, 0.1, -0.2), draw(number(0.15, 0.2)), static_friction=0.1),
        ws.Box((0.0, 0.0, -0.1), (0.3, 0.2, draw(number(0.1, 0.2)))),
        ws.HeightField(0.002 * np.cos(np.arange(30.0)).reshape(5, 6), 0.2, origin=(-0.5, -0.5, 0)),
    ]
    return ws.Scene(
        gravity=(draw(number(-3, 3)), draw(number(-3, 3)), -9.81),
        ground=ws.Ground(static_friction=draw(number(0.3, 1.0)), kinetic_friction=0.3),
        obstacles=tuple(obstacles[: draw(st.integers(1, 4))]),
        damping=draw(number(0.0, 5.0)) + 0.01,
        drag=draw(number(0.001, 0.05)),
        wind=(draw(number(-3, 3)), 1.0, 0.0),
        water=ws.Water(level=draw(number(0.0, 0.1)), density=0.5, drag=0.1),
    )


@st.composite
def robots(draw):
    """A robot that has every element, each in a random strength and in random places."""
    body = draw(
        st.sampled_from([ws.shapes.cube(), ws.shapes.lattice(2, 1, 1), ws.shapes.tetrahedron()])
    )
    m, s = body.n_masses, body.n_springs
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    axis, angle = rng.normal(size=3) + 2.0, draw(number(0, 6))
    body = body.rotated(axis, angle).spinning(rng.normal(size=3) * 3)
    body = body.moved((0, 0, draw(number(0.0, 0.01)) - body.bounds[0, 2]))
    body = body.breathing(draw(number(0.02, 0.1)), draw(number(1, 30)), phase=rng.uniform(0, 6, s))

    def springs(share=0.4):
        return np.flatnonzero(rng.uniform(size=s) < share)

    times = np.cumsum(rng.uniform(0.005, 0.02, draw(st.integers(2, 5))))
    strong = rng.permutation(s) < draw(st.integers(0, 3))  # up to three springs are weak
    body = (
        body.with_harmonics([0.002, 0.001], rng.uniform(0, 6, 2), springs())
        .with_omegas(draw(number(0, 50)), springs())
        .with_curve([-0.001, 0.002], [1.0, 0.5, 2.0], springs())
        .with_hardening(draw(number(0, 1e6)), springs())
        .with_cables(springs(0.2))
        .with_dashpots(draw(number(0, 0.3)), springs())
        .with_limits(breaks=np.where(strong, 5.0, 1e6))
        .with_limits(yields=draw(number(1e4, 1e6)), area=1e-4, springs=springs(0.2))
        .with_stiffness_in_time(times, rng.uniform(0.5, 2.0, len(times)), springs())
        .with_winch(times, rng.uniform(-0.01, 0.01, len(times)), springs())
        .pushed([draw(st.integers(0, m - 1))], rng.normal(size=3), 0.011, draw(number(1e-3, 0.1)))
        .tethered([m - 1], draw(number(1, 300)), point=(0, 0, 0.2))
        .shod([0, 2], static_friction=draw(number(0, 1)), kinetic_friction=0.0)
    )
    held = draw(st.sampled_from(["x", ws.Plane((1, 2, 1), 0.1), ws.Sphere((0, 0, 0.05), 0.1)]))
    return body.fixed([1], held) if isinstance(held, str) else body.held_to(held, [1])


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes(), robot=robots())
def test_random_mixtures_are_the_same_in_all_layouts(scene, robot):
    # So many obstacles, one kernel: those that are left are far below.
    spare = 5 - len(scene.obstacles)
    deep = tuple(ws.Plane((0, 0, 1), -50.0 - i) for i in range(spare))
    scene = replace(scene, obstacles=scene.obstacles + deep)

    def run(layout):
        return ws.Simulation(robot, scene, DT, layout=layout).run(DURATION, fps=100, energy=True)

    lanes, flat, block = map(run, ("lanes", "flat", "block"))
    healthy = lanes.status[0] == ws.Status.OK
    for result in (lanes, flat, block):
        assert result.status[0] == lanes.status[0]
        assert np.isfinite(result.frames(0)).all() and np.isfinite(result.velocities(0)).all()
        assert np.array_equal(result.broken(0), lanes.broken(0), equal_nan=True)
        assert np.abs(result.frames(0) - lanes.frames(0)).max() < 1e-9
        assert not healthy or np.abs(result.energy.residual - lanes.energy.residual).max() < 1e-7
