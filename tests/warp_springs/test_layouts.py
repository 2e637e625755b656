"""Block and flat against the lanes: the same physics to rounding, and the same promises."""

import dataclasses
import functools

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.engine import crowd

KINDS = ("Threads", "Launches", "Blocks")
DT = 5e-4
DURATION = 0.1
# Every branch of the law is in one of these; what none of them has is left out of their kernels.
CASES = {
    "everything": (
        {"integrator": "chin4", "precision": "float64"},
        ws.Scene(
            gravity=(0.3, 0.1, -9.81),
            ground=ws.Ground(static_friction=0.6, kinetic_friction=0.4),
            damping=0.5,
            drag=0.01,
        ),
        True,
    ),
    "classroom": (
        {"integrator": "euler", "precision": "float64"},
        ws.Scene(ground=ws.Ground(friction="course"), damping=0.2),
        True,
    ),
    "passive": (
        {"integrator": "leapfrog", "precision": "float32"},
        ws.Scene(ground=ws.Ground(static_friction=0.3, kinetic_friction=0.2), drag=0.02),
        False,
    ),
    "far": (
        {"integrator": "chin4", "precision": "mixed"},
        ws.Scene(ground=ws.Ground(static_friction=0.6, kinetic_friction=0.4), damping=0.1),
        True,
    ),
    "elements": (
        {"integrator": "chin4", "precision": "float64"},
        ws.Scene(
            ground=ws.Ground(),
            obstacles=(
                ws.Sphere(center=(0.1, 0.1, -0.05), radius=0.1),
                ws.Plane(normal=(0.2, 0.0, 1.0), offset=0.001),
            ),
            wind=(1.0, 0.5, 0.0),
            water=ws.Water(level=0.03, density=0.5, drag=0.2),
            drag=0.01,
        ),
        True,
    ),
    "springs": (
        {"integrator": "chin4", "precision": "float64"},
        ws.Scene(ground=ws.Ground(), damping=0.2, drag=0.01),
        True,
    ),
}
#: Cases whose robots have springs of every kind.
SPECIAL = ("springs", "classroom", "passive")
#: Largest difference [m] that rounding may make.
TOLERANCE = {"float64": 1e-13, "mixed": 1e-6, "float32": 2e-5}


@pytest.fixture(autouse=True)
def launches_too(monkeypatch):
    """``layout="flat"`` with the environment's say: threads, or the launches of a GPU."""
    chosen = {"flat": crowd.Threads}

    def kind_of(layout, device):
        return crowd.Blocks if layout == "block" else chosen["flat"]

    monkeypatch.setattr(crowd, "kind_of", kind_of)
    return chosen


@functools.cache
def bodies(actuated):
    """Robots of two topologies, two of them alike, all about to land; masses differ."""
    lattice = ws.shapes.lattice(3, 2, 1, stiffness=1500.0)
    if actuated:
        lattice = lattice.replace(
            amplitude=0.08 * lattice.rest_length,
            phase=np.linspace(0.0, 6.0, lattice.n_springs),
            omega=12.0,
        )
    heavy = lattice.replace(masses=np.linspace(0.05, 0.3, lattice.n_masses))
    cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1000.0)
    if actuated:
        cube = cube.replace(amplitude=np.full(28, 0.003), omega=9.0)
    robots = [
        lattice.rotated((1, 0, 2), 0.4).spinning((1, 2, 3)),
        cube.rotated((1, 2, 3), 0.7).spinning((3, -2, 4)),
        heavy.rotated((0, 1, 2), 0.3),
    ]
    return tuple(robot.moved((0, 0, 5e-3 - robot.bounds[0, 2])) for robot in robots)


def simulate(robots, scene, layout, energy=True, duration=DURATION, **options):
    simulation = ws.Simulation(robots, scene, dt=DT, layout=layout, **options)
    return simulation.run(duration, fps=50, energy=energy)


def population(case):
    """The robots of a case; "far": so far out, and so fast, that the origins follow them."""
    robots = bodies(CASES[case][2])
    if case == "far":
        return [robot.moved((1000, -500, 0)).moving((20, -10, 0)) for robot in robots]
    if case in ("elements", "passive"):
        robots = [with_elements(robot) for robot in robots]
    if case in SPECIAL:
        robots = [with_springs(robot) for robot in robots]
    return robots


def with_elements(robot):
    """Pushed, tethered, held on a line and on a circle, rough in places."""
    robot = robot.pushed([1, 3], (2, 1, 0.5), start=0.013, duration=0.04)
    robot = robot.pushed([3], (0, -1, 0), start=0.02).tethered(0, 200.0, point=(0, 0, 0.3))
    robot = robot.fixed([2], "x").held_to(ws.Sphere(robot.positions[5], 0.05), [4])
    return robot.shod(static_friction=0.1, kinetic_friction=0.05, masses=[6, 7])


