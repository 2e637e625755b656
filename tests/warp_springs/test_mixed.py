"""Mixed precision: float32 forces, positions and velocities held as sums of two float32."""

import numpy as np
import pytest

import warp_springs as ws

DT = 2.0**-10  # a step that float32 holds exactly
FREE = ws.Scene(gravity=(0.0, 0.0, -8.0), ground=None)


def inchworm(start=(0.0, 0.0, 0.0)):
    """Walks a few centimetres a second on what it stands on."""
    body = ws.shapes.lattice(3, 1, 1, stiffness=2000.0)
    middle = body.positions[body.springs].mean(axis=1) / 0.1
    phase = 2.0 * middle[:, 0] + 1.5 * middle[:, 2]
    walker = body.replace(amplitude=0.1 * body.rest_length, phase=phase, omega=4.0 * np.pi)
    return walker.moved(start)


def end(robots, scene, duration, precision="mixed", dt=DT, **options):
    result = ws.Simulation(robots, scene, dt, precision=precision, **options).run(duration)
    assert (result.status == ws.Status.OK).all()
    return result


def test_a_walker_far_away_walks_as_at_the_origin_and_as_in_float64():
    scene = ws.Scene(
        ground=ws.Ground(static_friction=0.5, kinetic_friction=0.4),
        damping=20.0,
    )
    far = np.array([1024.0, -2048.0, 0.0])
    truth = end(inchworm(far), scene, 2.0, "float64", dt=DT / 32).positions(0)
    coarse = end(inchworm(far), scene, 2.0, "float64").positions(0)
    mixed = end(inchworm(far), scene, 2.0).positions(0)
    near = end(inchworm(), scene, 2.0).positions(0)
    np.testing.assert_allclose(mixed - far, near, atol=1e-12, rtol=0.0)
    error, allowed = (np.sqrt(((x - truth) ** 2).mean()) for x in (mixed, coarse))
    assert error < 3.0 * allowed
    assert np.abs(mixed - inchworm(far).positions).max() > 1e-2  # it did walk


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog", "euler"])
def test_a_million_small_steps_lose_nothing(integrator):
    # A body without stress falls freely: every number of its motion is a sum of equal parts, which
    # in float32 drift by millimetres.
    cube = ws.shapes.cube().moved((3.0, 1000.0, 500.0)).moving((64.0, -0.0078125, 0.0))
    steps = 2**16
    result = end([cube] * 2, FREE, steps * DT, integrator=integrator)
    time = steps * DT
    fall = -4.0 * time**2 - (4.0 * time * DT if integrator == "euler" else 0.0)
    way = result.positions(0).mean(axis=0) - cube.positions.mean(axis=0)
    np.testing.assert_allclose(way, [64.0 * time, -0.0078125 * time, fall], rtol=2e-7, atol=1e-6)


@pytest.mark.parametrize("robots", [1, 2])
def test_the_origin_follows_exactly(robots):
    # A point flies at a constant velocity through hundreds of origins.
    body = ws.Robot(
        masses=[1.0, 1.0],
        positions=[(0.1, 0.2, 0.3), (0.4, 0.2, 0.3)],
        springs=[(0, 1)],
        stiffness=10.0,
        rest_length=0.3,
        velocities=[(100.0 / 3.0, -77.7, 55.5)] * 2,
    )
    scene = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)
    result = end([body] * robots, scene, 2.0)
    expected = body.positions + 2.0 * body.velocities
    # The first half of a velocity moves a mass; what it drops is 2^-25 of the way.
    np.testing.assert_allclose(result.positions(0), expected, rtol=2.0**-24)
    np.testing.assert_allclose(result.velocities(0), body.velocities, rtol=1e-8)
    gap = result.positions(0)[1] - result.positions(0)[0]
    np.testing.assert_allclose(gap, (0.3, 0.0, 0.0), atol=1e-7)


def test_a_tall_body_touches_the_ground_as_exactly_as_a_low_one():
    # It lands with its origin high above the ground, and its lowest mass sinks as deep as it must.
    scene = ws.Scene(ground=ws.Ground(stiffness=1e4), damping=30.0)
    tower = ws.Robot(
        masses=[0.1, 0.1],
        positions=[(0, 0, 0.001), (0, 0, 40.001)],
        springs=[(0, 1)],
        stiffness=100.0,
        rest_length=40.0,
    )
    result = end(tower, scene, 4.0)
    depth = 0.2 * 9.81 / 1e4
    np.testing.assert_allclose(result.positions(0)[0, 2], -depth, rtol=2e-3)


def test_energies_far_away_are_those_at_the_origin():
    scene = ws.Scene(ground=ws.Ground(), damping=5.0)
    start = (0.0, 0.0, 0.002)
    near, far = (
        ws.Simulation(inchworm(at), scene, DT, precision="mixed").run(0.5, energy=True)
        for at in (start, (1024.0, 0.0, 0.002))
    )
    for name in ("kinetic", "gravity", "spring", "ground", "work", "damping_loss"):
        np.testing.assert_allclose(
            getattr(far.energy, name), getattr(near.energy, name), rtol=1e-6, atol=1e-9
        )
    exact = ws.Simulation(inchworm(start), scene, DT).run(0.5, energy=True)
    np.testing.assert_allclose(near.energy.total, exact.energy.total, rtol=0.02)


