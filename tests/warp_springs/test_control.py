"""Closed loops against a reference in NumPy: sensors, network, muscles; splits, layouts, ledger."""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs import sensors

RATE, DT = 25.0, 1e-3
HILLS = ws.HeightField(
    0.03 * np.random.default_rng(3).random((12, 12)), spacing=0.1, origin=(-0.5, -0.5, -0.02)
)
SCENES = {
    "ground": ws.Scene(damping=1.0),
    "hills": ws.Scene(damping=1.0, obstacles=[HILLS, ws.Box(center=(0.6, 0, 0), size=(0.2, 1, 1))]),
}


@pytest.fixture(scope="module")
def body():
    return ws.shapes.lattice(3, 1, 1).rotated((0, 0, 1), 0.4).moved((0, 0, -1e-4))


def controller(body, hidden=5, recurrent=True, seed=0, **more):
    feet = np.argsort(body.positions[:, 2])[:6]
    made = ws.Controller(
        sensors=[
            sensors.contact(feet),
            sensors.force(feet[:3], full=20.0),
            sensors.length([0, 7], full=0.1),
            sensors.velocity(full=0.5),
            sensors.tilt(),
            sensors.goal((1.0, -2.0, 0.0), full=2.0, motion=(0.5, 0.0, 0.0)),
            sensors.light([3, 9], (0.3, 0.2, 0.5), full=0.7, motion=(0.0, 0.1, 0.0)),
            sensors.clock(0.6),
        ],
        muscles=range(0, body.n_springs, 2),
        hidden=hidden,
        recurrent=recurrent,
        rate=RATE,
        **more,
    )
    rng = np.random.default_rng(seed)
    return made.replace(weights=rng.normal(size=made.n_weights))


def depths(scene, x):
    """How deep each mass is in each surface, negative above it."""
    found = [-x[:, 2]]
    for obstacle in scene.obstacles:
        if isinstance(obstacle, ws.Box):
            arms = np.abs(x - obstacle.center) - 0.5 * np.asarray(obstacle.size)
            found.append(-arms.max(axis=1))
        else:
            found.append([_terrain_depth(obstacle, p) for p in x])
    return np.array(found).T


def _terrain_depth(field, p):
    u = np.clip((p[:2] - field.origin[:2]) / field.spacing, 0.0, np.array(field.heights.shape) - 1)
    i, j = np.minimum(u.astype(int), np.array(field.heights.shape) - 2)
    a, b = u - (i, j)
    corners = field.heights[i : i + 2, j : j + 2]
    z = np.array([1 - a, a]) @ corners @ np.array([1 - b, b])
    slope = (np.array([-1, 1]) @ corners @ [1 - b, b], np.array([1 - a, a]) @ corners @ [-1, 1])
    inside = (u > 0) & (u < np.array(field.heights.shape) - 1)
    slope = np.array(slope) * inside / field.spacing
    return -(p[2] - field.origin[2] - z) / np.sqrt(1.0 + slope @ slope)


def readings(body, scene, x, v, t):
    """What the sensors of `controller` read, from their description alone."""
    m = body.masses / body.mass
    rest = body.positions - m @ body.positions
    turn = np.linalg.lstsq(
        np.sqrt(m)[:, None] * rest, np.sqrt(m)[:, None] * (x - m @ x), rcond=None
    )
    forward, left = turn[0][0], turn[0][1]
    forward = forward / np.linalg.norm(forward)
    left = left - forward * (left @ forward)
    left /= np.linalg.norm(left)
    center, moving = m @ x, m @ v
    deep = depths(scene, x)
    feet = np.argsort(body.positions[:, 2])[:6]
    values = [*(deep[feet].max(axis=1) >= 0.0).astype(float)]
    values += [*(1e5 * np.maximum(deep[feet[:3]], 0.0).sum(axis=1) / 20.0)]
    for s in (0, 7):
        i, j = body.springs[s]
        values.append((np.linalg.norm(x[i] - x[j]) / body.rest_length[s] - 1.0) / 0.1)
    up = np.cross(forward, left)
    values += [moving @ axis / 0.5 for axis in (forward, left, up)] + [forward[2], left[2]]
    way = np.array([1.0 + 0.5 * t, -2.0]) - center[:2]
    ahead, there = forward[:2] / np.hypot(*forward[:2]), way / np.hypot(*way)
    values += [np.hypot(*way) / 2.0, ahead @ there, ahead[0] * there[1] - ahead[1] * there[0]]
    for i in (3, 9):
        d = x[i] - np.array([0.3, 0.2 + 0.1 * t, 0.5])
        values.append(1.0 / (1.0 + d @ d / 0.49))
    return np.array([*values, np.sin(2 * np.pi * t / 0.6), np.cos(2 * np.pi * t / 0.6)])


