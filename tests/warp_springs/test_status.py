"""Garbage in: absurd robots are stopped and named, and nobody else notices."""

import functools

import numpy as np
import pytest

import warp_springs as ws

DT = 1e-3
DURATION = 0.3
PRECISIONS = ["float64", "float32"]


def cube(**fields):
    body = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)
    return body.replace(**fields).rotated((1, 2, 3), 0.7).moved((0, 0, 0.05))


def with_one_velocity(speed):
    velocities = np.zeros((8, 3))
    velocities[3] = speed
    return cube(velocities=velocities)


def loose(positions, **fields):
    return ws.Robot(
        masses=0.1,
        positions=positions,
        springs=np.empty((0, 2), dtype=int),
        stiffness=[],
        **fields,
    )


@functools.cache
def garbage():
    """Robots that a search may make; each is well formed and physically absurd."""
    body = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)
    squeezed = np.array(body.positions)
    squeezed[5] = squeezed[2]
    crooked = body.positions * (1.0, 1.1, 0.9)
    return {
        "too stiff for the step": cube(stiffness=1e7, positions=crooked),
        "too stiff together": cube(stiffness=1.5e5, positions=crooked),
        "absurdly stiff": cube(stiffness=1e300, positions=crooked),
        "one mass at 1e300 m/s": with_one_velocity((1e300, 0, 0)),
        "one mass at 1e30 m/s": with_one_velocity((0, 1e30, 0)),
        "one mass at 2 km/s": with_one_velocity((0, 2e3, 0)),
        "every mass at 1e300 m/s": cube(velocities=np.full((8, 3), 1e300)),
        "breathing through zero": cube(amplitude=0.25, omega=20.0),
        "breathing a kilometre": cube(amplitude=1e3, omega=20.0),
        "breathing 1e300 m": cube(amplitude=1e300, omega=20.0),
        "breathing at 1e300 rad/s": cube(amplitude=0.01, omega=1e300),
        "coincident masses": cube(positions=squeezed),
        "all masses in one point": cube(positions=np.zeros((8, 3))),
        "duplicate springs": ws.Robot(
            masses=0.1, positions=[(0, 0, 1), (0, 0, 1.1)], springs=[(0, 1)] * 9, stiffness=500.0
        ),
        "isolated masses": loose([(0, 0, 0.1), (5, 0, 0.2), (0, 9, 0.3)]),
        "one mass": loose([(0, 0, 0.1)]),
        "deep underground": cube().moved((0, 0, -30.0)),
        "1e300 m away": loose([(1e300, 0, 1), (0, 0, 1)]),
        "light as 1e-300 kg": cube(masses=1e-300),
        "heavy as 1e300 kg": cube(masses=1e300),
        "springs of no length": cube(rest_length=0.0),
        "springs of 1e300 m": cube(rest_length=1e300),
    }


def healthy():
    """A healthy neighbour in the cube's own topology, and one in another."""
    lattice = ws.shapes.lattice(2, 1, 1, stiffness=1500.0)
    return [
        cube(amplitude=0.005, omega=10.0).spinning((1, 2, 3)),
        cube().spinning((3, 1, 2)),
        lattice.rotated((1, 0, 2), 0.4).moved((0, 0, 0.05)),
        loose([(0, 0, 0.1)], velocities=[(0.1, 0.2, 0.3)]),
        loose([(0, 0, 0.1), (1, 0, 0.2), (0, 1, 0.3)]),
    ]


def simulate(robots, precision="float64", integrator="leapfrog", **options):
    scene = ws.Scene(damping=0.1, drag=0.01)
    simulation = ws.Simulation(
        robots, scene, dt=DT, precision=precision, integrator=integrator, **options
    )
    return simulation.run(DURATION, fps=50, energy=True)


def bits(result, robot):
    parts = (
        result.positions(robot),
        result.velocities(robot),
        result.frames(robot),
        result.center_of_mass[robot],
        result.energy.total[robot],
    )
    return [part.tobytes() for part in parts]


@functools.cache
def crowd(precision, integrator):
    """Healthy robots with all the garbage between them, run once for several tests."""
    neighbours = healthy()
    robots = []
    for i, bad in enumerate(garbage().values()):
        robots += [bad, neighbours[i % len(neighbours)]]
    return robots, simulate(robots, precision, integrator)


