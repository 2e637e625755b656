"""The interface of Simulation and Result: what a run records, continues, counts and refuses."""

import numpy as np
import pytest

import warp_springs as ws

DT = 1e-3


@pytest.fixture
def falling(cube):
    """A batch of three: two cubes and a lattice, well above the ground."""
    lattice = ws.shapes.lattice(2, 1, 1)
    return [robot.moved((0, 0, 1)) for robot in (cube, lattice, cube.moving((1, 0, 0)))]


# What comes out.


def test_result_describes_the_run(falling):
    scene = ws.Scene(damping=0.1)
    simulation = ws.Simulation(falling, scene, dt=DT, integrator="euler", precision="float32")
    result = simulation.run(0.25)
    assert len(result.robots) == 3
    assert list(result.robots) == falling
    assert result.scene == scene
    assert (result.dt, result.integrator, result.precision) == (DT, "euler", "float32")
    assert result.device == "cpu"
    assert (result.start_time, result.end_time) == (0.0, pytest.approx(0.25))
    assert result.steps == 250
    assert result.wall_time > 0.0
    assert result.spring_evaluations == 250 * sum(robot.n_springs for robot in falling)
    assert result.center_of_mass.shape == (3, 3)
    for i, robot in enumerate(falling):
        assert result.positions(i).shape == result.velocities(i).shape == (robot.n_masses, 3)
        assert result.positions(i).dtype == result.velocities(i).dtype == np.float64
    assert result.energy is None
    assert result.recorded == ()
    assert result.times.shape == (0,)


def test_center_of_mass_weighs_by_mass(falling):
    heavy = falling[1].replace(masses=np.linspace(0.1, 2.0, falling[1].n_masses))
    result = ws.Simulation([*falling, heavy.spinning((1, 2, 3))], ws.Scene(), dt=DT).run(0.2)
    for i, robot in enumerate(result.robots):
        expected = np.average(result.positions(i), axis=0, weights=robot.masses)
        assert result.center_of_mass[i] == pytest.approx(expected, rel=1e-13)


def test_masses_keep_their_order(cube):
    # Every mass has its own velocity, so a permutation would show.
    velocities = np.arange(24.0).reshape(8, 3)
    scene = ws.Scene(gravity=(0, 0, 0), ground=None)
    free = cube.replace(velocities=velocities, springs=np.empty((0, 2), int), stiffness=[],
                        rest_length=[], amplitude=[], phase=[])  # fmt: skip
    result = ws.Simulation([free] * 9, scene, dt=DT).run(0.1)
    for i in range(9):
        assert np.allclose(result.positions(i), cube.positions + 0.1 * velocities, atol=1e-12)
        assert np.array_equal(result.velocities(i), velocities)


def test_one_robot_needs_no_list(cube):
    result = ws.Simulation(cube.moved((0, 0, 1)), ws.Scene(), dt=DT).run(0.01)
    assert len(result.robots) == 1
    assert result.positions(0).shape == (8, 3)


# Recording.


def test_frames_include_both_ends(falling):
    result = ws.Simulation(falling, ws.Scene(), dt=1e-4).run(2.0, fps=30)
    assert result.times.shape == (61,)
    assert np.abs(result.times - np.arange(61) / 30).max() <= 1e-4  # the nearest step
    for i, robot in enumerate(falling):
        frames = result.frames(i)
        assert frames.shape == (61, robot.n_masses, 3)
        assert frames.dtype == np.float64
        assert np.array_equal(frames[0], robot.positions)
        assert np.array_equal(frames[-1], result.positions(i))
    assert result.recorded == (0, 1, 2)


def test_frame_times_are_the_times_of_their_poses(cube):
    # 1 / 30 s is no multiple of the step: the times must be those of the steps really shown.
    scene = ws.Scene(ground=None)
    result = ws.Simulation(cube, scene, dt=1e-3).run(1.0, fps=30)
    heights = result.frames(0)[:, 0, 2]
    assert heights == pytest.approx(-9.81 / 2 * result.times**2, abs=1e-12)