def with_springs(robot):
    """Springs of every kind, some of which break or yield; timetables of different lengths."""
    s = np.arange(robot.n_springs)
    times = np.linspace(0.0, 0.12, robot.n_masses % 3 + 2)
    robot = robot.with_cables([1, 3]).with_hardening(2e5, [4, 5, 6]).with_dashpots(0.05)
    robot = robot.with_limits(breaks=np.where(s % 5 == 0, 6.0, 1e9))
    robot = robot.with_limits(yields=4e4, area=1e-4, springs=[7, 8, 9, 11, 12])
    robot = robot.with_stiffness_in_time(times, 1.0 + 10 * times, [2, 9])
    robot = robot.with_winch(times, -0.1 * times, [1])
    if robot.is_actuated:
        robot = robot.with_harmonics([0.001, 0.002], [0.5, 1.0]).with_omegas(17.0, springs=[2, 13])
    return robot


@functools.cache
def truth(case):
    options, scene, _ = CASES[case]
    return simulate(population(case), scene, "lanes", **options)


def agree(result, expected, tolerance):
    assert (result.status == expected.status).all()
    size = len(expected)
    for i in range(size):
        assert np.abs(result.positions(i) - expected.positions(i)).max() < tolerance
        assert np.abs(result.velocities(i) - expected.velocities(i)).max() < 1e3 * tolerance
        assert np.abs(result.frames(i) - expected.frames(i)).max() < tolerance
    assert np.abs(result.center_of_mass - expected.center_of_mass).max() < tolerance
    assert result.spring_evaluations == expected.spring_evaluations
    if expected.energy is None:
        assert result.energy is None
        return
    for field in dataclasses.fields(expected.energy):
        mine, theirs = getattr(result.energy, field.name), getattr(expected.energy, field.name)
        assert np.abs(mine - theirs).max() < 1e2 * tolerance * (1.0 + np.abs(theirs).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", CASES)
def test_every_layout_moves_robots_as_the_lanes_do(case, kind, launches_too):
    options, scene, _ = CASES[case]
    launches_too["flat"] = getattr(crowd, kind)
    layout = "block" if kind == "Blocks" else "flat"
    expected = truth(case)
    result = simulate(population(case), scene, layout, **options)
    agree(result, expected, TOLERANCE[options["precision"]])
    # Somebody must have landed, moved and lost something, or this compares nothing.
    assert np.abs(expected.frames(0)[-1] - expected.frames(0)[0]).max() > 0.01
    if scene.ground:
        assert expected.energy.ground.max() > 0.0
        assert expected.energy.losses[:, -1].max() > 1e-4
    if case in SPECIAL:
        for i in range(len(result)):
            np.testing.assert_array_equal(result.broken(i), expected.broken(i))
            apart = np.abs(result.yielded(i) - expected.yielded(i))
            assert apart.max() < TOLERANCE[options["precision"]]
        assert np.isfinite(expected.broken(0)).sum() > 1 and expected.yielded(0).any()
        assert expected.energy.plastic_loss[0, -1] > 1e-3 < expected.energy.dashpot_loss[0, -1]


def fingerprint(result, robot):
    parts = [
        result.positions(robot),
        result.velocities(robot),
        result.center_of_mass[robot],
        result.status[robot],
        result.frames(robot),
        *(getattr(result.energy, f.name)[robot] for f in dataclasses.fields(result.energy)),
    ]
    return tuple(np.asarray(part).tobytes() for part in parts)


@pytest.mark.parametrize("kind", KINDS)
def test_bits_depend_on_the_robot_alone(kind, launches_too):
    options, scene, actuated = CASES["everything"]
    launches_too["flat"] = getattr(crowd, kind)
    layout = "block" if kind == "Blocks" else "flat"
    robots = bodies(actuated)
    rng = np.random.default_rng(4)
    others = [
        robots[i % 3].replace(stiffness=robots[i % 3].stiffness * rng.uniform(0.5, 2.0))
        for i in range(7)
    ]
    crowded = [*others[:4], robots[0], *others[4:], robots[2], robots[1]]
    together = simulate(crowded, scene, layout, **options)
    for slot, robot in ((4, robots[0]), (8, robots[2]), (9, robots[1])):
        alone = simulate(robot, scene, layout, **options)
        assert fingerprint(together, slot) == fingerprint(alone, 0)


def test_bits_do_not_depend_on_the_threads():
    options, scene, _ = CASES["everything"]
    body = ws.shapes.lattice(9, 8, 7, stiffness=3000.0).rotated((1, 2, 3), 0.3)
    body = body.moved((0, 0, 0.002 - body.bounds[0, 2]))
    one, two, five = (
        simulate(body, scene, "flat", duration=0.03, threads=threads, **options)
        for threads in (1, 2, 5)
    )
    assert fingerprint(one, 0) == fingerprint(two, 0) == fingerprint(five, 0)
    lanes = simulate(body, scene, "lanes", duration=0.03, **options)
    agree(two, lanes, TOLERANCE["float64"])


@pytest.mark.parametrize("kind", KINDS)
def test_splitting_and_looking_change_no_bit(kind, launches_too):
    options, scene, _ = CASES["springs"]
    launches_too["flat"] = getattr(crowd, kind)
    layout = "block" if kind == "Blocks" else "flat"
    robots = population("springs")
    plain = ws.Simulation(robots, scene, dt=DT, layout=layout, **options).run(0.06)
    simulation = ws.Simulation(robots, scene, dt=DT, layout=layout, **options)
    simulation.run(0.0305, fps=200, record=[1])
    simulation.run(0.001, energy=True)
    parts = simulation.run(0.0285)
    for i in range(len(robots)):
        assert parts.positions(i).tobytes() == plain.positions(i).tobytes()
        assert parts.velocities(i).tobytes() == plain.velocities(i).tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_that_goes_wrong_is_stopped_and_harms_nobody(kind, launches_too):
    launches_too["flat"] = getattr(crowd, kind)
    layout = "block" if kind == "Blocks" else "flat"
    options, scene, actuated = CASES["everything"]
    good = bodies(actuated)[1]
    bad = [
        good.replace(velocities=np.full((8, 3), 2000.0)),
        good.replace(stiffness=np.full(28, 1e12)),
        good.moved((0, 0, -3.0)),
        good.replace(rest_length=9 * good.rest_length),
    ]
    robots = [bad[0], good, *bad[1:]]
    result = simulate(robots, scene, layout, **options)
    lanes = simulate(robots, scene, "lanes", **options)
    assert (result.status == lanes.status).all()
    assert np.count_nonzero(result.status) >= 3
    np.testing.assert_array_equal(result.status_time, lanes.status_time)
    assert fingerprint(result, 1) == fingerprint(simulate(good, scene, layout, **options), 0)
    for i in np.flatnonzero(np.isfinite(result.status_time)):
        assert np.isfinite(result.positions(i)).all()
        assert result.frames(i)[-1].tobytes() == result.frames(i)[-2].tobytes()


@pytest.mark.parametrize("layout", ["flat", "block"])
def test_every_robot_keeps_its_own_step(layout):
    scene = ws.Scene()
    good = bodies(True)[1]
    robots = [good, good.replace(stiffness=81 * good.stiffness), good]
    result = ws.Simulation(robots, scene, dt="auto", layout=layout).run(0.05)
    lanes = ws.Simulation(robots, scene, dt="auto", layout="lanes").run(0.05)
    for i in range(3):
        assert np.abs(result.positions(i) - lanes.positions(i)).max() < 1e-12
    assert result.positions(0).tobytes() == result.positions(2).tobytes()


def test_masses_of_a_large_body_keep_their_order():
    body = ws.shapes.lattice(10, 10, 10).moved((0, 0, 1.0))
    result = ws.Simulation(body, ws.Scene(gravity=(0, 0, 0)), dt=DT).run(0.01)
    assert result.positions(0) == pytest.approx(body.positions, abs=1e-9)


def test_auto_chooses_by_the_robot():
    small, large = ws.shapes.cube(), ws.shapes.lattice(10, 10, 10)
    simulation = ws.Simulation([small, large, small], ws.Scene(), dt=DT)
    layouts = sorted(group.layout for group in simulation._batch.groups)
    assert layouts == ["flat", "lanes"]


def test_what_cannot_run_is_refused_in_one_line():
    cube = ws.shapes.cube()
    with pytest.raises(ValueError, match=r"device: got 'cuda:7', expected one of .*cpu"):
        ws.Simulation(cube, device="cuda:7")
    with pytest.raises(ValueError, match=r"device: got 'toaster'"):
        ws.Simulation(cube, device="toaster")
    with pytest.raises(ValueError, match=r"layout: got 'rows', expected 'auto' or 'lanes'"):
        ws.Simulation(cube, layout="rows")
    big = ws.shapes.lattice(10, 10, 10)
    with pytest.raises(
        ValueError, match=r"robots\[1\] has 1331 masses, 'block' expects 320 or fewer"
    ):
        ws.Simulation([cube, big], layout="block")
