"""Rest lengths and tensions of a run: what controllers ask for and what yields, in every view."""

import meshio
import numpy as np
import pytest
from pxr import Usd

import warp_springs as ws
from tests.warp_springs.test_control import DT, SCENES, controller
from warp_springs import sensors
from warp_springs.view import appearance
from warp_springs.view.look import Look
from warp_springs.view.pages.scene import described
from warp_springs.view.pictures.actors import actors_of


@pytest.fixture(scope="module")
def body():
    return ws.shapes.lattice(3, 1, 1).rotated((0, 0, 1), 0.4).moved((0, 0, -1e-4))


def asking(body, outputs):
    """A body whose controller asks for these outputs of some muscles, always, and its twin that
    has the same as its own rest lengths."""
    muscles = list(range(4, 4 + len(outputs)))
    weights = np.zeros((len(muscles), 3))
    weights[:, 2] = np.arctanh(outputs)
    asked = body.rest_length.copy()
    asked[muscles] *= 1.0 + 0.2 * np.array(outputs)
    made = ws.Controller([sensors.tilt()], muscles, weights.ravel(), hidden=0, reach=0.2)
    return body.controlled(made), body.replace(rest_length=asked)


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_tensions_in_frames_know_what_controllers_ask_for(body, layout, tmp_path):
    robot, twin = asking(body.breathing(0.05, omega=9.0), [0.3, -0.4, 0.6])
    robots = [twin, robot, body]
    result = ws.Simulation(robots, SCENES["ground"], dt=DT, layout=layout).run(0.2, fps=50)
    np.testing.assert_array_equal(result.signal_frames(1)[0], 0.0)  # nothing was asked for yet
    np.testing.assert_allclose(
        result.signal_frames(1)[1:], np.tile([0.3, -0.4, 0.6], (10, 1)), atol=1e-12
    )
    assert result.signal_frames(0).shape == (11, 0)
    np.testing.assert_allclose(
        result.rest_length_frames(1)[1:], result.rest_length_frames(0)[1:], rtol=1e-12
    )
    forces = result.tension_frames(1), result.tension_frames(0)
    np.testing.assert_allclose(forces[0][1:], forces[1][1:], atol=1e-5)
    assert np.abs(forces[0][0] - forces[1][0]).max() > 1.0
    np.testing.assert_allclose(result.tension(1), forces[1][-1], atol=1e-5)
    np.testing.assert_allclose(result.rest_lengths(1), result.rest_length_frames(1)[-1])
    np.testing.assert_array_equal(result.tension_frames(1, [3, 7]), forces[0][[3, 7]])
    kept = result.load(result.save(tmp_path / "result.npz"))
    np.testing.assert_array_equal(kept.tension_frames(1), forces[0])


def test_outputs_in_frames_are_those_at_their_times(body):
    made = controller(body)
    simulation = ws.Simulation(body.controlled(made), SCENES["ground"], dt=DT)
    parts = [simulation.run(0.02).signals(0) for _ in range(6)]
    seen = []

    def look(_):
        if (so_far := simulation.so_far()) is not None:
            seen.append(so_far.signal_frames(0).copy())

    simulation = ws.Simulation(body.controlled(made), SCENES["ground"], dt=DT)
    whole = simulation.run(0.12, fps=50, progress=look)
    np.testing.assert_array_equal(whole.signal_frames(0)[1:], parts)
    assert all((early == whole.signal_frames(0)[: len(early)]).all() for early in seen)
    assert np.ptp(whole.signal_frames(0), axis=0).max() > 0.1


def test_every_view_shows_the_stress_and_the_muscles_of_a_controller(body, tmp_path):
    robot, twin = asking(body, [0.9, -0.9])
    result = ws.Simulation([robot, twin], SCENES["ground"], dt=DT).run(0.2, fps=50)
    for color in ("stress", "actuation"):
        film = actors_of(result, [0, 1], Look(color=color), None, film=True)
        end = actors_of(result, [0], Look(color=color), None, film=False)[0]
        shown = film[0].colors(0.1)
        if color == "stress":
            np.testing.assert_allclose(shown, film[1].colors(0.1), atol=0.05)
        else:
            neutral = np.abs(shown - appearance.NEUTRAL).max(axis=1) < 1e-6
            assert np.flatnonzero(~neutral).tolist() == [4, 5]
            assert film[0].scale == pytest.approx(0.18)
        np.testing.assert_allclose(end.colors(0.2), film[0].colors(0.2), atol=0.05)
    header, _ = described(result, [0, 1], {}, {}, True, None)
    assert header["robots"][0]["actuationScale"] == pytest.approx(0.18)
    assert header["robots"][1]["actuation"] is None
    force = np.abs(result.tension_frames(0))
    assert header["robots"][0]["stressScale"] == pytest.approx(np.percentile(force, 95))
    stage = Usd.Stage.Open(str(ws.export_usd(result, tmp_path / "two.usdc")))
    scales = [
        p.GetCustomDataByKey("warp_springs:stressScale")
        for p in stage.GetPrimAtPath("/World/Robots").GetChildren()
    ]
    assert scales[0] == pytest.approx(np.percentile(force, 95), rel=1e-6)
    (first, *_) = ws.write_mesh(result, tmp_path / "last.vtu")
    lines = meshio.read(first).cell_data["tension"][0]
    np.testing.assert_allclose(lines, result.tension(0))


@pytest.mark.parametrize("layout", ["lanes", "flat", "block"])
def test_no_spring_carries_more_than_makes_it_yield(cube, layout):
    """The stress that it yields at is the largest force that any frame or view may show."""
    limit = 1.0
    weak = cube.with_limits(yields=limit / 1e-4, area=1e-4, springs=[2, 9]).with_dashpots(0.2)
    fast = weak.replace(velocities=8.0 * (cube.positions - cube.center_of_mass))
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    result = ws.Simulation([cube, fast, weak], free, dt=1e-4, layout=layout).run(0.3, fps=1000)
    force = result.tension_frames(1)
    assert np.abs(force[:, [2, 9]]).max() == pytest.approx(limit, rel=0.08)  # a step ahead
    assert np.abs(np.delete(force, [2, 9], axis=1)).max() > 2.0 * limit
    flow = result.rest_length_change(1)
    np.testing.assert_array_equal(flow[-1], result.yielded(1))
    assert flow[0].max() == 0.0 < flow[50, 2] and np.count_nonzero(flow[-1]) == 2
    assert result.rest_length_change(1, yielded=False) is None
    assert result.rest_length_change(0) is None
    (actor,) = actors_of(result, [1], Look(), None, film=True)
    shown = appearance.stress_color(force[300], actor.scale)
    np.testing.assert_allclose(actor.colors(0.3), shown, atol=1e-6)
    as_if = fast.tension(result.frames(1)[300], 0.3)  # nothing had yielded
    assert np.abs(as_if - force[300]).max() > 0.3


def test_a_broken_spring_carries_nothing(cube):
    weak = cube.spinning((0, 0, 8.0)).with_limits(breaks=0.24, springs=[12])
    result = ws.Simulation(weak, ws.Scene(gravity=(0, 0, 0), ground=None)).run(0.1, fps=400)
    broken = result.broken(0)[12]
    assert 0.0 < broken < 0.1
    force = result.tension_frames(0)[:, 12]
    assert (force[result.times >= broken] == 0.0).all() and (force[1:4] > 0.0).all()
    assert result.tension(0)[12] == 0.0
    assert np.abs(force).max() < 0.24
