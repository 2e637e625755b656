"""Plots: what they draw is what the run says, and a picture comes out."""

import dataclasses
import io

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

import warp_springs as ws
from tests.warp_springs.posed import posed


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
    total, owed = ax.lines
    np.testing.assert_array_equal(total.get_xdata(), result.times)
    np.testing.assert_allclose(total.get_ydata(), result.energy.total[1])
    assert ax.get_ylabel() == "energy [J]"
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["kinetic", "gravity", "spring", "ground", "total", "start + work − losses"]
    assert ax.get_ylim()[1] > result.energy.total[1].max()
    np.testing.assert_allclose(owed.get_ydata(), total.get_ydata() - result.energy.residual[1])
    (strip,) = ax.child_axes
    assert strip.get_xlabel() == "time [s]" and strip.get_xlim() == ax.get_xlim()


def test_the_residual_is_in_a_unit_that_reads_well(ax, result):
    ws.plots.residual(ax, result, robot=0)
    values = result.energy.residual[0]
    unit = ax.get_ylabel().removeprefix("residual\n[").removesuffix("]")
    factor = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9}[unit]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), factor * values)
    assert 1.0 <= factor * np.abs(values).max() < 1000.0
    share = np.abs(values).max() / result.energy.total[0].max()
    (note,) = ax.texts
    number, unit = note.get_text().split()[2:4]
    assert float(number) == pytest.approx({"%": 100, "ppm": 1e6}[unit] * share, rel=0.06)


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


@pytest.fixture
def runner(cube):
    """A cube with muscles of 2 cycles/s that runs along y at 0.5 m/s, swinging once a cycle."""
    body = cube.replace(amplitude=0.01, omega=4 * np.pi)
    t = np.arange(41) / 20
    way = np.stack((0 * t, 0.5 * t + 0.02 * np.sin(4 * np.pi * t), 0 * t), axis=1)
    return posed([body], [cube.positions + way[:, None]], fps=20)


def test_speed_and_its_progress_over_a_cycle(ax, runner):
    ws.plots.speed(ax, runner)
    now, mean = ax.lines
    t = now.get_xdata()
    exact = 0.5 + 0.02 * 4 * np.pi * np.cos(4 * np.pi * t)
    np.testing.assert_allclose(now.get_ydata(), exact, atol=0.02)
    np.testing.assert_allclose(mean.get_ydata(), 0.5, atol=1e-9)
    assert mean.get_xdata()[[0, -1]] == pytest.approx([0.25, 1.75])
    assert ax.get_ylabel() == "speed of the centre of mass [m/s]"


def test_trajectory_is_the_way_seen_from_above(ax, runner):
    ws.plots.trajectory(ax, runner)
    (way,) = (line for line in ax.lines if line.get_label() == "robot 0")
    np.testing.assert_allclose(way.get_xdata(), 0.05)
    assert way.get_ydata()[-1] - way.get_ydata()[0] == pytest.approx(1.0)
    (dots,) = (line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(np.diff(dots.get_ydata()), 0.25)  # a cycle of 0.5 s at 0.5 m/s
    outline = ax.patches[0].get_xy()
    assert {tuple(np.round(p, 9)) for p in outline} == {(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)}
    assert [text.get_text() for text in ax.texts] == ["0 s", "2 s"]
    assert ax.get_aspect() == 1.0


def test_footfall_shows_who_is_down_and_when(ax, cube):
    down = np.array([[1, 1, 0, 0, 1], [0, 0, 0, 1, 1]], bool)  # lower edges: y = 0, y = 0.1
    poses = np.tile(cube.positions, (5, 1, 1))
    poses[:, :, 1] += 0.2 * np.arange(5)[:, None]  # it goes along y
    for edge, y in zip(down, (0.0, 0.1), strict=True):
        feet = (cube.positions[:, 2] == 0) & (cube.positions[:, 1] == y)
        poses[:, feet, 2] = np.where(edge, 0.0, 0.05)[:, None]
    ws.plots.footfall(ax, posed([cube], [poses], fps=10))
    spans = [
        [(p.vertices[:, 0].min(), p.vertices[:, 0].max()) for p in bars.get_paths()]
        for bars in ax.collections
    ]
    rear, front = [(0.0, 0.15), (0.35, 0.4)], [(0.25, 0.4)]
    assert np.allclose(spans[0], rear) and np.allclose(spans[1], rear)
    assert np.allclose(spans[2], front) and np.allclose(spans[3], front)
    assert [text.get_text() for text in ax.texts] == ["60%", "60%", "40%", "40%"]
    names = [int(label.get_text()) for label in ax.get_yticklabels()]
    assert [cube.positions[name, 1] for name in names] == [0.0, 0.0, 0.1, 0.1]


def test_stress_histogram_counts_all_springs_and_frames(ax):
    line = np.array([[0.0, 0, 1], [0.1, 0, 1], [0.2, 0, 1]])
    robot = ws.Robot(masses=1.0, positions=line, springs=[(0, 1), (1, 2)], stiffness=100.0)
    poses = np.stack([line * (scale, 1, 1) for scale in (0.5, 1.0, 1.0, 2.0)])
    ws.plots.stress_histogram(ax, posed([robot], [poses]), bins=5)
    shares = [bar.get_height() for bar in ax.patches]  # of -5 N, 0, 0, +10 N, on -10 ... 10 N
    np.testing.assert_allclose(shares, [0, 25, 50, 0, 25])
    red, _, blue = ax.patches[-1].get_facecolor()[:3]
    assert red > 2 * blue
    assert ax.get_xlabel() == "force [N]: compression < 0 < tension"


def test_overview_has_every_plot(result):
    page = ws.plots.overview(result, robot=1)
    names = {ax.get_ylabel().split(" [")[0].split("\n")[0] for ax in page.axes}
    assert {"energy", "height of the centre of mass", "mass, from rear to front"} <= names
    assert len(page.axes) == 6


@pytest.mark.parametrize(
    "name",
    [
        "energies",
        "residual",
        "height",
        "speed",
        "trajectory",
        "footfall",
        "stress_histogram",
    ],
)
def test_a_picture_comes_out(ax, result, name):
    def ink(picture):
        return (picture[:, :, :3] < 0.99).any(axis=2).sum()

    drawn = picture_of(getattr(ws.plots, name)(ax, result))
    assert min(drawn.shape[:2]) > 100
    assert ink(drawn) > 1.05 * ink(picture_of(Figure(figsize=(5, 3)).add_subplot()))


def test_what_is_missing_is_said(ax, result, cube):
    without = dataclasses.replace(result, energy=None)
    with pytest.raises(ValueError, match=r"no energies; simulate with .*energy=True"):
        ws.plots.energies(ax, without)
    with pytest.raises(ValueError, match="robot: got 2, expected 0 to 1"):
        ws.plots.energies(ax, result, robot=2)
    space = posed([cube], [cube.positions[None]], ground=False)
    with pytest.raises(ValueError, match="no ground"):
        ws.plots.footfall(ax, space)
    with pytest.raises(ValueError, match="needs two frames"):
        ws.plots.speed(ax, space)
    unrecorded = ws.Simulation([cube], ws.Scene()).run(0.01)
    with pytest.raises(ValueError, match="not recorded"):
        ws.plots.height(ax, unrecorded)
