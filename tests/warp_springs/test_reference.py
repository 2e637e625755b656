"""The simulator against the plain NumPy version of the same algorithm, on random robots.

Both do the same arithmetic in a different order, so in float64 they agree to rounding, grown a
little by the motion. Friction is the exception: its outcome jumps at the stick-or-slip threshold.
An example in which a decision falls within 1e-9 of it proves nothing and is left out.
"""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import warp_springs as ws
from warp_springs.reference import Trial

DT = 2e-4
STEPS = 200
FRAME_STEPS = 20
FPS = 1 / (FRAME_STEPS * DT)
GRID = 0.1 * np.array(list(itertools.product(range(3), repeat=3)), dtype=float)

SCENES = {
    "free flight": ws.Scene(gravity=(0.5, -1.0, -9.81), ground=None),
    "coulomb": ws.Scene(ground=ws.Ground()),
    "course": ws.Scene(ground=ws.Ground(stiffness=5e4, friction="course")),
    "everything": ws.Scene(
        gravity=(2.0, -1.0, -9.0),
        ground=ws.Ground(stiffness=3e4, static_friction=0.5, kinetic_friction=0.4),
        damping=2.0,
        drag=0.05,
    ),
    "everything, course": ws.Scene(
        gravity=(2.0, -1.0, -9.0),
        ground=ws.Ground(static_friction=0.5, kinetic_friction=0.4, friction="course"),
        damping=2.0,
        drag=0.05,
    ),
}


# Every combination of features is a kernel to compile: robots breathe in some scenes only.
BREATHING = ("free flight", "everything", "everything, course")


@st.composite
def robots(draw):
    """A random tangle: unequal masses and springs, pre-stressed, breathing, falling or landed."""
    n_masses = draw(st.integers(1, 9))
    n_springs = draw(st.integers(0, n_masses * (n_masses - 1) // 2))
    clearance = draw(st.sampled_from([-1e-3, 0.0, 1e-3, 5e-3]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    positions = rng.permutation(GRID)[:n_masses] + rng.uniform(-0.02, 0.02, (n_masses, 3))
    positions[:, 2] += clearance - positions[:, 2].min()
    pairs = np.array(list(itertools.combinations(range(n_masses), 2)), dtype=int).reshape(-1, 2)
    springs = rng.permuted(rng.permutation(pairs)[:n_springs], axis=1)  # either end first
    lengths = np.linalg.norm(positions[springs[:, 1]] - positions[springs[:, 0]], axis=1)
    rest = lengths * rng.uniform(0.9, 1.1, n_springs)
    return ws.Robot(
        masses=rng.uniform(0.05, 0.4, n_masses),
        positions=positions,
        velocities=rng.normal(0.0, 0.5, (n_masses, 3)),
        springs=springs,
        stiffness=rng.uniform(200.0, 2000.0, n_springs),
        rest_length=rest,
        amplitude=rest * rng.uniform(0.0, 0.2, n_springs),
        phase=rng.uniform(0.0, 2 * np.pi, n_springs),
        omega=float(rng.uniform(5.0, 50.0)),
    )


def simulate(batch, scene, integrator, precision):
    simulation = ws.Simulation(batch, scene, dt=DT, integrator=integrator, precision=precision)
    return simulation, simulation.run(STEPS * DT, fps=FPS)


def compare(batch, scene, integrator, precision="float64"):
    """Largest errors of each robot: positions [0.1 m] over the run, velocities [m/s] at its end."""
    simulation, result = simulate(batch, scene, integrator, precision)
    position_errors, velocity_errors, margins = [], [], []
    for i, robot in enumerate(batch):
        trial = Trial(robot, scene, DT, integrator, simulation.contact_substeps[i])
        positions, velocities = trial.run(STEPS)
        difference = result.frames(i) - positions[::FRAME_STEPS]
        position_errors.append(np.abs(difference).max() / 0.1)
        velocity_errors.append(np.abs(result.velocities(i) - velocities[-1]).max())
        margins.append(trial.margin)
    assert np.all(result.status == ws.Status.OK)
    return np.array(position_errors), np.array(velocity_errors), min(margins)


@pytest.mark.parametrize("integrator", ["leapfrog", "chin4", "euler"])
@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=7)
@given(single=robots(), shared=robots())
def test_random_robots_follow_the_reference(name, integrator, single, shared):
    if name not in BREATHING:
        single, shared = (robot.replace(amplitude=0.0) for robot in (single, shared))
    # Robots of one topology are stepped together, in lanes; a robot that is the only one is not.
    family = [shared.replace(stiffness=factor * shared.stiffness) for factor in (1.0, 0.8, 1.2)]
    batch = [family[0], single, *family[1:]]
    position_errors, velocity_errors, margin = compare(batch, SCENES[name], integrator)
    assume(margin > 1e-9)
    # Rounding makes 3e-14 and 3e-13 of it, measured over these 200 steps.
    assert position_errors.max() < 1e-11
    assert velocity_errors.max() < 1e-10


@pytest.mark.parametrize("integrator", ["leapfrog", "chin4", "euler"])
@pytest.mark.parametrize("name", ["free flight", "everything"])
@settings(max_examples=3)
@given(batch=st.lists(robots(), min_size=7, max_size=7))
def test_single_precision_follows_the_reference(name, integrator, batch):
    # The median over robots: a robot whose friction decides otherwise may go its own way.
    position_errors, velocity_errors, _ = compare(batch, SCENES[name], integrator, "float32")
    # Measured: 1.6e-6 and 7e-6, some twenty roundings of 6e-8.
    assert np.median(position_errors) < 1e-5
    assert np.median(velocity_errors) < 5e-5


@pytest.mark.parametrize("integrator", ["leapfrog", "chin4", "euler"])
def test_walker_follows_the_reference_across_landing_and_runs(walker, integrator):
    scene = SCENES["coulomb"]
    simulation = ws.Simulation(walker, scene, dt=DT, integrator=integrator)
    simulation.run(0.05)
    result = simulation.run(0.15)
    trial = Trial(walker, scene, DT, integrator, simulation.contact_substeps[0])
    positions, velocities = trial.run(1000)
    assert positions[:, :, 2].min() < 0 < positions[0, :, 2].min()
    assert trial.margin > 1e-9
    assert np.abs(result.positions(0) - positions[-1]).max() < 1e-11
    assert np.abs(result.velocities(0) - velocities[-1]).max() < 1e-9
