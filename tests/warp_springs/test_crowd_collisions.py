"""Collisions in the layouts "flat" and "block": as in the lanes, and as repeatable."""

import functools
from pathlib import Path

import numpy as np
import pytest
import warp as wp

import warp_springs as ws
from warp_springs.engine import crowd
from warp_springs.kernels import crowd_collisions
from warp_springs.kernels.block import block
from warp_springs.kernels.flat_launches import launches
from warp_springs.kernels.flat_threads import threads
from warp_springs.kernels.gather import SLICE, GatherFeatures
from warp_springs.kernels.look import look
from warp_springs.kernels.traits import Traits

KINDS = {"flat": crowd.Threads, "launches": crowd.Launches, "block": crowd.Blocks}
SCENE = ws.Scene(collisions=ws.Collisions())


@functools.cache
def stack():
    """Three spinning cubes that fall onto each other, and on their own corners."""
    cube = ws.shapes.cube(mass=0.8, stiffness=1e4)
    return [
        cube.rotated((1, 2, 3), 0.3 * i)
        .moved((0.01 * i, 0.013 * i, 0.02 + 0.13 * i))
        .spinning((3, -2, 4))
        for i in range(3)
    ]


def run(robots, layout, duration=0.08, scene=SCENE, world="together", **options):
    simulation = ws.Simulation(robots, scene, dt=5e-4, world=world, layout=layout, **options)
    return simulation.run(duration, fps=50, energy=True)


@pytest.fixture
def kinds(monkeypatch):
    """The layout by the name of a kind of crowd."""

    def choose(kind):
        monkeypatch.setattr(crowd, "kind_of", lambda layout, device: KINDS[kind])
        return "block" if kind == "block" else "flat"

    return choose


@pytest.mark.parametrize(
    ("kind", "integrator", "precision"),
    [
        ("flat", "chin4", "float64"),
        ("flat", "euler", "float32"),
        ("launches", "leapfrog", "float64"),
        ("launches", "chin4", "mixed"),
        ("block", "chin4", "float64"),
    ],
)
def test_all_layouts_agree_with_the_lanes(kind, integrator, precision, kinds):
    options = {"integrator": integrator, "precision": precision}
    expected = run(stack(), "lanes", **options)
    found = run(stack(), kinds(kind), **options)
    tolerance = {"float64": 1e-12, "float32": 1e-4, "mixed": 1e-5}[precision]
    assert np.ptp(expected.energy.ground[0]) > 1e-3 and expected.energy.friction_loss[0, -1] > 0.01
    assert found.frames(0) == pytest.approx(expected.frames(0), abs=tolerance)
    for name in ("kinetic", "ground", "friction_loss", "residual"):
        there = getattr(expected.energy, name)
        assert getattr(found.energy, name) == pytest.approx(there, abs=1e3 * tolerance)


def test_lists_that_do_not_fit_change_no_bit(kinds, monkeypatch):
    layout = kinds("flat")
    alone = run(stack(), layout)
    text = crowd_collisions.CROWD_COLLIDING.replace("ROOM = 32", "ROOM = 1")
    assert text != crowd_collisions.CROWD_COLLIDING
    monkeypatch.setattr("warp_springs.kernels.gather.CROWD_COLLIDING", text)
    monkeypatch.setattr(GatherFeatures, "name", property(lambda self: f"no_room_{self.layout}"))
    for cached in (launches, threads, look):
        cached.cache_clear()
    walked = run(stack(), layout)
    for cached in (launches, threads, look):
        cached.cache_clear()
    assert np.array_equal(walked.frames(0), alone.frames(0))


@pytest.mark.parametrize("kind", ["flat", "launches", "block"])
def test_worlds_never_meet_and_nothing_else_matters_to_a_world(kind, kinds):
    layout = kinds(kind)
    alone = run(stack(), layout, threads=1)
    two = ws.Simulation(
        [*stack(), *stack()], SCENE, dt=5e-4, world=[0, 0, 0, 1, 1, 1], layout=layout, threads=2
    )
    two.run(0.04, fps=100)
    both = two.run(0.04)
    for world in range(2):
        assert np.array_equal(both.positions(world), alone.positions(0))


def test_a_large_body_bounces_off_another():
    ball = ws.shapes.sphere(radius=0.1, subdivisions=2, mass=2.0, stiffness=2e3)
    ball = ball.moved(-ball.center_of_mass)
    pair = [ball, ball.moved((0.02, 0, 0.22)).moving((0, 0, -1.0))]
    scene = ws.Scene(
        gravity=(0, 0, 0),
        ground=None,
        collisions=ws.Collisions(stiffness=1e4, static_friction=0, kinetic_friction=0, damping=0),
    )
    simulation = ws.Simulation(pair, scene, world="together", layout="flat")
    result = simulation.run(0.1, fps=100, energy=True)
    momentum = result.robots[0].masses @ result.velocities(0)
    own = simulation.members[0][0][1]
    assert result.status[0] == ws.Status.OK
    assert momentum == pytest.approx((0, 0, -ball.mass), abs=1e-9)
    assert result.velocities(0)[own, 2].mean() < -0.2  # it was pushed
    assert np.abs(result.energy.residual).max() < 1e-3 * result.energy.total[0, 0]


@pytest.mark.parametrize("layout", ["block", "launches"])
def test_the_kernels_compile_for_a_gpu(layout, tmp_path):
    about = GatherFeatures(
        precision="float32",
        width=SLICE,
        integrator="leapfrog",
        ledger=False,
        layout=layout,
        actuated=False,
        ground=False,
        friction="none",
        damping=False,
        drag=False,
        traits=Traits(colliding=True),
    )
    kernel = block(about, 256) if layout == "block" else launches(about).tick
    wp.set_module_options({"block_dim": 256}, kernel.module)
    (path,) = wp.compile_aot_module(kernel.module, arch=[90], module_dir=tmp_path, use_ptx=False)
    assert Path(path).read_bytes()[:4] == b"\x7fELF"
