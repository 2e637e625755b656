"""Which steps are stable, what is done about those that are not, and how garbage ends."""

import functools
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import warp_springs as ws
import warp_springs.engine.method

INTEGRATORS = ["chin4", "leapfrog", "euler"]
LIMITS = {"chin4": np.sqrt(12.0), "leapfrog": 2.0, "euler": 2.0}  # of omega dt, springs alone
FREE = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)
GROUND = ws.Scene()
ICE = ws.Scene(ground=ws.Ground(static_friction=0.0, kinetic_friction=0.0))
DT = 1e-3


@functools.cache
def shapes():
    """Every shape that is shipped, and one with everything uneven."""
    hollow = np.ones((3, 3, 2), bool)
    hollow[1, 1], hollow[0, 0, 1] = False, False
    rng = np.random.default_rng(1)
    block = ws.shapes.lattice(2, 2, 1)
    return {
        "cube": ws.shapes.cube(),
        "tetrahedron": ws.shapes.tetrahedron(),
        "octahedron": ws.shapes.octahedron(),
        "2 x 1 x 1": ws.shapes.lattice(2, 1, 1),
        "3 x 3 x 3": ws.shapes.lattice(3, 3, 3),
        "1 x 1 x 6": ws.shapes.lattice(1, 1, 6),
        "hollow": ws.shapes.voxels(hollow),
        "uneven": block.replace(
            masses=10.0 ** rng.uniform(-1.5, -0.5, block.n_masses),
            stiffness=10.0 ** rng.uniform(2.5, 3.5, block.n_springs),
        ),
    }


def pair(stiffness, mass=0.1, **fields):
    """Two masses above each other, one spring."""
    positions = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.1)]
    return ws.Robot(
        masses=mass, positions=positions, springs=[(0, 1)], stiffness=stiffness, **fields
    )


def lone(mass, height=0.0, **fields):
    """One mass without any spring."""
    positions = [(0.0, 0.0, height)]
    return ws.Robot(masses=mass, positions=positions, springs=[], stiffness=[], **fields)


def bits(result, robot):
    parts = [result.positions(robot), result.velocities(robot), result.center_of_mass[robot]]
    return [part.tobytes() for part in parts] + [int(result.status[robot])]


# -- the bound against the measured limit ------------------------------------------------------
#
# The limit is measured by varying the masses, not the step: one simulation then holds the whole
# scan. What counts is the ratio of the step to `stable_dt`.

RATIOS = np.geomspace(0.96, 2.9, 40)
PERTURBATION, GROWN = 1e-9, 1e-6  # m/s, and what it becomes where the step is unstable


def heavier(body, scene, integrator):
    """Variants whose stable steps are DT / RATIOS."""
    factor = (DT / RATIOS / ws.stable_dt(body, scene, integrator)) ** 2
    robots = body.variants(masses=factor[:, None] * body.masses)
    assert ws.stable_dt(robots, scene, integrator) == pytest.approx(DT / RATIOS, rel=1e-9)
    return robots


def stacked(result, what):
    return np.stack([getattr(result, what)(i) for i in range(len(result))])


def unstable(robots, scene, integrator):
    """In which variants tiny motion grows: the difference of two runs, so nothing else shows."""
    masses, positions = robots.array("masses"), robots.array("positions")
    if scene.ground is not None:  # first they come to rest, each with its own step
        still = ws.Scene(scene.gravity, scene.ground, damping=20.0)
        settled = ws.Simulation(robots, still, DT, integrator=integrator).run(1.5)
        positions = stacked(settled, "positions")
    push = PERTURBATION * np.random.default_rng(0).normal(size=positions.shape[1:])
    undamped = ws.Scene(scene.gravity, scene.ground, damping=1e-9)  # the same kernel
    ends, stopped = [], np.zeros(len(robots), bool)
    for kick in (push, 0.0 * push):
        velocities = np.broadcast_to(kick, positions.shape)
        started = robots.body.variants(masses=masses, positions=positions, velocities=velocities)
        result = ws.Simulation(started, undamped, DT, integrator=integrator).run(1.2)
        stopped |= result.status != ws.Status.OK
        ends.append(stacked(result, "velocities"))
    return stopped | (np.abs(ends[0] - ends[1]).max(axis=(1, 2)) > GROWN)


