"""The same robot gives the same bits: alone, in any batch, in any slot, with any threads."""

import dataclasses
import functools

import numpy as np
import pytest

import warp_springs as ws

DT = 5e-4
DURATION = 0.1
FPS = 50
SCENE = ws.Scene(
    gravity=(0.3, 0.1, -9.81),
    ground=ws.Ground(static_friction=0.6, kinetic_friction=0.4),
    damping=0.5,
    drag=0.01,
)
SETTINGS = [
    ("float64", "leapfrog"),
    ("float32", "leapfrog"),
    ("float64", "chin4"),
    ("float32", "chin4"),
    ("float64", "euler"),
    ("float32", "euler"),
    ("mixed", "chin4"),
    ("mixed", "euler"),
]


@functools.cache
def bodies():
    """One robot of each kind that a batch sorts differently: topology, actuation, masses."""
    cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)
    lattice = ws.shapes.lattice(2, 1, 1, stiffness=1500.0)
    breathing = lattice.replace(
        amplitude=0.08 * lattice.rest_length,
        phase=np.linspace(0.0, 6.0, lattice.n_springs),
        omega=12.0,
    )
    landing = [
        cube.rotated((1, 2, 3), 0.7).spinning((3, -2, 4)),
        breathing.rotated((1, 0, 2), 0.4).spinning((1, 2, 3)),
        lattice.rotated((0, 1, 2), 0.3),
        breathing.replace(masses=np.linspace(0.02, 0.3, lattice.n_masses)),
        ws.shapes.tetrahedron(edge=0.1, mass=0.4, stiffness=1000.0).moving((0.5, 0.2, 0)),
    ]
    return tuple(body.moved((0, 0, 5e-3 - body.bounds[0, 2])) for body in landing)


def strangers(count, rng):
    """Other robots of the same and of other topologies, each a little different."""
    pool = [*bodies(), ws.shapes.octahedron(edge=0.1, mass=0.6, stiffness=1000.0)]
    robots = []
    for i in range(count):
        body = pool[i % len(pool)]
        stiffness = body.stiffness * rng.uniform(0.5, 2.0, body.n_springs)
        lift = (*rng.uniform(-1, 1, 2), rng.uniform(0, 0.05))
        robots.append(body.replace(stiffness=stiffness).moved(lift))
    return robots


def simulate(robots, precision, integrator, **options):
    simulation = ws.Simulation(
        robots, SCENE, dt=DT, precision=precision, integrator=integrator, **options
    )
    return simulation.run(DURATION, fps=FPS, energy=True)


def fingerprint(result, robot):
    """Everything a result says about a robot, as bytes."""
    energy = result.energy
    parts = [
        result.positions(robot),
        result.velocities(robot),
        result.center_of_mass[robot],
        result.status[robot],
        result.status_time[robot],
        result.frames(robot),
        *(getattr(energy, field.name)[robot] for field in dataclasses.fields(energy)),
    ]
    return tuple(np.asarray(part).tobytes() for part in parts)