def test_what_goes_wrong_is_stopped_and_its_neighbours_do_not_notice():
    good = inchworm((1000.0, 0.0, 0.01))
    huge = good.moved((1e30, 0.0, 0.0))
    wild = good.moving((0.0, 0.0, 1e30))
    weird = good.replace(masses=np.full(good.n_masses, 1e-300))
    scene = ws.Scene()
    result = ws.Simulation([good, huge, wild, weird, good], scene, DT, precision="mixed").run(0.2)
    assert (result.status != ws.Status.OK).tolist() == [False, False, True, True, False]
    alone = end(good, scene, 0.2)
    for index in (0, 4):
        np.testing.assert_array_equal(result.positions(index), alone.positions(0))


FAR = np.array([1024.0, -2048.0, 8.0])
NORMAL = np.array([1.0, -1.0, 3.0]) / np.sqrt(11.0)


def puppet(at):
    """Breathes, lies on a box, and is fixed, held and tethered at the rest of its masses."""
    body = ws.shapes.lattice(3, 1, 1, stiffness=2000.0).breathing(0.05, 4.0 * np.pi, phase=0.3)
    x = body.positions
    body = (
        body.fixed([0])
        .held_to(ws.Sphere(x[13] + (0.0, 0.0, 0.4), 0.4), [13])
        .held_to(ws.Circle(x[15] + (0.0, 0.18, 0.24), (1.0, 0.0, 0.0), 0.3), [15])
        .held_to(ws.Line(x[8], (1.0, 2.0, 0.5)), [8])
        .held_to(ws.Plane(NORMAL, x[11] @ NORMAL), [11])
        .tethered([12], 30.0, point=(0.5, 0.3, 0.2))
    )
    return body.moved(at)


def theatre(at):
    """What stands around the puppet: the same wherever that is."""
    place = np.asarray(at, float)
    waves = 0.01 * np.cos(np.arange(12.0)).reshape(3, 4)
    return ws.Scene(
        ground=None,
        obstacles=(
            ws.Box(place + np.array((0.1, 0.1, -0.11)), (0.3, 0.3, 0.2)),
            ws.Sphere(place + np.array((0.3, 0.1, -0.5)), 0.48),
            ws.HeightField(waves, 0.2, origin=place + np.array((-0.1, -0.1, -0.02))),
            ws.Plane((0.0, -0.6, 0.8), 0.8 * (place[2] - 0.2) - 0.6 * place[1]),
        ),
        damping=2.0,
    )


def worst_distance(frames, at):
    """How far a frame ever is from the constraints of the puppet."""
    x = frames - np.asarray(at)
    start = puppet((0.0, 0.0, 0.0)).positions
    sphere, circle, line, plane = (x[:, i] for i in (13, 15, 8, 11))
    along = np.array((1.0, 2.0, 0.5)) / np.linalg.norm((1.0, 2.0, 0.5))
    found = [
        np.linalg.norm(sphere - start[13] - (0.0, 0.0, 0.4), axis=1) - 0.4,
        np.linalg.norm(circle - start[15] - (0.0, 0.18, 0.24), axis=1) - 0.3,
        circle[:, 0] - start[15, 0],
        np.linalg.norm(np.cross(line - start[8], along), axis=1),
        (plane - start[11]) @ NORMAL,
    ]
    return max(np.abs(value).max() for value in found)


def test_obstacles_constraints_and_tethers_are_exact_in_every_layout_and_everywhere():
    def play(at, precision, layout="lanes", dt=DT):
        options = {"precision": precision, "layout": layout}
        simulation = ws.Simulation([puppet(at)] * 2, theatre(at), dt, **options)
        result = simulation.run(0.75, fps=32, record=[1], energy=True)
        assert (result.status == ws.Status.OK).all()
        return result

    truth = play(FAR, "float64", dt=DT / 16).frames(1)
    coarse = play(FAR, "float64")
    allowed = np.sqrt(((coarse.frames(1) - truth) ** 2).mean())
    near = play((0.0, 0.0, 0.0), "mixed")
    assert worst_distance(near.frames(1), (0.0, 0.0, 0.0)) < 1e-14
    for layout in ("lanes", "flat", "block"):
        far = play(FAR, "mixed", layout)
        assert worst_distance(far.frames(1), FAR) < 1e-12
        assert np.all(far.frames(1)[:, 0] == puppet(FAR).positions[0])
        assert np.abs(far.frames(1) - FAR - near.frames(1)).max() < 3e-6
        assert np.sqrt(((far.frames(1) - truth) ** 2).mean()) < 1.5 * allowed
        assert np.abs(far.energy.residual - coarse.energy.residual).max() < 1e-4
    moved = np.abs(far.frames(1)[-1] - puppet(FAR).positions).max(axis=1)
    assert np.all(moved[1:] > 5e-4)


def test_a_weight_on_a_tether_swings_far_away_as_it_must():
    # Its closed form: half a period of pi sqrt(m / k) brings it to the other side.
    mass = ws.Robot(
        masses=[0.1], positions=[(0.3, 0, 0)], springs=np.empty((0, 2), int), stiffness=[]
    )
    swung = mass.tethered(0, 10.0, point=(0, 0, 0)).moved(FAR)
    half = np.pi * np.sqrt(0.1 / 10.0)
    result = end([swung] * 2, ws.Scene(gravity=(0, 0, 0), ground=None), half, dt=half / 256)
    np.testing.assert_allclose(result.positions(1)[0] - FAR, (-0.3, 0, 0), atol=2e-7)