def test_only_what_is_asked_for_is_recorded(falling):
    result = ws.Simulation(falling, ws.Scene(), dt=DT).run(0.1, fps=20, record=[2, 0])
    assert set(result.recorded) == {0, 2}
    assert result.frames(2).shape == (3, 8, 3)
    with pytest.raises(ValueError, match="recorded"):
        result.frames(1)


def test_energy_without_recorded_robots(falling):
    result = ws.Simulation(falling, ws.Scene(), dt=DT).run(0.1, fps=20, record=[], energy=True)
    assert result.recorded == ()
    assert result.energy.total.shape == (3, 3)
    assert result.times == pytest.approx([0.0, 0.05, 0.1])


def test_energy_without_frames_is_measured_at_both_ends(falling):
    result = ws.Simulation(falling, ws.Scene(), dt=DT).run(0.1, energy=True)
    assert result.energy.total.shape == (3, 2)
    assert result.times == pytest.approx([0.0, 0.1])
    with pytest.raises(ValueError, match="recorded"):
        result.frames(0)


def test_results_are_not_overwritten_by_later_runs(falling):
    simulation = ws.Simulation(falling, ws.Scene(), dt=DT)
    first = simulation.run(0.1, fps=20)
    kept = [first.positions(i).copy() for i in range(3)]
    frames, centers = first.frames(1).copy(), first.center_of_mass.copy()
    simulation.run(0.1, fps=20)
    assert all(np.array_equal(first.positions(i), kept[i]) for i in range(3))
    assert np.array_equal(first.frames(1), frames)
    assert np.array_equal(first.center_of_mass, centers)


# Continuing.


def test_second_run_continues_in_time_and_space(falling):
    simulation = ws.Simulation(falling, ws.Scene(), dt=DT)
    first = simulation.run(0.1)
    second = simulation.run(0.2, fps=10)
    assert second.start_time == pytest.approx(first.end_time) == pytest.approx(0.1)
    assert second.end_time == pytest.approx(0.3)
    assert second.times == pytest.approx([0.1, 0.2, 0.3])
    assert np.array_equal(second.frames(0)[0], first.positions(0))
    assert second.steps == 200


def test_actuation_goes_on_at_the_right_phase(walker):
    scene = ws.Scene(gravity=(0, 0, 0), ground=None)
    simulation = ws.Simulation(walker, scene, dt=DT)
    simulation.run(0.123)
    pieces = simulation.run(0.2)
    whole = ws.Simulation(walker, scene, dt=DT).run(0.323)
    assert np.array_equal(pieces.positions(0), whole.positions(0))


def test_progress_is_reported_up_to_the_end(falling):
    seen = []
    ws.Simulation(falling, ws.Scene(), dt=DT).run(0.5, fps=20, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0)


# Variants.


def test_variants_simulate_like_the_list_of_their_robots(walker):
    rng = np.random.default_rng(3)
    n, springs = 11, walker.n_springs
    variants = walker.variants(
        stiffness=rng.uniform(800, 2000, (n, springs)),
        phase=rng.uniform(0, 6, (n, springs)),
        omega=rng.uniform(5, 20, n),
    )
    stacked = ws.Simulation(variants, ws.Scene(), dt=DT).run(0.1, fps=20)
    listed = ws.Simulation(list(variants), ws.Scene(), dt=DT).run(0.1, fps=20)
    single = ws.Simulation(variants[7], ws.Scene(), dt=DT).run(0.1, fps=20)
    for i in range(n):
        assert np.array_equal(stacked.frames(i), listed.frames(i))
    assert np.array_equal(stacked.frames(7), single.frames(0))
    assert not np.array_equal(stacked.frames(7), stacked.frames(8))
    assert stacked.robots[7] == variants[7]