def thought(made, values, memory):
    """Outputs and the new memory."""
    one, weights = np.ones(1), made.weights
    if not made.hidden:
        return np.tanh(weights.reshape(made.n_outputs, -1) @ np.append(values, 1.0)), memory
    into = np.concatenate([values, memory if made.recurrent else [], one])
    first = made.hidden * len(into)
    memory = np.tanh(weights[:first].reshape(made.hidden, -1) @ into)
    outputs = weights[first:].reshape(-1, made.hidden + 1) @ np.append(memory, 1.0)
    return np.tanh(outputs), memory


@pytest.mark.parametrize("world", SCENES)
@pytest.mark.parametrize(("hidden", "recurrent"), [(5, True), (4, False), (0, False)])
def test_sensors_and_network_are_those_of_the_reference(body, world, hidden, recurrent):
    scene, made = SCENES[world], controller(body, hidden, recurrent)
    simulation = ws.Simulation(body.controlled(made), scene, dt=DT)
    x, v, memory = body.positions, body.velocities, np.zeros(hidden)
    touched = 0.0
    for k in range(12):
        values = readings(body, scene, x, v, k / RATE)
        outputs, memory = thought(made, values, memory)
        end = simulation.run(1.0 / RATE)
        np.testing.assert_allclose(end.signals(0), outputs, rtol=0, atol=1e-9)
        x, v = end.positions(0), end.velocities(0)
        touched = max(touched, values[:6].mean())
    assert touched > 0.0  # or it would prove nothing about contact


