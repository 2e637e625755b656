"""The comparison with other libraries: its programs against the reference, and its machinery."""

import dataclasses
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from peers import environments, fleet, measure, report
from peers.figure import draw
from peers.lanes import Lanes
from peers.populations import population
from peers.problem import Problem
from peers.programs import in_cpp, in_numpy, in_warp, in_warp_springs

from warp_springs.bench.populations import DT, scene_of, variants
from warp_springs.reference import Trial

ROBOTS, STEPS = 19, 150  # not a whole number of vectors; they land after 100 steps


class WithoutAvx512(in_cpp.Limit):
    """The limit as a processor without AVX-512 gets it."""

    flags = ("-mno-avx512f",)


PROGRAMS = {**in_numpy.PROGRAMS, **in_warp.PROGRAMS, **in_warp_springs.PROGRAMS}
if shutil.which("g++") or shutil.which("clang++"):
    PROGRAMS |= {**in_cpp.PROGRAMS, "C++ limit without AVX-512": WithoutAvx512}


@pytest.fixture(scope="module")
def problem():
    return population("lattice", ROBOTS)


@pytest.fixture(scope="module")
def truth():
    """Where the reference puts the first and the last robot."""
    robots = variants("lattice", ROBOTS)
    trials = [Trial(robots[i], scene_of(), DT, "euler") for i in (0, ROBOTS - 1)]
    for trial in trials:
        for _ in range(STEPS):
            trial.step()
    return np.array([trial.positions for trial in trials])


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("name", PROGRAMS)
def test_program_agrees_with_the_reference(name, precision, problem, truth):
    program = PROGRAMS[name](problem, precision, 2)
    program.run(70)
    program.run(STEPS - 70)
    error = np.abs(program.positions()[[0, -1]] - truth)
    assert (problem.positions[[0, -1]] - truth).max() > 1e-4  # they have moved
    assert np.median(error) < 1e-7
    assert error.max() < (1e-12 if precision == "float64" else 1e-4)


@pytest.mark.parametrize("name", [n for n in PROGRAMS if n != "Warp, two kernels"])
def test_free_flight_of_spinning_robots(name, problem):
    spin = np.cross([3.0, -2.0, 4.0], problem.positions)
    free = dataclasses.replace(problem, ground_stiffness=0.0, keep=1.0, velocities=spin)
    program = PROGRAMS[name](free, "float64", 1)
    program.run(100)
    weight = free.masses / free.masses.sum(axis=1, keepdims=True)
    start = free.center_of_mass(free.positions)
    drift = np.einsum("nm,nmc->nc", weight, spin) * 100 * DT
    fall = np.array(free.gravity) * DT**2 * 100 * 101 / 2  # symplectic Euler, 100 steps
    assert np.allclose(free.center_of_mass(program.positions()), start + drift + fall, atol=1e-13)


def test_the_file_holds_the_problem(problem, tmp_path):
    problem.save(tmp_path / "problem.npz")
    loaded = Problem.load(tmp_path / "problem.npz")
    for field in dataclasses.fields(Problem):
        assert np.array_equal(getattr(loaded, field.name), getattr(problem, field.name))


def test_lanes_hold_every_robot_and_spring(problem):
    lanes = Lanes.of(problem, "float64", 8)
    assert np.array_equal(lanes.robots_first(lanes.x, ROBOTS), problem.positions)
    lower = np.repeat(np.arange(problem.n_masses), np.diff(lanes.rows.astype(int)))
    pairs = {tuple(sorted(pair)) for pair in problem.springs.tolist()}
    assert set(zip(lower.tolist(), lanes.partners.tolist(), strict=True)) == pairs
    first_lanes = problem.stiffness[::8].sum()  # of robots 0, 8, 16
    assert lanes.springs[:, :, 0, 0].sum() == pytest.approx(first_lanes)


@pytest.fixture(scope="module")
def small_fleet():
    made = fleet.Fleet()
    made.start(["numpy", "warp_springs"], [1], print)
    yield made
    made.stop()


@pytest.fixture(scope="module", autouse=True)
def here():
    """No environment is made in a test: every library is looked for in this one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(environments, "REQUIREMENTS", {})
        yield


def test_a_small_comparison(small_fleet, problem, tmp_path):
    rows = measure.compare(small_fleet, measure.Truth(problem, 120), "float64", 2, 0.01, print)
    assert [row.program.name for row in rows] == ["NumPy", "warp_springs"]
    for row in rows:
        assert not row.failure
        assert row.error < 1e-12
        assert len(row.rates) == 2
    lines = report.as_json(rows, "lattice", ROBOTS, problem.n_springs)
    report.write(tmp_path / "peers.json", small_fleet, table=lines)
    report.write(tmp_path / "peers.json", small_fleet, sweep=lines[:1])  # the table stays
    written = json.loads((tmp_path / "peers.json").read_text())
    assert [line["program"] for line in written["table"]] == ["NumPy", "warp_springs"]
    assert len(written["sweep"]) == 1
    assert written["versions"]["numpy"] == np.__version__
    draw(lines, "title", tmp_path / "peers.png")
    assert (tmp_path / "peers.png").stat().st_size > 10_000


def test_a_program_that_is_wrong_gets_no_speed(small_fleet, problem, monkeypatch):
    honest = measure._centers
    monkeypatch.setattr(measure, "_centers", lambda *a: np.add(honest(*a), [0, 0, 1e-4]))
    rows = measure.compare(small_fleet, measure.Truth(problem, 30), "float32", 1, 0.01, print)
    for row in rows:
        assert "wrong by 1.0e-04 m" in row.failure
        assert not len(row.rates)


def test_a_process_that_dies_loses_its_rows_only(problem):
    made = fleet.Fleet()
    try:
        made.start(["numpy", "warp_springs"], [1], print)
        asked = made.ask

        def ask(program, do, **request):
            if program.name == "NumPy" and do == "centers":
                made._processes["numpy", 1].kill()
            return asked(program, do, **request)

        made.ask = ask
        rows = measure.compare(made, measure.Truth(problem, 30), "float64", 1, 0.01, print)
    finally:
        made.stop()
    dead, alive = rows
    assert "its process ended" in dead.failure
    assert not len(dead.rates)
    assert len(alive.rates) == 1


def test_a_library_that_is_not_there_is_named_and_the_others_go_on(monkeypatch):
    def python_of(library):
        if library == "jax":
            raise RuntimeError("ERROR: No matching distribution found for jax==0")
        return Path(sys.executable)

    monkeypatch.setattr(fleet, "python_of", python_of)
    made = fleet.Fleet()
    try:
        made.start(["jax", "nothing", "numpy"], [1], print)
        assert "No matching distribution" in made.failed["jax"]
        assert "peers.programs.in_nothing" in made.failed["nothing"]
        assert [program.name for program in made.programs] == ["NumPy"]
    finally:
        made.stop()


def test_an_environment_that_pip_cannot_make_says_why(monkeypatch, tmp_path):
    monkeypatch.setattr(environments, "CACHE", tmp_path)
    monkeypatch.setattr(environments, "REQUIREMENTS", {"odd": ("--no-index", "no-such-thing==1")})
    with pytest.raises(RuntimeError, match="no-such-thing"):
        environments.python_of("odd")