@pytest.mark.parametrize("field", ["masses", "positions", "velocities", "rest_length", "amplitude"])
def test_every_stacked_field_reaches_the_simulation(walker, field):
    value = np.asarray(getattr(walker, field))
    changed = value * 1.1 + (0.1 if field in ("positions", "velocities") else 0.0)
    variants = walker.variants(**{field: np.stack([value, changed, value])})
    result = ws.Simulation(variants, ws.Scene(), dt=DT).run(0.1)
    alone = ws.Simulation(walker.replace(**{field: changed}), ws.Scene(), dt=DT).run(0.1)
    assert np.array_equal(result.positions(1), alone.positions(0))
    assert not np.array_equal(result.positions(1), result.positions(0))
    assert np.array_equal(result.positions(0), result.positions(2))


# Refusals.


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"dt": 0.0}, "dt"),
        ({"dt": -1e-3}, "dt"),
        ({"dt": np.nan}, "dt"),
        ({"dt": np.inf}, "dt"),
        ({"precision": "float16"}, "precision"),
        ({"integrator": "verlet"}, "integrator"),
        ({"device": "tpu"}, "device"),
        ({"contact_substeps": 0}, "contact_substeps"),
        ({"contact_substeps": -4}, "contact_substeps"),
        ({"threads": 0}, "threads"),
        ({"threads": -1}, "threads"),
    ],
)
def test_malformed_options_are_refused_by_name(cube, options, named):
    with pytest.raises(ValueError, match=named) as refusal:
        ws.Simulation(cube, ws.Scene(), **options)
    assert str(next(iter(options.values()))) in str(refusal.value)  # says what was given


@pytest.mark.parametrize(
    ("run", "named"),
    [
        ({"duration": -1.0}, "duration"),
        ({"duration": 0.0}, "duration"),
        ({"duration": 1e-4}, "duration"),  # less than half a step
        ({"duration": np.nan}, "duration"),
        ({"duration": np.inf}, "duration"),
        ({"duration": 0.1, "fps": 0}, "fps"),
        ({"duration": 0.1, "fps": -30}, "fps"),
        ({"duration": 0.1, "fps": np.nan}, "fps"),
        ({"duration": 0.1, "fps": 10, "record": [3]}, "record"),
        ({"duration": 0.1, "fps": 10, "record": [-4]}, "record"),
        ({"duration": 0.1, "record": [0]}, "fps"),  # frames of nothing
    ],
)
def test_malformed_runs_are_refused_by_name(falling, run, named):
    simulation = ws.Simulation(falling, ws.Scene(), dt=DT)
    with pytest.raises(ValueError, match=named):
        simulation.run(**run)
    assert simulation.run(0.01).start_time == 0.0  # nothing was stepped


def test_robots_must_be_robots(cube):
    with pytest.raises(ValueError, match="robots"):
        ws.Simulation([], ws.Scene())
    with pytest.raises((TypeError, ValueError), match="robots"):
        ws.Simulation([cube, "cube"], ws.Scene())
    with pytest.raises((TypeError, ValueError), match="scene"):
        ws.Simulation(cube, {"gravity": (0, 0, -9.81)})


def test_contact_substeps_are_reported_and_chosen(cube):
    light, heavy = cube.replace(masses=1e-4), cube.replace(masses=10.0)
    chosen = ws.Simulation([light, cube, heavy], ws.Scene(), dt=DT).contact_substeps
    assert chosen.shape == (3,)
    assert chosen[0] > chosen[1] == chosen[2] > 1
    fixed = ws.Simulation([light, heavy], ws.Scene(), dt=DT, contact_substeps=4)
    assert np.array_equal(fixed.contact_substeps, [4, 4])


def test_a_fractional_number_of_steps_is_rounded_to_the_nearest(cube):
    result = ws.Simulation(cube, ws.Scene(), dt=1e-3).run(0.1)  # 0.1 / 1e-3 is not exactly 100
    assert result.steps == 100