@pytest.mark.parametrize("name", shapes())
@pytest.mark.parametrize("scene", [FREE, GROUND], ids=["free", "ground"])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_bound_is_below_the_limit_and_refusal_above_it(integrator, scene, name, monkeypatch):
    robots = heavier(shapes()[name], scene, integrator)
    born = ws.Simulation(robots, scene, DT, integrator=integrator).run(DT).status
    monkeypatch.setattr(
        warp_springs.engine.method,
        "certainly_unstable",
        lambda strip, dt, integrator: np.zeros(len(strip.ids), bool),
    )
    found = unstable(robots, scene, integrator)
    limit = RATIOS[np.argmax(found)] if found.any() else np.inf
    assert limit >= 1.0
    # Of the uneven body the lightest mass, which sets the bound, may never touch the ground.
    assert limit <= 2.5 or name == "uneven"
    assert np.all(found[born == ws.Status.UNSTABLE_STEP])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_bound_of_a_pair_is_exact(integrator):
    robot = pair(stiffness=500.0)
    exact = LIMITS[integrator] / np.sqrt(2 * 500.0 / 0.1)
    assert ws.stable_dt(robot, FREE, integrator) == pytest.approx(exact, rel=2e-3)
    for part, status in ((0.999, ws.Status.OK), (1.002, ws.Status.UNSTABLE_STEP)):
        result = ws.Simulation(robot, FREE, part * exact, integrator=integrator).run(0.1)
        assert result.status[0] == status


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog"])
@pytest.mark.parametrize("stiffness", [1e-6, 1.0, 15.0, 60.0, 1000.0])
def test_bound_ends_before_springs_and_ground_resonate(integrator, stiffness):
    # Half a contact oscillation a step: kicks that come at every touch pump it up.
    bounce = np.sqrt(GROUND.ground.stiffness / 0.1)
    assert ws.stable_dt(pair(stiffness), GROUND, integrator) <= np.pi / bounce


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_bouncing_masses_keep_their_energy_within_the_bound(integrator):
    step = 0.99 * ws.stable_dt(lone(0.1), ICE, integrator)
    heights = np.random.default_rng(0).uniform(0.005, 0.015, 32)
    robots = [lone(0.1, height) for height in heights]
    result = ws.Simulation(robots, ICE, step, integrator=integrator).run(5.0, energy=True)
    gain = result.energy.total[:, -1] / result.energy.total[:, 0]
    assert np.median(gain) < 1.5  # symplectic Euler loses and gains in bounces; none may explode
    assert gain.max() < (10.0 if integrator == "euler" else 1.1)