def test_muscles_obey_their_outputs(body):
    """Bound to one output of a constant, a spring has the rest length that this asks for."""
    two = ws.Robot(masses=0.1, positions=[(0, 0, 0), (0.2, 0, 0)], springs=[(0, 1)], stiffness=50.0)
    made = ws.Controller([sensors.tilt()], [0], weights=[0, 0, 0.5], hidden=0, reach=0.3)
    free = ws.Scene(gravity=(0, 0, 0), ground=None, damping=5.0)
    end = ws.Simulation(two.controlled(made), free).run(8.0)
    length = np.linalg.norm(np.diff(end.positions(0), axis=0))
    assert length == pytest.approx(0.2 * (1 + 0.3 * np.tanh(0.5)), abs=1e-6)


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_splitting_and_looking_change_no_bit_and_layouts_agree(body, layout):
    scene = SCENES["ground"]
    robots = [body.controlled(controller(body, seed=s, response=0.05 * s)) for s in range(3)]
    robots.append(body)
    options = {"dt": DT, "threads": 2}
    whole = ws.Simulation(robots, scene, layout=layout, **options).run(0.4)
    simulation = ws.Simulation(robots, scene, layout=layout, **options)
    simulation.run(0.2, fps=70)
    simulation.run(0.013, energy=True)
    parts = simulation.run(0.187)
    lanes = ws.Simulation(robots, scene, layout="lanes", **options).run(0.4)
    alone = ws.Simulation(robots[1], scene, layout=layout, **options).run(0.4)
    for i in range(4):
        assert parts.positions(i).tobytes() == whole.positions(i).tobytes()
        assert parts.signals(i).tobytes() == whole.signals(i).tobytes()
        np.testing.assert_allclose(whole.positions(i), lanes.positions(i), atol=1e-7)
    assert alone.positions(0).tobytes() == whole.positions(1).tobytes()
    assert np.abs(whole.positions(0) - whole.positions(3)).max() > 1e-3


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_special_and_breathing_springs_obey_too(body, layout):
    """The muscles' own rest lengths, set once for all, and a controller that asks for the same."""
    plain = body.with_cables([4, 8]).with_dashpots(0.05).breathing(0.05, omega=9.0)
    constant = ws.Controller([sensors.tilt()], [4, 6, 8], hidden=0, reach=0.2)
    weights = np.zeros((3, 3))
    weights[:, 2] = 0.3, -0.4, 0.6
    asked = plain.rest_length.copy()
    asked[[4, 6, 8]] *= 1.0 + 0.2 * np.tanh(weights[:, 2])
    controlled = plain.controlled(constant.replace(weights=weights.ravel()))
    ends = [
        ws.Simulation(robot, SCENES["ground"], dt=DT, layout=layout).run(0.2).positions(0)
        for robot in (controlled, plain.replace(rest_length=asked), plain)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    assert np.abs(ends[0] - ends[2]).max() > 1e-3


def test_variants_differ_in_their_weights_and_company_changes_no_bit(body):
    made = controller(body)
    weights = np.random.default_rng(5).normal(size=(19, made.n_weights))
    many = body.controlled(made).variants(weights=weights)
    end = ws.Simulation(many, SCENES["ground"], dt=DT, threads=2).run(0.3)
    for i in (0, 8, 18):
        alone = body.controlled(made.replace(weights=weights[i]))
        assert many[i] == alone
        one = ws.Simulation(alone, SCENES["ground"], dt=DT, threads=1).run(0.3)
        assert one.positions(0).tobytes() == end.positions(i).tobytes()
        assert one.signals(0).tobytes() == end.signals(i).tobytes()


@pytest.mark.parametrize("precision", ["float32", "mixed"])
def test_other_precisions_follow(body, precision):
    robot = body.controlled(controller(body))
    exact = ws.Simulation(robot, SCENES["ground"], dt=DT).run(0.12)
    end = ws.Simulation(robot, SCENES["ground"], dt=DT, precision=precision).run(0.12)
    np.testing.assert_allclose(end.positions(0), exact.positions(0), atol=2e-4)


@pytest.mark.parametrize("response", [0.0, 0.1])
def test_the_ledger_counts_the_work_of_the_muscles(body, response):
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    robot = body.controlled(controller(body, response=response))
    residual = []
    for dt in (1e-3, 5e-4):
        energy = ws.Simulation(robot, free, dt=dt).run(0.4, fps=50, energy=True).energy
        assert energy.work[0, -1] > 1.0
        residual.append(np.abs(energy.residual[0]).max() / energy.work[0, -1])
    assert residual[0] < 2e-3
    assert residual[1] < 0.3 * residual[0]


def test_controllers_travel_with_their_robot(body, tmp_path):
    robot = body.controlled(controller(body))
    assert ws.Robot.load(robot.save(tmp_path / "robot.npz")) == robot
    far = robot.moved((3.0, 0, 0)).rotated((0, 0, 1), 1.0)
    assert far.elements.controllers == robot.elements.controllers
    both = body.moved((0, 2, 0)).joined(robot)
    (moved,) = both.elements.controllers
    assert moved.muscles[1] == body.n_springs + 2
    together = ws.Simulation(both, SCENES["ground"], dt=DT).run(0.3)
    alone = ws.Simulation(robot, SCENES["ground"], dt=DT).run(0.3)
    np.testing.assert_allclose(
        together.positions(0)[body.n_masses :], alone.positions(0), atol=1e-9
    )
    kept = alone.load(alone.save(tmp_path / "result.npz"))
    assert kept.signals(0).tobytes() == alone.signals(0).tobytes()


def test_what_does_not_fit_is_refused(body):
    made = controller(body)
    with pytest.raises(ValueError, match=r"weights: shape \(3,\) given"):
        made.replace(weights=np.zeros(3))
    with pytest.raises(ValueError, match="spring 5000 named"):
        body.controlled(made.replace(muscles=(5000,), outputs=None, weights=None))
    with pytest.raises(ValueError, match="drives spring 0"):
        body.controlled(made).controlled(made)
    with pytest.raises(ValueError, match="another body"):
        body.replace(elements=ws.Elements(controllers=(made,)))
    with pytest.raises(ValueError, match="recurrent"):
        made.replace(hidden=0, weights=None)
    with pytest.raises(ValueError, match=r"Controller.response: got -1"):
        made.replace(response=-1)
    with pytest.raises(ValueError, match="full"):
        sensors.goal((0, 0, 0), full=0.0)
    with pytest.raises(ValueError, match="0 controllers"):
        body.variants(weights=np.zeros((2, 4)))


def lagging(response, rate=RATE):
    """Two masses in the void whose spring is told a constant, and follows with a lag."""
    two = ws.Robot(masses=0.1, positions=[(0, 0, 0), (0.2, 0, 0)], springs=[(0, 1)], stiffness=50.0)
    weights = [0, 0, 0.5]
    made = ws.Controller([sensors.tilt()], [0], weights=weights, hidden=0, reach=0.3, rate=rate)
    return two.controlled(made.replace(response=response))


def stretch_of(t, response):
    """How much longer the spring of `lagging` is: an oscillator driven by a lag, in closed form."""
    target, w2 = 0.2 * 0.3 * np.tanh(0.5), 50.0 * 2 / 0.1
    w, e = np.sqrt(w2), np.exp(-t / response)
    part = -w2 / (w2 + response**-2)  # of exp(-t / response) in y'' = w2 (1 - exp(...) - y)
    return target * (
        1 + part * e - (1 + part) * np.cos(w * t) + part / (response * w) * np.sin(w * t)
    )


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
@pytest.mark.parametrize("precision", ["float64", "float32", "mixed"])
def test_muscles_follow_with_the_lag_of_a_first_order(layout, precision):
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    simulation = ws.Simulation(
        lagging(0.08), free, dt=DT, layout=layout, precision=precision, integrator="leapfrog"
    )
    found = []
    for _ in range(8):
        x = simulation.run(0.05).positions(0)
        found.append(np.linalg.norm(x[1] - x[0]) - 0.2)
    expected = stretch_of(0.05 * np.arange(1, 9), 0.08)
    assert np.abs(expected).max() > 0.02
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_a_lag_is_the_same_at_half_the_step_and_at_any_rate():
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    ends = [
        ws.Simulation(lagging(0.08, rate), free, dt=dt).run(0.4).positions(0)
        for rate, dt in [(25.0, 1e-3), (25.0, 5e-4), (5.0, 1e-3), (250.0, 1e-3)]
    ]
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=2e-4)


def test_rest_lengths_and_tensions_of_a_run_know_the_lag():
    free, response = ws.Scene(gravity=(0, 0, 0), ground=None), 0.08
    result = ws.Simulation(lagging(response), free, dt=DT).run(0.4, fps=50)
    # Rest lengths change in steps; what holds around a frame is their mean over the step before.
    target = 0.2 * 0.3 * np.tanh(0.5)
    told = result.rest_length_frames(0)[1:, 0] - 0.2
    late, early = (target * -np.expm1(-(result.times[1:] - ago) / response) for ago in (0.0, 0.01))
    assert ((early - 1e-9 < told) & (told < late)).all() and told[0] < 0.5 * target
    length = 0.2 + stretch_of(result.times[1:], response)
    force = 50.0 * (length - 0.2 - told)
    np.testing.assert_allclose(result.tension_frames(0)[1:, 0], force, atol=0.02)
    assert result.rest_lengths(0)[0] - 0.2 == pytest.approx(told[-1])
