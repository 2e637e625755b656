"""The energy ledger: its formulas by hand, and its constancy where nothing is lost."""

import numpy as np
import pytest

import warp_springs as ws
from tests.reference import energies

NAMES = ("kinetic", "gravity", "spring", "ground")


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


@pytest.mark.parametrize("integrator", ["leapfrog", "euler"])
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
    for name in (*NAMES, "total"):
        assert getattr(result.energy, name).shape == (3, 6)
    total = sum(getattr(result.energy, name) for name in NAMES)
    assert np.array_equal(total, result.energy.total) or np.allclose(total, result.energy.total)


def test_energy_is_measured_only_on_request(cube):
    assert ws.Simulation(cube, ws.Scene(), dt=1e-3).run(0.01, fps=100).energy is None


def test_spinning_bouncing_cube_keeps_its_energy(tumbling_cube):
    ground = ws.Ground(stiffness=1e5, static_friction=0.0, kinetic_friction=0.0)
    simulation = ws.Simulation(tumbling_cube, ws.Scene(ground=ground), dt=1e-4)
    total = simulation.run(2.0, fps=200, energy=True).energy.total[0]
    # Symplectic: the error oscillates (measured 3e-5 of the total) and does not drift (3e-6).
    assert np.abs(total / total[0] - 1.0).max() < 1e-4
    late, early = total[-100:].mean(), total[:100].mean()
    assert late == pytest.approx(early, rel=1e-5)


def test_breathing_body_exchanges_energy_with_its_muscles(walker):
    free = ws.Scene(gravity=(0, 0, 0), ground=None)
    energy = ws.Simulation(walker, free, dt=5e-4).run(1.0, fps=50, energy=True).energy
    assert np.ptp(energy.total[0]) > 1e-2  # actuated springs work: not conserved, and it shows


def test_friction_and_damping_only_take_energy_away(cube):
    scene = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3), damping=0.3)
    sliding = cube.moved((0, 0, -2e-5)).moving((1.0, 0.0, 0.0))
    total = ws.Simulation(sliding, scene, dt=1e-4).run(0.5, fps=100, energy=True).energy.total[0]
    assert np.diff(total).max() < 1e-4 * total[0]
    assert total[-1] - total[0] == pytest.approx(-0.5 * 0.8, rel=0.02)  # all of m v^2 / 2
