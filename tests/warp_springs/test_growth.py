"""Controllers whose outputs grow: against NumPy, within limits, of a budget, in the ledger."""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs import sensors

FREE = ws.Scene(gravity=(0, 0, 0), ground=None, damping=5.0)


def growing(body, outputs, biases, reach=None, **growth):
    """A controller that asks for constants, whatever it reads."""
    made = ws.Controller(
        [sensors.tilt()],
        range(body.n_springs),
        outputs=outputs,
        hidden=0,
        reach=np.linspace(0.2, 3.0, body.n_springs) if reach is None else reach,
        rate=50.0,
        growth=ws.Growth(**growth),
    )
    weights = np.zeros((made.n_outputs, 3))
    weights[:, 2] = biases
    return body.controlled(made.replace(weights=weights.ravel()))


@pytest.fixture(scope="module")
def chain():
    """Springs end to end, at rest."""
    return ws.Robot(
        masses=0.1,
        positions=[(0.1 * i, 0, 0) for i in range(4)],
        springs=[(i, i + 1) for i in range(3)],
        stiffness=80.0,
    )


def lengths(robot, x):
    i, j = robot.springs.T
    return np.linalg.norm(x[j] - x[i], axis=1)


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_rest_lengths_grow_at_the_speed_of_their_output_up_to_the_limit(chain, layout):
    robot = growing(chain, [0, 1, 2], [0.5, 3.0, -1.0], speed=0.8, limit=0.6)
    simulation = ws.Simulation(robot, FREE, dt=1e-3, layout=layout)
    end = simulation.run(0.5)
    step = 0.8 / 50.0 * np.tanh([0.5, 3.0, -1.0])  # 25 readings
    np.testing.assert_allclose(end.signals(0), np.clip(25 * step, 0.0, 0.6), atol=1e-12)
    end = simulation.run(6.0)
    np.testing.assert_allclose(end.signals(0), [0.6, 0.6, 0.0], atol=1e-12)
    wanted = 0.1 * (1.0 + np.linspace(0.2, 3.0, 3) * [0.6, 0.6, 0.0])
    np.testing.assert_allclose(lengths(robot, end.positions(0)), wanted, atol=1e-6)


def test_a_muscle_may_obey_the_mean_of_two_outputs(chain):
    robot = growing(chain, [(0, 0), (0, 1), (1, 1)], [9.0, -9.0], speed=1.0, limit=0.5)
    end = ws.Simulation(robot, FREE, dt=1e-3).run(8.0)
    wanted = 0.1 * (1.0 + np.linspace(0.2, 3.0, 3) * [0.5, 0.25, 0.0])
    np.testing.assert_allclose(lengths(robot, end.positions(0)), wanted, atol=1e-6)


def test_material_is_shared_out_as_it_is_asked_for_and_no_more_than_there_is(chain):
    biases = [0.2, 0.4, 2.0]
    robot = growing(chain, [0, 1, 2], biases, speed=1.0, limit=0.9, budget=1.3)
    simulation, grown = ws.Simulation(robot, FREE, dt=1e-3), np.zeros(3)
    step = np.tanh(biases) / 50.0
    for _ in range(60):
        asked = np.minimum(step, 0.9 - grown)
        grown += asked * min(1.0, max(1.3 - grown.sum(), 0.0) / max(asked.sum(), 1e-300))
        np.testing.assert_allclose(simulation.run(0.02).signals(0), grown, atol=1e-12)
    simulation.run(1.0)
    assert simulation.run(0.02).signals(0).sum() == pytest.approx(1.3, abs=1e-9)


def test_growth_follows_the_light(chain):
    """Whoever is in the light grows; a lamp that moves on takes growth along, never back."""
    made = ws.Controller(
        [sensors.light([0, 3], (-0.2, 0, 0), full=0.1, motion=(0.35, 0, 0))],
        [0, 2],
        weights=[20.0, 0.0, -10.0, 0.0, 20.0, -10.0],
        hidden=0,
        reach=1.0,
        growth=ws.Growth(speed=0.5),
    )
    held = chain.fixed().controlled(made)
    simulation = ws.Simulation(held, FREE, dt=1e-3)
    first = simulation.run(0.9).signals(0)
    then = simulation.run(1.1).signals(0)
    assert first[0] > 0.1 and first[1] == 0.0
    assert then[0] >= first[0] and then[1] > 0.1


def test_the_ledger_counts_the_work_of_growth():
    """A column that grows lifts its own weight; what it gives shows as work, nothing is left."""
    body = ws.shapes.lattice(1, 1, 2)
    body = body.fixed(body.positions[:, 2] < 0.01)
    robot = growing(body, np.zeros(body.n_springs, int), [1.0], reach=1.0, speed=0.4, limit=0.5)
    scene = ws.Scene(damping=2.0, ground=None)
    residual = []
    for dt in (1e-3, 5e-4):
        energy = (
            ws.Simulation(robot, scene, dt=dt, integrator="leapfrog")
            .run(1.0, fps=50, energy=True)
            .energy
        )
        lifted = energy.gravity[0, -1] - energy.gravity[0, 0]
        assert lifted > 0.1 and energy.work[0, -1] > lifted
        residual.append(np.abs(energy.residual[0]).max() / energy.work[0, -1])
    assert residual[0] < 5e-3 and residual[1] < 0.6 * residual[0]


def test_splitting_and_company_change_no_bit(chain):
    robots = [growing(chain, [0, 1, 0], [b, 0.3], budget=0.4) for b in (0.1, 0.5, 1.0)] + [chain]
    whole = ws.Simulation(robots, FREE, dt=1e-3, threads=2).run(0.7)
    simulation = ws.Simulation(robots, FREE, dt=1e-3, threads=1)
    simulation.run(0.31, fps=60, energy=True)
    parts = simulation.run(0.39)
    alone = ws.Simulation(robots[1], FREE, dt=1e-3).run(0.7)
    for i in range(4):
        assert parts.positions(i).tobytes() == whole.positions(i).tobytes()
        assert parts.signals(i).tobytes() == whole.signals(i).tobytes()
    assert alone.positions(0).tobytes() == whole.positions(1).tobytes()


def test_growth_is_kept_in_files(chain, tmp_path):
    robot = growing(chain, [(0, 1), (1, 1), (0, 0)], [0.3, 0.2], budget=0.7)
    again = ws.Robot.load(robot.save(tmp_path / "robot.npz"))
    assert again == robot
    other = growing(chain, [(0, 1), (1, 1), (0, 0)], [0.3, 0.2])
    assert ws.Robot.load(other.save(tmp_path / "robot.npz")) == other != robot


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"growth": 0.5}, r"Controller.growth: got 0.5, expected a Growth or None"),
        ({"reach": -1.0, "growth": ws.Growth()}, "shrink to nothing"),
        ({"reach": [0.1, 0.2]}, "a number, or one for each of 3 muscles"),
        ({"reach": [0.1, 0.2, 1.5]}, "less than 1"),
        ({"outputs": [(0, 1, 2)] * 3}, "one or two for each muscle"),
        ({"outputs": [(0, -1)] * 3}, "expected indices from 0 on"),
    ],
)
def test_what_does_not_fit_is_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        ws.Controller([sensors.tilt()], range(3), **changes)


@pytest.mark.parametrize("name", ["speed", "limit", "budget"])
def test_growth_is_checked(name):
    with pytest.raises(ValueError, match=f"Growth.{name}"):
        ws.Growth(**{name: -1.0})
