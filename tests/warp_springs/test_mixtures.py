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
    """A world with all surroundings, each in a random strength."""
    obstacles = [
        ws.Plane((draw(number(-0.3, 0.3)), 0.1, 1.0), -0.002, kinetic_friction=0.2),
        ws.Sphere((0.1, 0.1, -0.2), draw(number(0.15, 0.2)), static_friction=0.1),
        ws.Box((0.0, 0.0, -0.1), (0.3, 0.2, draw(number(0.1, 0.2)))),
        ws.HeightField(0.002 * np.cos(np.arange(30.0)).reshape(5, 6), 0.2, origin=(-0.5, -0.5, 0)),
    ]
    return ws.Scene(
        gravity=(draw(number(-3, 3)), draw(number(-3, 3)), -9.81),
        ground=ws.Ground(static_friction=draw(number(0.3, 1.0)), kinetic_friction=0.3),
        obstacles=draw(st.permutations(obstacles)),
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
    # A mass that starts at z = 0 touches or not by its last bit, in which layouts may differ.
    body = body.moved((0, 0, draw(number(1e-4, 0.01)) - body.bounds[0, 2]))
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
    brain = ws.Controller(
        [
            ws.sensors.contact(range(m)),
            ws.sensors.force([0], full=20.0),
            ws.sensors.length([draw(st.integers(0, s - 1))]),
            ws.sensors.velocity(),
            ws.sensors.tilt(),
            ws.sensors.goal((1, 2, 0), motion=(0.1, 0, 0)),
            ws.sensors.light([m - 1], (0.5, 0, 0.5)),
            ws.sensors.clock(draw(number(0.05, 1.0))),
        ],
        muscles=[0, s - 1],
        hidden=draw(st.integers(1, 3)),
        recurrent=True,
        reach=0.1,
        rate=200.0,
    )
    body = body.controlled(brain.replace(weights=rng.normal(size=brain.n_weights)))
    held = draw(st.sampled_from(["x", ws.Plane((1, 2, 1), 0.1), ws.Sphere((0, 0, 0.05), 0.1)]))
    return body.fixed([1], held) if isinstance(held, str) else body.held_to(held, [1])


def run(robots, scene, layout, precision="float64", world="apart"):
    simulation = ws.Simulation(robots, scene, DT, layout=layout, precision=precision, world=world)
    return simulation.run(DURATION, fps=100, energy=True)


def check_agreement(robots, scene, world="apart"):
    """Healthy robots are finite, and in every layout the same; mixed precision stays close."""
    lanes = run(robots, scene, "lanes", world=world)
    others = [run(robots, scene, layout, world=world) for layout in ("flat", "block")]
    close = run(robots, scene, "lanes", "mixed", world=world)
    # What hangs on the last bit, as whether a mass at z = 0 touches, none can tell.
    ways = np.random.default_rng(1).normal(size=(len(robots), 3)) * 1e-8
    moved = [[r.moved(sign * way) for r, way in zip(robots, ways, strict=True)] for sign in (1, -1)]
    shaken = [run(those, scene, "lanes", world=world) for those in moved]
    for i, healthy in enumerate(lanes.status == ws.Status.OK):
        for result in (lanes, *others, close):
            assert np.isfinite(result.frames(i)).all() and np.isfinite(result.velocities(i)).all()
        for result in others:
            assert result.status[i] == lanes.status[i]
            assert np.array_equal(result.broken(i), lanes.broken(i), equal_nan=True)
            assert np.abs(result.frames(i) - lanes.frames(i)).max() < 1e-9
            assert np.abs(result.velocities(i) - lanes.velocities(i)).max() < 1e-6
            assert np.abs(result.signals(i) - lanes.signals(i)).max() < 1e-6
            residual = result.energy.residual[i] - lanes.energy.residual[i]
            assert not healthy or np.abs(residual).max() < 1e-7
        firm = all(np.abs(r.frames(i) - lanes.frames(i)).max() < 1e-6 for r in shaken)
        if healthy and firm:
            assert np.abs(close.frames(i) - lanes.frames(i)).max() < 1e-4


EXAMPLES = settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow])


@EXAMPLES
@given(scene=scenes(), robot=robots())
def test_random_mixtures_are_the_same_in_all_layouts(scene, robot):
    check_agreement([robot] * 2, scene)


@EXAMPLES
@given(scene=scenes(), robot=robots(), other=robots(), gap=number(0.0, 0.01))
def test_random_mixtures_that_collide_are_the_same_in_all_layouts(scene, robot, other, gap):
    scene = replace(scene, collisions=ws.Collisions(kinetic_friction=0.2, static_friction=0.4))
    above = robot.bounds[1, 2] - other.bounds[0, 2] + 0.005 + gap
    other = other.moved((0.0, 0.0, above)).moving((0.0, 0.0, -1.0))
    check_agreement([robot, other], scene, world="together")
