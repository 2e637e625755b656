"""The energy ledger: its formulas by hand, and its constancy where nothing is lost."""

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.reference import energies

NAMES = ("kinetic", "gravity", "spring", "ground")
LEDGER = ("total", "work", "damping_loss", "drag_loss", "friction_loss", "losses", "residual")
INTEGRATORS = ("leapfrog", "chin4", "euler")


def test_energies_of_a_pose_worked_out_by_hand():
    robot = ws.Robot(
        masses=[0.5, 2.0],
        positions=[(0.0, 0.0, -0.01), (0.0, 0.3, 0.39)],  # 0.5 m apart
        velocities=[(1.0, 2.0, -2.0), (0.0, 0.0, 3.0)],
        springs=[(0, 1)],
        stiffness=[100.0],
        rest_length=[0.4],
        amplitude=[0.2],
        phase=[np.pi / 6],  # rest length 0.4 + 0.2 / 2 = 0.5 m ...
        omega=np.pi / 3,
    ).replace(rest_length=[0.3])  # ... less 0.1 m: stretched by 0.1 m
    scene = ws.Scene(gravity=(0.0, 1.0, -10.0), ground=ws.Ground(stiffness=1e4))
    result = ws.Simulation(robot, scene, dt=1e-4).run(1e-3, fps=1000, energy=True)
    ledger = result.energy
    assert ledger.kinetic[0, 0] == pytest.approx(0.25 * 9 + 1.0 * 9)
    assert ledger.gravity[0, 0] == pytest.approx(-0.5 * 0.1 + 2.0 * (3.9 - 0.3))
    assert ledger.spring[0, 0] == pytest.approx(50 * 0.1**2)
    assert ledger.ground[0, 0] == pytest.approx(5e3 * 0.01**2)
    assert ledger.total[0, 0] == pytest.approx(11.25 - 0.05 + 7.2 + 0.5 + 0.5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("ground", [None, ws.Ground()], ids=["no ground", "ground"])
def test_ledger_at_the_end_matches_the_reported_state(walker, tumbling_cube, integrator, ground):
    robots = [walker, tumbling_cube.moved((0, 0, -0.25))]
    scene = ws.Scene(ground=ground, damping=0.5)
    result = ws.Simulation(robots, scene, dt=2e-4, integrator=integrator).run(
        0.1, fps=50, energy=True
    )
    for i, robot in enumerate(robots):
        state = result.positions(i), result.velocities(i), result.end_time
        expected = energies(robot, scene, *state)
        for name in (*NAMES, "total"):
            measured = getattr(result.energy, name)[i, -1]
            scale = max(expected.kinetic, expected.spring)
            assert measured == pytest.approx(getattr(expected, name), abs=1e-12 * scale, rel=1e-9)


def test_ledger_has_a_column_for_each_frame_and_a_row_for_each_robot(walker, cube):
    result = ws.Simulation([walker, cube, cube], ws.Scene(), dt=1e-3).run(
        0.5, fps=10, energy=True, record=[1]
    )
    for name in (*NAMES, *LEDGER):
        assert getattr(result.energy, name).shape == (3, 6)


def test_energy_is_measured_only_on_request(cube):
    assert ws.Simulation(cube, ws.Scene(), dt=1e-3).run(0.01, fps=100).energy is None


@pytest.mark.parametrize(("integrator", "fraction"), [("leapfrog", 1e-4), ("chin4", 1e-5)])
def test_spinning_bouncing_cube_keeps_its_energy(tumbling_cube, integrator, fraction):
    ground = ws.Ground(stiffness=1e5, static_friction=0.0, kinetic_friction=0.0)
    scene = ws.Scene(ground=ground)
    simulation = ws.Simulation(tumbling_cube, scene, dt=1e-4, integrator=integrator)
    total = simulation.run(2.0, fps=200, energy=True).energy.total[0]
    # Symplectic: the error oscillates (measured 3e-5 and 3e-6 of the total) and does not drift.
    assert np.abs(total / total[0] - 1.0).max() < fraction
    late, early = total[-100:].mean(), total[:100].mean()
    assert late == pytest.approx(early, rel=fraction / 10)


# What comes in and what is lost.


def flying_point(velocity, **losses):
    """Energies of a mass of 0.1 kg that flies for 0.5 s through a scene with nothing but losses."""
    robot = ws.Robot(
        masses=[0.1],
        positions=[(0, 0, 0)],
        velocities=[velocity],
        springs=np.empty((0, 2), dtype=int),
        stiffness=[],
    )
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, **losses)
    return lambda integrator: ws.Simulation(robot, scene, dt=1e-3, integrator=integrator).run(
        0.5, fps=20, energy=True
    )


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_damping_loss_of_a_free_mass(integrator):
    result = flying_point((3, 0, 4), damping=0.7)(integrator)
    expected = 0.05 * 25 * (1 - np.exp(-2 * 0.7 * result.times))
    assert result.energy.damping_loss[0] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert result.energy.losses[0] == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_drag_loss_of_a_free_mass(integrator):
    result = flying_point((3, 0, 4), drag=0.05)(integrator)
    speed = 1 / (1 / 5 + 0.05 / 0.1 * result.times)
    expected = 0.05 * (25 - speed**2)
    assert result.energy.drag_loss[0] == pytest.approx(expected, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_friction_loss_is_the_kinetic_energy_of_a_body_that_slides_to_rest(cube, integrator):
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3))
    sliding = cube.moved((0, 0, -2e-5)).moving((1.0, 0.0, 0.0))
    simulation = ws.Simulation(sliding, scene, dt=1e-4, integrator=integrator)
    energy = simulation.run(0.6, fps=100, energy=True).energy
    # The rest is in the vibrations that the landing and the braking leave behind.
    assert energy.friction_loss[0, -1] == pytest.approx(0.5 * 0.8, rel=0.02)
    assert np.diff(energy.friction_loss[0]).min() > -1e-12  # friction never gives
    assert np.all(energy.work == 0.0)


@pytest.mark.parametrize(("integrator", "order"), [("leapfrog", 2), ("chin4", 2), ("euler", 1)])
def test_residual_of_the_ledger_shrinks_with_the_order_of_the_integrator(walker, integrator, order):
    body = walker.spinning((3, -2, 4)).moving((1.0, 0.5, 2.0))
    scene = ws.Scene(ground=None, damping=1.5, drag=0.05)
    residuals = []
    for dt in (5e-4, 2.5e-4):
        simulation = ws.Simulation(body, scene, dt=dt, integrator=integrator)
        energy = simulation.run(1.0, fps=50, energy=True).energy
        residuals.append(np.abs(energy.residual).max())
    assert energy.losses[0, -1] > 10.0 and abs(energy.work[0, -1]) > 0.01
    assert np.log2(residuals[0] / residuals[1]) == pytest.approx(order, abs=0.15)


def test_muscles_do_the_work_that_a_body_gains(walker):
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    simulation = ws.Simulation(walker, free, dt=1e-4, integrator="leapfrog")
    energy = simulation.run(1.0, fps=50, energy=True).energy
    gain = energy.total[0] - energy.total[0, 0]
    assert np.abs(gain).max() > 0.05
    # Leapfrog's energy is off by 0.3 % of the gain at this step.
    assert energy.work[0] == pytest.approx(gain, abs=1e-2 * np.abs(gain).max())
