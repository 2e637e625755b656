"""The accuracy benchmark: its truths against each other, its arithmetic, and a small run of it."""

import dataclasses
import json
import math
import sys

import accuracy
import numpy as np
import pytest
from accuracy_measure import FEWEST, QUICK_STEPS, STEPS, Row, Series, cost_of, recommended
from accuracy_scenes import CASES
from accuracy_truth import solve

import warp_springs as ws
from warp_springs.reference import continuum, energies

CLOSED_FORMS = ("oscillator", "slinky", "drag", "slide")


def shortened(name):
    """A scene whose truth takes a second at most."""
    case = dataclasses.replace(CASES[name], judged=1, tolerance=1e-9)
    return dataclasses.replace(case, duration=0.2) if name == "walker" else case


# Truths.


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_solver_agrees_with_the_closed_form(name):
    case = CASES[name]
    found = solve(case.robot, case.scene, case.duration).positions
    if name == "slide":
        found = (found - case.robot.positions).mean(axis=0)[:2]
    assert found == pytest.approx(case.truth().values[0], abs=1e-9)


def test_solver_agrees_with_runge_kutta_across_a_bounce():
    case = CASES["bouncing cube"]
    truth, velocities = continuum(case.robot, case.scene, 0.3, 6000)
    found = solve(case.robot, case.scene, 0.3)
    assert found.switches >= 2
    # The fixed steps cross the kink of the ground's force somewhere inside.
    assert np.abs(found.positions - truth).max() < 2e-5
    assert np.abs(found.velocities - velocities).max() < 2e-3


def test_chin4_keeps_its_order_where_a_lattice_lands():
    case = dataclasses.replace(CASES["lattice"], judged=3)
    truth = case.truth()
    for dt, largest in ((1e-3, 4e-5), (5e-4, 3e-6), (1e-4, 2e-8)):
        result = ws.Simulation(case.batch(3), case.scene, dt).run(case.duration)
        assert np.median(case.errors(result, truth)) < largest


def test_solver_keeps_the_energy_of_a_lossless_bounce():
    case = CASES["bouncing cube"]
    robot, scene = case.robot, case.scene
    before = energies(robot, scene, robot.positions, robot.velocities, 0.0).total
    end = solve(robot, scene, 0.5)
    after = energies(robot, scene, end.positions, end.velocities, 0.5).total
    assert after == pytest.approx(before, rel=1e-9)


@pytest.mark.parametrize(("tangent", "slides"), [(0.39, False), (0.41, True)])
def test_solver_sticks_below_the_static_threshold_and_slides_above(tangent, slides):
    angle = math.atan(tangent)
    lean = 9.81 * math.sin(angle)
    weight = 9.81 * math.cos(angle)
    ground = ws.Ground(static_friction=0.4, kinetic_friction=0.3)
    scene = ws.Scene(gravity=(lean, 0.0, -weight), ground=ground)
    robot = ws.Robot(
        masses=[0.1],
        positions=[(0, 0, -0.1 * weight / 1e5)],
        springs=np.empty((0, 2)),
        stiffness=[],
    )
    way = solve(robot, scene, 0.5).positions[0, 0]
    expected = (lean - 0.3 * weight) * 0.5**2 / 2 if slides else 0.0
    assert way == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_simulator_comes_close_to_the_truth(name):
    case = shortened(name)
    truth = case.truth()
    assert truth.uncertainty < 0.1 * case.target
    simulation = ws.Simulation(case.batch(FEWEST), case.scene, 5e-5, integrator="chin4")
    result = simulation.run(case.duration)
    assert case.errors(result, truth)[0] < case.target


@pytest.mark.parametrize("steps", [STEPS, QUICK_STEPS])
def test_every_step_divides_every_duration(steps):
    dts = {dt for series in steps.values() for dt in series}
    for case in CASES.values():
        for dt in dts:
            assert round(case.duration / dt) * dt == pytest.approx(case.duration, rel=1e-12)


def test_siblings_start_at_the_same_heights_in_any_batch():
    case = CASES["lattice"]
    few, many = case.batch(3), case.batch(64)
    assert np.array_equal(few[0].positions, case.robot.positions)
    assert np.array_equal(few[2].positions, many[2].positions)
    assert many[2].positions[0, 2] > case.robot.positions[0, 2]


# Arithmetic.


def curve(*points):
    """Rows of one series from (step, error) pairs; a step costs 1 / step evaluations."""
    way = Series("chin4", "float64", "none")
    return [
        Row("scene", way, dt, 1, error, error, round(1 / dt), 64, 1e-9 / dt) for dt, error in points
    ]


def test_recommended_step_is_the_largest_that_is_not_mere_luck():
    rows = curve((8e-3, math.inf), (4e-3, 1e-5), (2e-3, 1e-3), (1e-3, 1e-5), (5e-4, 1e-6))
    assert recommended(rows, 1e-4).dt == 1e-3
    assert recommended(rows[::-1], 1e-4).dt == 1e-3
    assert recommended(rows, 1e-9) is None


def test_cost_follows_the_power_law_between_two_steps():
    rows = curve((4e-3, 1e-2), (2e-3, 2.5e-3), (1e-3, 6.25e-4), (5e-4, 1.5625e-4))
    assert cost_of(rows, 1.25e-3) == pytest.approx(1000 / math.sqrt(2), rel=1e-2)
    assert cost_of(rows, 1.25e-3, "seconds") == pytest.approx(1e-6 / math.sqrt(2), rel=1e-2)
    assert cost_of(rows, 1.0) == 250
    assert cost_of(rows, 1e-9) is None


# The command.


def test_a_small_run_writes_tables_json_and_figures(tmp_path, monkeypatch, capsys):
    numbers, picture = tmp_path / "accuracy.json", tmp_path / "curves.png"
    command = ["accuracy.py", "--quick", "--scenes", "free cube", "slide"]
    monkeypatch.setattr(sys, "argv", [*command, "--json", str(numbers), "--figure", str(picture)])
    accuracy.main()
    told = capsys.readouterr().out
    assert "Recommended steps" in told and "What holds" in told
    data = json.loads(numbers.read_text())
    assert {row["scene"] for row in data["rows"]} == {"free cube", "slide"}
    assert {row["series"]["precision"] for row in data["rows"]} == {
        "float64",
        "float32",
        "mixed",
    }
    orders = {c["how"]: c["measured"] for c in data["claims"] if "order" in c["about"]}
    assert orders["chin4"] == pytest.approx(4.0, abs=0.2)
    assert orders["leapfrog"] == pytest.approx(2.0, abs=0.1)
    assert picture.stat().st_size > 20_000
    assert picture.with_stem("curves_seconds").stat().st_size > 20_000