@pytest.mark.parametrize("integrator", ["leapfrog", "chin4", "euler"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_every_robot_ends_in_a_finite_pose(precision, integrator):
    robots, result = crowd(precision, integrator)
    for i, name in enumerate(garbage()):
        slot = 2 * i
        if not _fits(robots[slot], precision):
            assert result.status[slot] != ws.Status.OK, name
            continue
        assert np.isfinite(result.positions(slot)).all(), name
        assert np.isfinite(result.velocities(slot)).all(), name
        assert np.isfinite(result.frames(slot)).all(), name
        assert np.isfinite(result.center_of_mass[slot]).all(), name


def _fits(robot, precision):
    """Whether the robot's own numbers, and the inverse of its masses, exist in this precision."""
    numbers = [robot.positions, robot.velocities, robot.masses, 1.0 / robot.masses]
    largest = max(np.abs(values).max() for values in numbers)
    return largest < np.finfo(precision).max


@pytest.mark.parametrize("integrator", ["leapfrog", "chin4", "euler"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_neighbours_of_garbage_do_not_change_by_one_bit(precision, integrator):
    robots, result = crowd(precision, integrator)
    undisturbed = simulate(healthy(), precision, integrator)
    for slot in range(1, len(robots), 2):
        neighbour = (slot // 2) % len(healthy())
        assert result.status[slot] == ws.Status.OK
        assert bits(result, slot) == bits(undisturbed, neighbour)


@pytest.mark.parametrize(
    ("name", "reasons"),
    [
        ("too stiff for the step", {"UNSTABLE_STEP"}),
        ("too stiff together", {"NONFINITE", "TOO_FAST", "OVERSTRETCHED"}),  # no spring alone is
        ("absurdly stiff", {"UNSTABLE_STEP"}),
        ("one mass at 1e300 m/s", {"TOO_FAST", "NONFINITE"}),
        ("one mass at 1e30 m/s", {"TOO_FAST"}),
        ("one mass at 2 km/s", {"TOO_FAST"}),
        ("every mass at 1e300 m/s", {"TOO_FAST", "NONFINITE"}),
        ("breathing a kilometre", {"TOO_FAST", "OVERSTRETCHED", "NONFINITE"}),
        ("breathing 1e300 m", {"TOO_FAST", "OVERSTRETCHED", "NONFINITE"}),
        ("light as 1e-300 kg", {"UNSTABLE_STEP"}),
        ("springs of 1e300 m", {"TOO_FAST", "OVERSTRETCHED", "NONFINITE"}),
        ("deep underground", {"TOO_DEEP"}),
        ("isolated masses", {"OK"}),
        ("one mass", {"OK"}),
        ("duplicate springs", {"OK"}),
    ],
)
def test_reason(name, reasons):
    _, result = crowd("float64", "leapfrog")
    slot = 2 * list(garbage()).index(name)
    assert ws.Status(result.status[slot]).name in reasons
    assert np.isnan(result.status_time[slot]) == (reasons == {"OK"})


#: One sub-step a drift is too coarse for the ground: every bounce pumps a cube up.
COARSE = {"dt": 1.97e-3, "integrator": "leapfrog", "contact_substeps": 1}
ICE = ws.Scene(ground=ws.Ground(static_friction=0.0, kinetic_friction=0.0))


@functools.cache
def pumped(layout="lanes", energy=True):
    """One cube that bounces and one that falls, for a while and a tenth more."""
    bouncing = cube().rotated((1, 2, 3), 0.7).spinning((3, -2, 4)).moved((0, 0, 0.3))
    simulation = ws.Simulation([bouncing, cube().moved((0, 0, 50.0))], ICE, layout=layout, **COARSE)
    return simulation.run(1.5, fps=20, energy=energy), simulation.run(0.1)


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_what_makes_energy_from_nowhere_is_frozen_where_its_books_last_balanced(layout):
    result, later = pumped(layout)
    assert list(result.status) == [ws.Status.ENERGY, ws.Status.OK]
    since = result.status_time[0]
    assert 0.2 < since < 1.5
    assert result.energy.gain.max() <= ws.Limits().gain  # shown is what was honest
    frozen, frames = result.times >= since, result.frames(0)
    assert np.all(frames[frozen] == result.positions(0)) and frozen.any()
    assert np.ptp(frames[~frozen][-5:], axis=0).max() > 1e-3
    assert np.ptp(result.energy.total[0][frozen]) == 0.0
    center = result.robots[0].masses @ result.positions(0) / result.robots[0].mass
    assert result.center_of_mass[0] == pytest.approx(center, abs=1e-12)
    # It stays there in later runs, also where nobody looks at energies any more.
    assert list(later.status) == [ws.Status.ENERGY, ws.Status.OK]
    assert later.status_time[0] == since
    assert later.positions(0).tobytes() == result.positions(0).tobytes()
    assert later.spring_evaluations == 28 * later.steps
    # Where they are not asked for it goes on, and its neighbour is the same to the bit.
    unseen, after = pumped(layout, energy=False)
    assert not unseen.status.any()
    assert unseen.frames(1).tobytes() == result.frames(1).tobytes()
    assert after.positions(1).tobytes() == later.positions(1).tobytes()


def test_energy_from_nowhere_is_found_without_frames_and_before_what_follows():
    bouncing = cube().rotated((1, 2, 3), 0.7).spinning((3, -2, 4)).moved((0, 0, 0.3))
    found = ws.Simulation([bouncing] * 40, ICE, **COARSE).run(1.5, energy=True)
    assert (found.status == ws.Status.ENERGY).all()
    # Between the frames the books are looked through every 256 steps.
    assert found.status_time == pytest.approx(256 * COARSE["dt"])


def test_honest_robots_are_not_stopped_for_energy():
    bouncing = cube().rotated((1, 2, 3), 0.7).spinning((3, -2, 4)).moved((0, 0, 0.3))
    honest = ws.Simulation([bouncing, cube()], ICE, dt=1e-3).run(3.0, fps=20, energy=True)
    assert not honest.status.any() and honest.energy.gain.max() < 1e-2


@pytest.mark.parametrize("layout", ["lanes", "flat"])
def test_who_is_stopped_for_energy_gets_back_what_broke_since(layout):
    fragile = cube().rotated((1, 2, 3), 0.7).spinning((3, -2, 4)).moved((0, 0, 0.3))
    fragile = fragile.with_limits(breaks=15.0)
    broken = []
    for energy in (True, False):
        simulation = ws.Simulation(fragile, ICE, layout=layout, **COARSE)
        result = simulation.run(0.6, fps=20, energy=energy)
        broken.append(np.isfinite(result.broken(0)).sum())
        assert result.status[0] == (ws.Status.ENERGY if energy else ws.Status.OK)
    assert broken[0] == 0 < broken[1]


def test_strong_muscles_gain_what_the_step_costs_and_no_more():
    # They turn cubes inside out on ice, where nothing takes energy away: at 1 ms leapfrog adds a
    # fifth in ten seconds. That is numerical: it goes away with the square of the step.
    rng = np.random.default_rng(0)
    springs = cube().n_springs
    wild = [
        cube(amplitude=0.04, omega=60.0, phase=rng.uniform(0, 2 * np.pi, springs))
        for _ in range(64)
    ]
    gains = {}
    for integrator, dt in (("leapfrog", 1e-3), ("leapfrog", 2.5e-4), ("chin4", "auto")):
        simulation = ws.Simulation(wild, ICE, dt, integrator=integrator, limits=ws.Limits(gain=1e9))
        result = simulation.run(10.0, fps=50, energy=True)
        assert not result.status.any()
        gains[integrator, dt] = result.energy.gain.max(axis=1)
    coarse, fine = gains["leapfrog", 1e-3], gains["leapfrog", 2.5e-4]
    assert coarse.max() > 0.1 and np.median(fine) < np.median(coarse) / 10
    assert gains["chin4", "auto"].max() < 0.05
    # Who asks for it has them stopped.
    strict = ws.Simulation(wild, ICE, 1e-3, integrator="leapfrog", limits=ws.Limits(gain=0.05)).run(
        10.0, energy=True
    )
    assert np.count_nonzero(strict.status == ws.Status.ENERGY) > 10


def test_what_is_no_number_any_more_is_stopped_as_such():
    huge = cube().scaled(1e200)  # the square of a length is infinite
    result = ws.Simulation([huge, cube()], ws.Scene(ground=None), dt=1e-3).run(0.1)
    assert list(result.status) == [ws.Status.NONFINITE, ws.Status.OK]
    assert result.positions(0).tobytes() == huge.positions.tobytes()


def test_status_is_an_integer_array_of_a_truthy_enum():
    _, result = crowd("float64", "leapfrog")
    assert result.status.dtype.kind == "i"
    assert not ws.Status.OK
    assert all(status for status in ws.Status if status is not ws.Status.OK)
    stopped = result.status != ws.Status.OK
    times = result.status_time
    assert np.array_equal(np.isnan(times), ~stopped)
    assert np.all((times[stopped] >= 0.0) & (times[stopped] <= DURATION))


def test_stopped_robot_rests_where_it_was_last_good():
    bad = garbage()["too stiff together"]
    simulation = ws.Simulation(bad, ws.Scene(), dt=DT, integrator="leapfrog")
    result = simulation.run(DURATION, fps=1 / DT)
    assert result.status[0] != ws.Status.OK
    positions = result.positions(0)
    springs = bad.springs
    lengths = np.linalg.norm(positions[springs[:, 1]] - positions[springs[:, 0]], axis=1)
    assert lengths.max() <= ws.Limits().stretch * bad.lengths.max() * (1 + 1e-12)
    stopped = result.times >= result.status_time[0]
    assert stopped.any()
    assert np.all(result.frames(0)[stopped] == positions)
    # It stays there, with the same reason and time, when the run goes on.
    later = simulation.run(DURATION)
    assert np.array_equal(later.positions(0), positions)
    assert later.status[0] == result.status[0]
    assert later.status_time[0] == result.status_time[0]


def test_exploded_at_the_end_of_a_run_is_stopped_in_this_run_and_the_next():
    # Also when the run ends between two checks: nothing of the exploded pose is shown.
    bad = garbage()["too stiff together"]
    for steps in range(1, 64):
        simulation = ws.Simulation(bad, ws.Scene(), dt=DT, integrator="leapfrog")
        first = simulation.run(steps * DT)
        if first.status[0] != ws.Status.OK:
            break
    assert first.status[0] != ws.Status.OK
    second = simulation.run(0.2)
    assert second.status[0] != ws.Status.OK
    assert np.array_equal(first.positions(0), bad.positions)
    assert np.array_equal(second.positions(0), first.positions(0))


def test_limits_are_the_callers():
    fast = loose([(0, 0, 1)], velocities=[(30.0, 0, 0)])
    scene = ws.Scene(ground=None)
    strict = ws.Simulation(fast, scene, dt=DT, limits=ws.Limits(speed=20.0)).run(0.1)
    assert strict.status[0] == ws.Status.TOO_FAST
    assert ws.Simulation(fast, scene, dt=DT).run(0.1).status[0] == ws.Status.OK
    pulled = cube(rest_length=0.25)  # swells to more than twice its size
    loose_limit = ws.Simulation(pulled, scene, dt=DT).run(0.2)
    assert loose_limit.status[0] == ws.Status.OK
    tight = ws.Simulation(pulled, scene, dt=DT, limits=ws.Limits(stretch=1.05)).run(0.2)
    assert tight.status[0] == ws.Status.OVERSTRETCHED


@pytest.mark.parametrize("field", ["speed", "stretch", "depth"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "fast"])
def test_limits_refuse_nonsense(field, value):
    with pytest.raises(ValueError, match=field):
        ws.Limits(**{field: value})


def test_spring_evaluations_leave_out_stopped_robots():
    bad, good = garbage()["one mass at 1e300 m/s"], cube()
    steps = round(DURATION / DT)
    both = ws.Simulation([bad, good], ws.Scene(), dt=DT, integrator="leapfrog").run(DURATION)
    assert both.spring_evaluations == good.n_springs * steps


def test_robots_that_are_refused_share_no_lanes_with_those_that_step():
    cube = ws.shapes.cube().moved((0.0, 0.0, 0.01))
    stiffness = np.tile(cube.stiffness, (64, 1))
    stiffness[::2] *= 1e9
    sim = ws.Simulation(cube.variants(stiffness=stiffness), dt=1e-3)
    result = sim.run(1e-3)
    refused = result.status == ws.Status.UNSTABLE_STEP
    np.testing.assert_array_equal(refused, np.arange(64) % 2 == 0)
    bundle = sim._batch.slots.bundle
    assert not set(bundle[refused]) & set(bundle[~refused])
