from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from evolve.errors import RunError
from evolve.record import Finalist, Record
from evolve.reports.figures import clock, demotions, draw, table, verdict
from evolve.reports.plots import dot_plot, figure, learning_curve
from evolve.run import Run
from evolve.screen import BLOCKS, Screen, sparkline


@pytest.fixture
def record() -> Record:
    rng = np.random.Generator(np.random.Philox(3))
    generations = np.repeat(np.arange(20), 50)
    fitness = rng.gamma(4.0, 0.02 + 0.01 * generations)
    status = (rng.random(1000) < 0.05).astype(int)
    return Record(np.arange(1, 1001), generations, np.where(status, np.nan, fitness), status)


def test_the_learning_curve_shows_the_best_so_far(record):
    ax = learning_curve(figure().subplots(), record)
    best = next(line for line in ax.lines if line.get_label() == "best so far")
    expected = np.fmax.accumulate(record.fitness)
    np.testing.assert_array_equal(best.get_ydata(), expected)
    np.testing.assert_array_equal(best.get_xdata(), record.ids)
    median = next(line for line in ax.lines if line.get_label() == "median of a generation")
    np.testing.assert_allclose(median.get_ydata()[3], np.nanmedian(record.fitness[150:200]))
    np.testing.assert_array_equal(median.get_xdata(), np.arange(50, 1001, 50))
    assert ax.get_xlabel() == "evaluations"
    assert ax.get_ylabel() == "speed [body diameters per cycle]"


def test_the_dot_plot_shows_everybody(record):
    ax = dot_plot(figure().subplots(), record, "distance")
    dots = ax.collections[0].get_offsets()
    fit = np.isfinite(record.fitness)
    np.testing.assert_array_equal(dots, np.column_stack([record.ids, record.fitness])[fit])
    assert f"stopped: {np.count_nonzero(~fit)}" in [line.get_label() for line in ax.lines]
    assert ax.get_ylabel() == "distance [m]"


@pytest.mark.parametrize("plot", [learning_curve, dot_plot])
def test_plots_survive_a_run_in_which_nobody_has_a_fitness(plot, tmp_path):
    nobody = Record(np.arange(1, 4), np.zeros(3, int), np.full(3, np.nan), np.ones(3, int))
    page = figure()
    plot(page.subplots(), nobody)
    page.savefig(tmp_path / "plot.png")


def test_drawing_writes_pictures_and_touches_no_global_state(tmp_path, tiny):
    import matplotlib
    import matplotlib._pylab_helpers as helpers

    backend = matplotlib.rcParams._get_backend_or_none()
    run = Run.create(tiny, tmp_path / "run")
    run.evolve()
    paths = draw(run)
    assert [path.name for path in paths] == ["learning_curve.png", "dot_plot.png"]
    for path in paths:
        data = path.read_bytes()
        assert data.startswith(b"\x89PNG") and len(data) > 10_000
    first = [path.read_bytes() for path in paths]
    assert [path.read_bytes() for path in draw(run)] == first, "drawn the same again"
    assert not helpers.Gcf.get_all_fig_managers()
    assert matplotlib.rcParams._get_backend_or_none() == backend
    rows = table(run)
    assert list(rows.columns[0].cells)[:4] == ["body", "search", "trial", "crown"]


def test_there_is_nothing_to_draw_before_the_first_generation(tmp_path, tiny):
    run = Run.create(tiny, tmp_path / "run")
    run.evolve(should_stop=lambda: True)
    with pytest.raises(RunError, match="no complete generation yet"):
        draw(run)


GOOD = Finalist(7, 3, 0.5, 1e-4, 0.475, 0.95, 0.45, 0.9, True)
BAD = Finalist(9, 2, 4.5, 1e-4, math.nan, math.nan, 0.045, 0.01, False)


def test_a_verdict_says_whether_to_believe_it(tiny):
    assert verdict([GOOD, BAD], tiny) == (
        "champion #7 of generation 3: 0.500 body diameters per cycle; "
        "0.475 (95%) at half the time step, 0.450 (90%) from perturbed starts: survives"
    )
    assert verdict([BAD, BAD], tiny) == (
        "no champion: none of 2 good ones survives the second look; the fittest, "
        "#9 of generation 2: 4.500 body diameters per cycle; "
        "stopped at half the time step, 0.045 (1%) from perturbed starts"
    )
    assert verdict([BAD], tiny).startswith("no champion: the best does NOT survive the second look")


def test_a_report_names_who_lost_the_crown():
    assert demotions([GOOD, BAD]) == (
        "1 of 2 survive; 1 fitter than the champion demoted, the fittest #9: 4.500; "
        "stopped at half the time step, 0.045 (1%) from perturbed starts"
    )
    weak = dataclasses.replace(BAD, fitness=0.4)
    assert demotions([GOOD, weak]) == "1 of 2 survive; nobody fitter than the champion was demoted"
    assert demotions([BAD, weak]) == "0 of 2 survive"


def test_a_clock_reads_minutes_and_hours():
    assert [clock(s) for s in (0.2, 59.6, 61, 3600)] == ["0:00", "1:00", "1:01", "1:00:00"]


def test_a_sparkline_rises_with_its_values():
    assert sparkline([float("nan"), 0.0, 1.0], 10) == BLOCKS[0] + BLOCKS[-1]
    assert sparkline([], 10) == "" and len(sparkline(list(range(1000)), 40)) == 40


def test_the_live_screen_shows_what_matters(tmp_path, tiny):
    import io
    import threading

    from rich.console import Console

    output = io.StringIO()
    console = Console(file=output, force_terminal=True, width=100, color_system=None)
    screen = Screen(console, "body diameters per cycle")
    with screen.showing(threading.Event()):
        Run.create(tiny, tmp_path / "run").evolve(screen.update)
    text = output.getvalue()
    for words in ("4/4 generations", "body diameters per cycle", "springs/s", "96 evaluations"):
        assert words in text
