"""Materials: the course's figures, bars, regions, weights, and the table of friction."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import warp_springs as ws
from warp_springs import materials
from warp_springs.materials import BONE, FRICTION, MUSCLE, MUSCLE2, NYLON, TISSUE

COURSE_FRICTION = """
steel steel 0.74 0.57
aluminium steel 0.61 0.47
copper steel 0.53 0.36
rubber concrete 1.0 0.8
glass glass 0.94 0.4
waxed_wood wet_snow 0.14 0.10
waxed_wood dry_snow 0.01 0.04
lubricated_metal lubricated_metal 0.15 0.06
ice ice 0.10 0.03
Teflon Teflon 0.04 0.04
synovial_joint synovial_joint 0.01 0.003
"""


@pytest.fixture
def body():
    return ws.shapes.lattice(3, 1, 1)


# -- materials -------------------------------------------------------------------------------


def test_the_four_materials_of_the_course():
    figures = {m.name: (m.stiffness, m.strain, m.phase) for m in (TISSUE, BONE, MUSCLE, MUSCLE2)}
    assert figures == {
        "tissue": (1_000.0, 0.0, 0.0),
        "bone": (20_000.0, 0.0, 0.0),
        "muscle": (5_000.0, 0.25, 0.0),
        "muscle2": (5_000.0, 0.25, math.pi),
    }
    assert materials.BUILT_IN["nylon"] is NYLON
    assert len({m.color for m in materials.BUILT_IN.values()}) == 5


def test_made_of_sets_everything_a_spring_needs(body):
    robot = body.made_of(TISSUE).made_of(MUSCLE2, where=[3, 5])
    muscle = np.isin(np.arange(robot.n_springs), [3, 5])
    assert robot.materials == (TISSUE, MUSCLE2)
    assert robot.material.tolist() == np.where(muscle, 1, 0).tolist()
    assert robot.stiffness.tolist() == np.where(muscle, 5_000.0, 1_000.0).tolist()
    assert np.array_equal(robot.amplitude, np.where(muscle, 0.25 * robot.rest_length, 0.0))
    assert np.array_equal(robot.phase, np.where(muscle, math.pi, 0.0))
    assert robot.omega == 2.0 * math.pi
    assert body.materials == () and set(body.material) == {-1}
    # A muscle first expands, the other first contracts.
    expanding = body.made_of(MUSCLE).rest_length_at(0.25) / body.rest_length
    assert expanding == pytest.approx(1.25)
    assert body.made_of(MUSCLE2).rest_length_at(0.25) / body.rest_length == pytest.approx(0.75)


def test_a_muscle_turned_bone_does_not_breathe_and_keeps_the_omega(body):
    robot = body.replace(omega=3.0).made_of(MUSCLE).made_of(BONE)
    assert not robot.is_actuated
    assert robot.omega == 3.0
    assert body.made_of(BONE).omega == 0.0


def test_regions(body):
    middles = body.positions[body.springs].mean(axis=1)
    left = middles[:, 0] <= 0.1
    wanted = body.made_of(BONE, where=left)
    assert left.any() and not left.all()
    assert wanted.material.tolist() == np.where(left, 0, -1).tolist()
    assert body.made_of(BONE, where=np.flatnonzero(left)) == wanted
    assert body.made_of(BONE, where=lambda m: m[:, 0] <= 0.1) == wanted
    assert body.made_of(BONE, where=[(-1.0, -1.0, -1.0), (0.1, 1.0, 1.0)]) == wanted
    assert body.made_of(BONE, where=[]).stiffness.tolist() == body.stiffness.tolist()


@pytest.mark.parametrize("where", [[0, 99], [True, False], [0.5, 1.5], "left", np.zeros((2, 2))])
def test_a_malformed_region_is_refused(body, where):
    with pytest.raises(ValueError, match="where"):
        body.made_of(BONE, where=where)


def test_bars_are_stiff_by_their_length():
    rod = ws.Material("rod", modulus=2e9, section=1e-6, density=1000.0)
    robot = ws.shapes.cube(edge=0.1).made_of(rod)
    assert robot.stiffness * robot.rest_length == pytest.approx(2e9 * 1e-6)
    # A cube of rods: 12 edges, 12 face and 4 space diagonals.
    length = 0.1 * (12 + 12 * math.sqrt(2) + 4 * math.sqrt(3))
    assert robot.weighed().mass == pytest.approx(1000.0 * 1e-6 * length)
    assert np.ptp(robot.weighed().masses) == pytest.approx(0.0, abs=1e-18)


def test_a_bar_oscillates_with_the_frequency_of_its_modulus():
    """Two masses on a bar: omega^2 = (E A / L) (1 / m1 + 1 / m2)."""
    rod = ws.Material("rod", modulus=1e6, section=1e-5)
    pair = ws.Robot(
        masses=[0.1, 0.3], positions=[(0, 0, 0), (0.5, 0, 0)], springs=[(0, 1)], stiffness=1.0
    ).made_of(rod)
    omega = math.sqrt(1e6 * 1e-5 / 0.5 * (1 / 0.1 + 1 / 0.3))
    stretched = pair.replace(positions=[(0, 0, 0), (0.51, 0, 0)])
    scene = ws.Scene(gravity=(0, 0, 0), ground=None)
    result = ws.Simulation(stretched, scene, dt=1e-4).run(0.2)
    length = np.diff(result.positions(0)[:, 0])[0]
    assert length == pytest.approx(0.5 + 0.01 * math.cos(omega * result.end_time), abs=1e-7)


def test_a_solid_weighs_its_volume(body):
    robot = body.made_of(TISSUE).weighed()
    assert robot.volume == pytest.approx(3e-3)
    assert robot.mass == pytest.approx(3e-3 * 1_060.0)
    mixed = body.made_of(TISSUE).made_of(BONE, where=np.arange(body.n_springs // 2)).weighed()
    half = body.n_springs // 2 / body.n_springs
    assert mixed.mass == pytest.approx(3e-3 * (half * 1_900.0 + (1 - half) * 1_060.0))


def test_what_cannot_be_weighed(body):
    for robot, message in [
        (body, "needs a material"),
        (body.made_of(ws.Material("foam", stiffness=5.0)), "foam has no density"),
        (body.replace(faces=None).made_of(BONE), "enclose no volume"),
        (body.made_of(BONE).made_of(NYLON, where=[0]), "some materials"),
    ]:
        with pytest.raises(ValueError, match=message):
            robot.weighed()


def test_materials_survive(body):
    robot = body.made_of(TISSUE).made_of(MUSCLE, where=[0])
    for other in (
        robot.moved((1, 2, 3)),
        robot.rotated((0, 0, 1), 1.0).spinning((1, 0, 0)),
        robot.replace(stiffness=7.0),
        pickle.loads(pickle.dumps(robot)),
        robot.variants(stiffness=np.full((4, robot.n_springs), 5.0))[2],
    ):
        assert other.materials == (TISSUE, MUSCLE)
        assert other.material.tolist() == [1] + [0] * (robot.n_springs - 1)
    assert robot != robot.replace(material=0)
    assert robot != robot.replace(materials=(BONE, MUSCLE))
    assert hash(robot) == hash(robot.moved((0, 0, 0)))


def test_variants_may_differ_in_material(body):
    labels = np.tile([[0], [1]], (1, body.n_springs))
    pair = body.replace(materials=(BONE, TISSUE)).variants(material=labels)
    assert [set(robot.material) for robot in pair] == [{0}, {1}]
    with pytest.raises(ValueError, match="material"):
        body.variants(material=labels)


def test_joined_bodies_bring_their_materials():
    left = ws.shapes.cube().made_of(BONE).made_of(MUSCLE, where=[0])
    right = ws.shapes.cube().moved((0.1, 0, 0)).made_of(NYLON).made_of(BONE, where=[27])
    both = left.joined(right, merge=True)
    assert both.materials == (BONE, MUSCLE, NYLON)
    names = [both.materials[i].name for i in both.material]
    # Springs of the shared side are the left one's.
    assert (names.count("bone"), names.count("muscle"), names.count("nylon")) == (28, 1, 21)
    bare = ws.shapes.cube().joined(right)
    assert [bare.materials[i].name if i >= 0 else None for i in bare.material] == (
        [None] * 28 + ["nylon"] * 27 + ["bone"]
    )


def test_malformed_materials_are_refused(body):
    for arguments, message in [
        ({"name": ""}, "name"),
        ({"name": "x"}, "either stiffness"),
        ({"name": "x", "stiffness": 1.0, "modulus": 1.0}, "either stiffness"),
        ({"name": "x", "modulus": 1e9}, "section"),
        ({"name": "x", "stiffness": -1.0}, "x.stiffness"),
        ({"name": "x", "stiffness": 1.0, "strain": math.nan}, "x.strain"),
        ({"name": "x", "stiffness": 1.0, "color": "red"}, "#rrggbb"),
    ]:
        with pytest.raises(ValueError, match=message):
            ws.Material(**arguments)
    with pytest.raises(TypeError, match="expected a Material"):
        body.made_of("bone")
    with pytest.raises(ValueError, match=r"material\[0\] = 0"):
        body.replace(material=0)
    with pytest.raises(ValueError, match=r"material\[2\] = -2"):
        body.replace(materials=(BONE,), material=[0, 0, -2] + [0] * (body.n_springs - 3))
    with pytest.raises(ValueError, match=r"materials\[0\]"):
        body.replace(materials=("bone",))
    with pytest.raises(ValueError, match="length 0"):
        body.replace(rest_length=0.0).made_of(NYLON)


def test_colours_are_linear_for_renderers():
    grey = ws.Material("grey", stiffness=1.0, color="#bcbcbc")
    assert grey.rgb == pytest.approx([0.5029] * 3, abs=1e-3)  # sRGB 188 is half the light
    assert ws.Material("x", stiffness=1.0, color="#00ff0a").rgb[:2] == (0.0, 1.0)


# -- friction --------------------------------------------------------------------------------


def test_friction_of_the_course():
    for row in COURSE_FRICTION.split("\n")[1:-1]:
        first, second, static, kinetic = row.replace("_", " ").rsplit(" ", 2) and (
            *(word.replace("_", " ") for word in row.split()[:2]),
            *map(float, row.split()[2:]),
        )
        assert FRICTION[first, second] == (static, kinetic)
        assert FRICTION[second, first] == (static, kinetic)
    assert 0.25 <= FRICTION["wood", "wood"].static <= 0.5
    assert FRICTION["wood", "wood"].kinetic == 0.2
    assert len(FRICTION) == 12
    assert FRICTION["teflon", "TEFLON"] == FRICTION["Teflon", "Teflon"]


@pytest.mark.parametrize("pair", [("rubber", "cheese"), ("ice",), "ice", ("ice", 3), 7])
def test_unknown_surfaces(pair):
    with pytest.raises(KeyError, match="rubber on concrete"):
        FRICTION[pair]


def test_ground_of_two_surfaces():
    ground = ws.Ground(material=("ice", "ice"), stiffness=2e5)
    assert (ground.static_friction, ground.kinetic_friction) == (0.10, 0.03)
    assert ground == ws.Ground(stiffness=2e5, static_friction=0.10, kinetic_friction=0.03)
    assert (ws.Ground().static_friction, ws.Ground().kinetic_friction) == (1.0, 0.8)
    assert ws.Ground(static_friction=0.3).kinetic_friction == 0.8
    assert replace(ground, stiffness=1.0).static_friction == 0.10
    with pytest.raises(ValueError, match="one or the other"):
        ws.Ground(material=("ice", "ice"), kinetic_friction=0.5)
    with pytest.raises(KeyError, match="steel on steel"):
        ws.Ground(material=("ice", "steel"))