@pytest.mark.parametrize("mass", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_masses_too_light_for_the_contact_flow_do_not_gain_energy_unnoticed(integrator, mass):
    robots = [lone(mass, height) for height in (0.006, 0.01, 0.013)]
    result = ws.Simulation(robots, ICE, DT, integrator=integrator).run(2.0, energy=True)
    total = result.energy.total
    kept = total[:, -1] < 2.0 * total[:, 0]
    assert np.all(kept | (result.status != ws.Status.OK))


def test_what_vibrates_on_the_ground_neither_heats_up_nor_cools_down():
    cube = ws.shapes.cube().moved((0.0, 0.0, -2e-5))
    down = np.where(cube.positions[:, 2:] > 0.05, -0.02, 0.0)
    cube = cube.replace(velocities=down * np.array([0.0, 0.0, 1.0]))
    energy = ws.Simulation(cube, ICE, 1e-3).run(600.0, fps=1, energy=True).energy
    vibration = energy.kinetic[0, 0]
    assert abs(energy.total[0, -60:].mean() - energy.total[0, 0]) < 0.1 * vibration
    assert energy.ground[0].min() > 0.0  # it never left the ground


def test_variants_and_sequences_have_the_same_bound():
    body = shapes()["2 x 1 x 1"]
    stiffness = np.random.default_rng(0).uniform(100.0, 1e5, (9, body.n_springs))
    variants = body.variants(stiffness=stiffness)
    for scene in (FREE, GROUND):
        for integrator in INTEGRATORS:
            of_variants = ws.stable_dt(variants, scene, integrator)
            of_robots = ws.stable_dt(list(variants), scene, integrator)
            alone = [ws.stable_dt(robot, scene, integrator) for robot in variants]
            assert of_variants.shape == (9,)
            assert of_variants.tobytes() == of_robots.tobytes() == np.array(alone).tobytes()
    assert isinstance(alone[0], float)


@pytest.mark.parametrize(("mass", "stiffness"), [(1e-300, 1e300), (1e-310, 1.0), (1e300, 1e-300)])
def test_bound_of_absurd_robots_is_a_number_and_no_warning(mass, stiffness):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bound = ws.stable_dt(ws.shapes.cube().replace(masses=mass, stiffness=stiffness), FREE)
    assert bound >= 0.0


def test_unknown_integrator_is_refused():
    with pytest.raises(ValueError, match="integrator"):
        ws.stable_dt(pair(1.0), FREE, "verlet")


# -- dt="auto" ---------------------------------------------------------------------------------


def crowd():
    """Robots of one topology whose stable steps are decades apart, some breathing, some alone."""
    cube = ws.shapes.cube().rotated((1, 2, 3), 0.7).moved((0.0, 0.0, 0.05))
    plain = [cube.replace(stiffness=k).moved((k * 1e-5, 0, 0)) for k in (300, 1e3, 1e4, 1e5, 1e6)]
    breathing = cube.replace(amplitude=0.005, omega=10.0, phase=np.linspace(0, 6, 28))
    return [*plain, breathing, ws.shapes.tetrahedron(stiffness=2e5).moved((0.0, 0.0, 0.01))]


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_auto_gives_each_robot_a_power_of_two_of_its_own(integrator):
    robots = crowd()
    simulation = ws.Simulation(robots, GROUND, "auto", integrator=integrator)
    steps, stable = simulation.robot_dt, ws.stable_dt(robots, GROUND, integrator)
    halvings = np.log2(simulation.dt / steps)
    assert np.array_equal(halvings, np.rint(halvings))
    assert len(set(halvings)) > 1
    assert np.all(steps <= 0.5 * stable)
    assert np.all((halvings == 0) | (2.0 * steps > 0.5 * stable))


def test_auto_samples_the_actuation():
    fast = ws.shapes.cube().replace(amplitude=0.001, omega=5000.0)
    assert ws.Simulation(fast, GROUND, "auto").robot_dt[0] * fast.omega <= 0.5
    idle = ws.shapes.cube().replace(omega=5000.0)  # nothing breathes
    assert ws.Simulation(idle, GROUND, "auto").robot_dt[0] >= 2.5e-4


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_auto_gives_the_same_bits_alone_and_beside_a_stiff_robot(integrator):
    robots = crowd()
    stiff = ws.shapes.cube(stiffness=1e8).moved((0.0, 0.0, 0.01))
    options = {"dt": "auto", "integrator": integrator}
    together = ws.Simulation([*robots, stiff], GROUND, **options).run(0.2)
    assert together.status[-1] == ws.Status.OK
    for i, robot in enumerate(robots):
        alone = ws.Simulation(robot, GROUND, **options).run(0.2)
        assert bits(together, i) == bits(alone, 0)


def test_auto_agrees_with_a_fine_fixed_step():
    robots = [robot for robot in crowd() if not robot.is_actuated][:4]
    chosen = ws.Simulation(robots, ICE, "auto", integrator="chin4").run(0.2)
    fine = ws.Simulation(robots, ICE, 1e-5, integrator="chin4").run(0.2)
    for i in range(len(robots)):
        assert np.abs(chosen.positions(i) - fine.positions(i)).max() < 1e-3


def test_auto_refuses_what_no_step_it_knows_can_do():
    hopeless = ws.shapes.cube(stiffness=1e16)
    result = ws.Simulation([hopeless, ws.shapes.cube()], GROUND, "auto").run(0.01)
    assert list(result.status) == [ws.Status.UNSTABLE_STEP, ws.Status.OK]
    assert result.positions(0).tobytes() == hopeless.positions.tobytes()


# -- statuses ----------------------------------------------------------------------------------


def test_robot_that_sinks_is_stopped_above_the_limit():
    heavy = lone(2e4)  # rests at m g / K_G = 2 m below
    result = ws.Simulation([heavy, lone(5e3)], GROUND, DT).run(2.0)
    assert list(result.status) == [ws.Status.TOO_DEEP, ws.Status.OK]
    assert -1.0 <= result.positions(0)[0, 2] < -0.5
    assert ws.Simulation(heavy, ws.Scene(ground=None), DT).run(0.5).status[0] == ws.Status.OK
    deep = ws.Limits(depth=5.0)
    assert ws.Simulation(heavy, GROUND, DT, limits=deep).run(2.0).status[0] == ws.Status.OK


@pytest.mark.parametrize(
    "fields",
    [{"masses": 1e39}, {"masses": 1e-39}, {"stiffness": 1e39}, {"stiffness": 1e-50}],
    ids=str,
)
def test_what_float32_cannot_hold_is_invalid_at_birth(fields):
    cube = ws.shapes.cube(stiffness=1e-12).replace(**fields)
    result = ws.Simulation([cube, pair(1.0)], FREE, DT, precision="float32").run(0.1, energy=True)
    assert list(result.status) == [ws.Status.INVALID, ws.Status.OK]
    assert result.status_time[0] == 0.0
    assert np.isfinite(result.energy.total[1]).all()
    wide = ws.Simulation(cube.replace(stiffness=1e-60), FREE, DT).run(0.1)
    assert wide.status[0] == ws.Status.OK


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_mass_that_is_shot_away_and_braked_between_two_checks_is_stopped(integrator):
    # It starts inside the ground: half a kilometre in a step, and drag takes its speed at once.
    scene = ws.Scene(drag=0.01)
    result = ws.Simulation(lone(5e-9, -0.5), scene, 1e-4, integrator=integrator).run(0.02)
    assert result.status[0] != ws.Status.OK
    assert np.abs(result.positions(0)).max() <= 0.5


# -- anything ----------------------------------------------------------------------------------


def decades(low, high):
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def absurd_robots(draw):
    masses = draw(st.integers(1, 6))
    indices = st.tuples(st.integers(0, masses - 1), st.integers(0, masses - 1))
    springs = draw(st.lists(indices.filter(lambda s: s[0] != s[1]), max_size=12 * (masses > 1)))
    scale, n = draw(decades(-12, 12)), len(springs)
    point = st.tuples(*[st.sampled_from([0.0, 1.0, -1.0, 0.3])] * 3)
    robot = ws.Robot(
        masses=draw(st.lists(decades(-9, 6), min_size=masses, max_size=masses)),
        positions=scale * np.array([draw(point) for _ in range(masses)]),
        velocities=draw(decades(-300, 300)) * np.array([draw(point) for _ in range(masses)]),
        springs=np.array(springs, int).reshape(n, 2),
        stiffness=draw(st.lists(decades(-3, 12), min_size=n, max_size=n)),
        rest_length=draw(st.one_of(st.none(), decades(-12, 12))),
        amplitude=draw(st.one_of(st.just(0.0), decades(-6, 6))),
        omega=draw(decades(-3, 6)),
    )
    return robot.with_cables() if n and draw(st.booleans()) else robot


@functools.cache
def neighbours(layout):
    robots = [ws.shapes.cube(), pair(100.0, velocities=[(0, 0, 0), (0.1, 0.2, 0.3)])]
    result = ws.Simulation(robots, GROUND, DT, layout=layout).run(0.1)
    return robots, [bits(result, i) for i in range(len(robots))]


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
@settings(max_examples=25)
@given(st.lists(absurd_robots(), min_size=1, max_size=4))
def test_garbage_ends_in_a_status_or_finite_and_disturbs_nobody(layout, garbage):
    robots, expected = neighbours(layout)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = ws.Simulation([*garbage, *robots], GROUND, DT, layout=layout).run(0.1)
    for i, status in enumerate(result.status[: len(garbage)]):
        assert status in set(ws.Status)
        assert np.isfinite(result.positions(i)).all()
        assert np.isfinite(result.velocities(i)).all()
    assert [bits(result, len(garbage) + i) for i in range(len(robots))] == expected


def test_bound_with_collisions_counts_all_pairs_around_two_corners():
    # The busiest corners of a cube have six triangles and six edges: 6 + 6 + 6 x 6 pairs.
    cube, smooth = ws.shapes.cube(), {"static_friction": 0.0, "kinetic_friction": 0.0, "damping": 0}
    assert np.bincount(cube.faces.ravel()).max() == 6
    hard = ws.Collisions(stiffness=1e9, **smooth)  # next to which the cube's springs are nothing
    for integrator in INTEGRATORS:
        bound = ws.stable_dt(cube, ws.Scene(ground=None, collisions=hard), integrator)
        exact = 0.75 * LIMITS[integrator] / np.sqrt(2 * 48 * 1e9 / 0.1)
        assert bound == pytest.approx(exact, rel=3e-3)
        damped = ws.Collisions(stiffness=1e9, damping=1.0)
        slower = ws.stable_dt(cube, ws.Scene(ground=None, collisions=damped), integrator)
        assert slower < 0.7 * bound
    many = [cube, cube.replace(masses=0.001)]
    scene = ws.Scene(collisions=ws.Collisions())
    assert ws.stable_dt(many, scene).tolist() == [ws.stable_dt(one, scene) for one in many]