@pytest.fixture(scope="module", params=SETTINGS, ids="-".join)
def alone(request):
    """The settings, and the fingerprint of every body simulated alone."""
    prints = [fingerprint(simulate(body, *request.param), 0) for body in bodies()]
    assert len(set(prints)) == len(prints)
    return request.param, prints


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("count", [10, 1000])
def test_same_bits_alone_and_in_any_slot_of_a_batch(alone, count, threads):
    settings, expected = alone
    rng = np.random.default_rng(count)
    robots = strangers(count, rng)
    copies = min(4, count // len(bodies()))
    slots = rng.permutation(count)[: copies * len(bodies())].reshape(copies, -1)
    slots[0, 0], slots[-1, -1] = _ends(slots, count)
    for row in slots:
        for slot, body in zip(row, bodies(), strict=True):
            robots[slot] = body
    result = simulate(robots, *settings, threads=threads)
    for row in slots:
        for which, slot in enumerate(row):
            assert fingerprint(result, slot) == expected[which], f"body {which} in slot {slot}"


def _ends(slots, count):
    """The first and the last slot of the batch, if they are still free for the two corners."""
    taken = set(slots.ravel()) - {slots[0, 0], slots[-1, -1]}
    first = 0 if 0 not in taken else slots[0, 0]
    last = count - 1 if count - 1 not in taken else slots[-1, -1]
    return first, last


@pytest.mark.parametrize("size", [2, 3, 7, 8, 9, 16, 17])
def test_same_bits_in_full_and_in_partly_filled_bundles(alone, size):
    settings, expected = alone
    result = simulate([bodies()[1]] * size, *settings)
    assert {fingerprint(result, slot) for slot in range(size)} == {expected[1]}


def test_variants_give_the_bits_of_the_robots_they_stand_for(alone):
    (precision, integrator), expected = alone
    body = bodies()[1]
    rng = np.random.default_rng(0)
    stiffness = body.stiffness * rng.uniform(0.5, 2.0, (20, body.n_springs))
    stiffness[13] = body.stiffness
    variants = body.variants(stiffness=stiffness)
    stacked = simulate(variants, precision, integrator)
    listed = simulate(list(variants), precision, integrator)
    for i in range(20):
        assert fingerprint(stacked, i) == fingerprint(listed, i)
    assert fingerprint(stacked, 13) == expected[1]


def test_own_steps_depend_on_the_robot_alone():
    rng = np.random.default_rng(5)
    stiff = [
        body.replace(stiffness=factor * body.stiffness)
        for body in bodies()
        for factor in (1.0, 9.0, 81.0)
    ]
    batch = strangers(2 * len(stiff), rng)
    batch[::2] = stiff
    assert len(set(ws.Simulation(batch, SCENE, dt="auto").robot_dt)) > 2
    together = ws.Simulation(batch, SCENE, dt="auto").run(DURATION, fps=FPS, energy=True)
    for i, robot in enumerate(stiff):
        lonely = ws.Simulation(robot, SCENE, dt="auto").run(DURATION, fps=FPS, energy=True)
        assert fingerprint(together, 2 * i) == fingerprint(lonely, 0)


def test_same_bits_twice(alone):
    settings, expected = alone
    assert fingerprint(simulate(bodies()[0], *settings), 0) == expected[0]


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("friction", ["coulomb", "course"])
def test_contact_of_a_neighbour_leaves_the_smallest_velocity_alone(precision, friction):
    # The square of this speed underflows. Lanes that share a bundle with a robot in contact run
    # through the friction formulas too, and must come out untouched.
    tiny = 1e-30 if precision == "float32" else 1e-200
    scene = ws.Scene(ground=ws.Ground(friction=friction))
    flying = ws.Robot(
        masses=[0.1],
        positions=[(0.0, 0.0, 1.0)],
        velocities=[(tiny, -tiny, 0.0)],
        springs=np.empty((0, 2), dtype=int),
        stiffness=[],
    )
    landed = flying.moved((0.0, 0.0, -1.001))
    options = {"dt": DT, "precision": precision}
    lonely = ws.Simulation(flying, scene, **options).run(0.05)
    together = ws.Simulation([landed, flying, landed], scene, **options).run(0.05)
    assert lonely.positions(0)[0, 0] > 0.0
    assert together.positions(1).tobytes() == lonely.positions(0).tobytes()
    assert together.velocities(1).tobytes() == lonely.velocities(0).tobytes()


# What is looked at, and how a run is cut, changes nothing.


def final(result):
    return [
        (result.positions(i).tobytes(), result.velocities(i).tobytes())
        for i in range(len(bodies()))
    ]


@pytest.mark.parametrize(("precision", "integrator"), SETTINGS)
def test_recording_and_splitting_change_no_bit(precision, integrator):
    options = {"dt": 1e-3, "precision": precision, "integrator": integrator}
    plain = ws.Simulation(bodies(), SCENE, **options).run(1.0)
    for recording in ({"fps": 30}, {"fps": 1000, "record": [1], "energy": True}):
        seen = ws.Simulation(bodies(), SCENE, **options).run(1.0, **recording)
        assert final(seen) == final(plain)
    for durations in ((0.5, 0.5), (0.3, 0.001, 0.699)):  # not multiples of the check
        simulation = ws.Simulation(bodies(), SCENE, **options)
        for duration in durations:
            part = simulation.run(duration)
        assert part.end_time == pytest.approx(1.0)
        assert final(part) == final(plain)
        assert part.center_of_mass.tobytes() == plain.center_of_mass.tobytes()


def test_split_recording_shows_the_same_frames():
    options = {"dt": 1e-3}
    whole = ws.Simulation(bodies(), SCENE, **options).run(1.0, fps=10)
    simulation = ws.Simulation(bodies(), SCENE, **options)
    parts = [simulation.run(0.5, fps=10) for _ in range(2)]
    for i in range(len(bodies())):
        frames = np.concatenate([parts[0].frames(i)[:-1], parts[1].frames(i)])
        assert frames.tobytes() == whole.frames(i).tobytes()
    times = np.concatenate([parts[0].times[:-1], parts[1].times])
    assert np.allclose(times, whole.times, atol=1e-12)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("masses", [2, 5, 6])
def test_any_order_of_springs_gives_the_bits_of_a_robot_alone(precision, masses):
    # Two rows are stepped at a time, by the partners they share: here some springs are turned
    # round, some are there twice, and none are in order.
    rng = np.random.default_rng(masses)
    springs = [
        (i, j) for i in range(masses) for j in range(masses) if i != j and rng.random() < 0.7
    ]
    body = ws.Robot(
        masses=np.full(masses, 0.1),
        positions=rng.uniform(0.0, 0.1, (masses, 3)),
        springs=rng.permutation(np.array([*springs, (0, 1), (1, 0)])),
        stiffness=200.0,
        rest_length=0.05,
    )
    many = body.variants(velocities=rng.normal(0.0, 0.1, (17, masses, 3)))

    def end(robots):
        sim = ws.Simulation(robots, SCENE, DT, precision=precision)
        result = sim.run(0.05)
        return [result.positions(i) for i in range(len(result))]

    together = end(many)
    for index in (0, 16):
        (alone,) = end(many[index])
        np.testing.assert_array_equal(together[index], alone)
