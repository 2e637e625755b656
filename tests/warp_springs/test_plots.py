"""Plots: what they draw is what the run says, and a picture comes out."""

import dataclasses
import io

import numpy as np
import pytest
from matplotlib.figure import Figure  # noqa: TID253
from matplotlib.image import imread  # noqa: TID253

import warp_springs as ws


@pytest.fixture(scope="module")
def result(tumbling_cube):
    return ws.Simulation([tumbling_cube, tumbling_cube.moved((0, 0, 1))], ws.Scene()).run(
        0.4, fps=50, energy=True
    )


@pytest.fixture
def ax():
    return Figure(figsize=(5, 3)).add_subplot()


def picture_of(ax):
    buffer = io.BytesIO()
    ax.figure.savefig(buffer, format="png", bbox_inches="tight")
    return imread(io.BytesIO(buffer.getvalue()))


def band(collection):
    """Height of a filled band at each of its abscissae."""
    x, y = collection.get_paths()[0].vertices.T
    return np.array([np.ptp(y[np.isclose(x, at)]) for at in np.unique(x)])


def test_energies_are_stacked_up_to_the_total(ax, result):
    assert ws.plots.energies(ax, result, robot=1) is ax
    bands = {band.get_label(): band for band in ax.collections}
    assert list(bands) == ["kinetic", "gravity", "spring", "ground"]
    np.testing.assert_allclose(band(bands["kinetic"]), result.energy.kinetic[1], atol=1e-9)
    np.testing.assert_allclose(band(bands["gravity"]), result.energy.gravity[1], atol=1e-9)
    (total,) = ax.lines
    np.testing.assert_array_equal(total.get_xdata(), result.times)
    np.testing.assert_allclose(total.get_ydata(), result.energy.total[1])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "energy [J]")
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["kinetic", "gravity", "spring", "ground", "total"]
    assert ax.get_ylim()[1] > result.energy.total[1].max()


def test_gravity_below_zero_is_counted_from_its_lowest(ax, cube):
    fall = ws.Simulation([cube], ws.Scene(ground=None)).run(0.5, fps=20, energy=True)
    ws.plots.energies(ax, fall)
    gravity = ax.collections[1]
    assert gravity.get_label() == "gravity (from its lowest)"
    assert band(gravity)[-1] == pytest.approx(0.0, abs=1e-12)
    lowest = fall.energy.gravity[0].min()
    np.testing.assert_allclose(ax.lines[0].get_ydata(), fall.energy.total[0] - lowest)


def test_height_is_that_of_the_centre_of_mass(ax, result):
    ws.plots.height(ax, result, robot=0)
    ws.plots.height(ax, result, robot=1)
    low, high = (line for line in ax.lines if line.get_label().startswith("robot"))
    assert (low.get_label(), high.get_label()) == ("robot 0", "robot 1")
    assert low.get_ydata()[0] == pytest.approx(0.3)
    t = result.times[result.times < 0.15]
    np.testing.assert_allclose(low.get_ydata()[: len(t)], 0.3 - 9.81 / 2 * t**2, atol=1e-6)
    assert low.get_ydata()[-1] == pytest.approx(result.center_of_mass[0, 2], abs=1e-9)
    assert ax.get_ylabel() == "height of the centre of mass [m]"
    assert ax.get_xlim() == (result.times[0], result.times[-1])


def test_uneven_masses_weigh_in(ax, cube):
    heavy = cube.replace(masses=np.where(cube.positions[:, 2] > 0.05, 0.7, 0.1))
    ws.plots.height(ax, ws.Simulation([heavy], ws.Scene()).run(0.01, fps=100))
    assert ax.lines[0].get_ydata()[0] == pytest.approx(heavy.center_of_mass[2])


@pytest.mark.parametrize("name", ["energies", "height"])
def test_a_picture_comes_out(ax, result, name):
    blank = picture_of(Figure(figsize=(5, 3)).add_subplot())
    drawn = picture_of(getattr(ws.plots, name)(ax, result))
    assert min(drawn.shape[:2]) > 100
    assert len(np.unique(drawn.reshape(-1, drawn.shape[2]), axis=0)) > 1.5 * len(
        np.unique(blank.reshape(-1, blank.shape[2]), axis=0)
    )


def test_what_is_missing_is_said(ax, result, cube):
    without = dataclasses.replace(result, energy=None)
    with pytest.raises(ValueError, match=r"no energies; simulate with .*energy=True"):
        ws.plots.energies(ax, without)
    with pytest.raises(ValueError, match="robot: got 2, expected 0 to 1"):
        ws.plots.energies(ax, result, robot=2)
    unrecorded = ws.Simulation([cube], ws.Scene()).run(0.01)
    with pytest.raises(ValueError, match="not recorded"):
        ws.plots.height(ax, unrecorded)
