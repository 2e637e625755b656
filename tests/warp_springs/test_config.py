"""Scene files: what they build, that they survive being written, and mistakes in one line."""

import math

import numpy as np
import pytest

import warp_springs as ws
from warp_springs.config import (
    ConfigError,
    SceneFile,
    dump,
    load_scene,
    parse,
    parse_settings,
    reference,
)

MINIMAL = """
name = "drop"
robot.body.shape = "cube"
simulation.duration = 0.1
"""
RICH = """
name = "rich"
about = "nearly every key"

[[robots]]
name = "walker"
position = [0.0, 0.0, 0.3]
velocity = [1.0, 0.0, 0.0]
spin = [0.0, 0.0, 2.0]
scale = 0.5
rotation = {axis = [1, 2, 3], angle = 0.7}
materials = [
    {name = "tissue"},
    {name = "muscle", box = [[-1, -1, -1], [0.06, 1, 1]]},
    {name = "rubber", stiffness = 300.0, color = "#102030", springs = [0, 1]},
]

[robots.body]
shape = "voxels"
layers = [["#.#"], ["###"]]

[[robots]]
copies = 3
orientation = "random"
seed = 4
body = {shape = "sphere", subdivisions = 1}
actuation = {amplitude = 0.1, omega = 5.0, phase = "spread"}

[scene]
gravity = [0, 0, -1.6]
damping = 0.5
ground.material = ["ice", "ice"]

[simulation]
duration = 0.05
integrator = "leapfrog"
dt = 1e-4

[record]
fps = 100
robots = [0, 2]
write = ["result"]
"""


@pytest.fixture
def scene(tmp_path):
    """Write a scene file and read it back, with keys changed."""

    def make(text=MINIMAL, changes=None):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load_scene(path, changes)

    return make


# -- what is built ---------------------------------------------------------------------------


def test_the_least_that_is_a_scene(scene):
    config = scene()
    assert config.build_robots() == [ws.shapes.cube()]
    simulation = config.make_simulation()
    assert simulation.scene == ws.Scene()
    assert simulation.integrator == "chin4"
    result = config.run()
    assert result.end_time == pytest.approx(0.1) and len(result.times) == 7


def test_a_rich_scene(scene):
    config = scene(RICH)
    robots = config.build_robots()
    assert list(config.names.values()) == ["walker", "sphere 1", "sphere 2", "sphere 3"]
    mask = np.array([[[1, 1]], [[0, 1]], [[1, 1]]])
    body = ws.shapes.voxels(mask).scaled(0.5).made_of(ws.materials.TISSUE)
    body = body.made_of(ws.materials.MUSCLE, where=[(-1.0, -1, -1), (0.06, 1, 1)])
    rubber = ws.Material("rubber", stiffness=300.0, color="#102030")
    body = body.made_of(rubber, where=[0, 1]).rotated((1, 2, 3), 0.7).moved((0, 0, 0.3))
    assert robots[0] == body.moving((1, 0, 0)).spinning((0, 0, 2))
    balls = robots[1:]
    assert len({ball.positions.tobytes() for ball in balls}) == 3
    n = balls[0].n_springs
    assert np.array_equal(balls[0].phase, np.linspace(0, 2 * math.pi, n, endpoint=False))
    assert balls[0].amplitude == pytest.approx(0.1 * balls[0].rest_length)
    assert balls[0].omega == 5.0
    expected = ws.Scene(
        gravity=(0, 0, -1.6), damping=0.5, ground=ws.Ground(material=("ice", "ice"))
    )
    result = config.run()
    assert result.scene == expected
    assert (result.integrator, result.dt, result.recorded) == ("leapfrog", 1e-4, (0, 2))


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ({"shape": "beam", "cells": [4, 1, 1]}, ws.shapes.beam(cells=(4, 1, 1))),
        ({"shape": "chain", "links": 3}, ws.shapes.chain(links=3)),
        ({"shape": "octahedron", "edge": 0.3}, ws.shapes.octahedron(edge=0.3)),
        (
            {"shape": "random_lattice", "bounds": [0.1, 0.1, 0.1], "spacing": 0.05, "seed": 2},
            ws.shapes.random_lattice((0.1, 0.1, 0.1), 0.05, 2),
        ),
    ],
)
def test_shapes(scene, body, expected):
    assert scene(changes={"robot.body": body}).build_robots() == [expected]


def test_meshes_and_saved_robots_lie_beside_the_file(scene, tmp_path):
    ball = ws.shapes.sphere(subdivisions=1).made_of(ws.materials.BONE)
    ball.save(tmp_path / "ball.npz")
    ws.write_mesh(ball, tmp_path / "ball.stl")
    saved = scene(changes={"robot.body": {"shape": "saved", "path": "ball.npz"}})
    assert saved.build_robots() == [ball]
    mesh = {"shape": "mesh", "path": "ball.stl", "scale": "mm", "fill": 5e-5}
    (filled,) = scene(changes={"robot.body": mesh}).build_robots()
    assert filled.volume == pytest.approx(1e-9 * ball.volume, rel=1e-5)
    assert filled.n_masses > len(np.unique(ball.faces))


def test_travelling_waves_and_harmonics(scene):
    muscles = {"amplitude": 0.1, "omega": 3.0, "wave": [20.0, 0, 0], "harmonics": [[0.05, 0.4]]}
    body = {"shape": "beam"}
    (robot,) = scene(changes={"robot.body": body, "robot.actuation": muscles}).build_robots()
    middles = robot.positions[robot.springs].mean(axis=1)[:, 0]
    t = 0.37
    expected = 1.0 + 0.1 * np.sin(3 * t - 20 * middles) + 0.05 * np.sin(2 * 3 * t + 0.4)
    assert robot.rest_length_at(t) == pytest.approx(robot.lengths * expected)


def test_elements_of_a_robot(scene):
    changes = {
        "robot.fixed": [{"masses": [0], "axes": "xz"}],
        "robot.held": [{"type": "sphere", "center": [0, 0, 0], "radius": 0.2, "masses": [7]}],
        "robot.tethers": [{"masses": [1], "stiffness": 5.0, "end": 2.0}],
        "robot.pushes": [{"box": [[-1, -1, -1], [0, 1, 1]], "force": [1, 0, 0], "duration": 0.1}],
        "robot.shoes": [{"masses": [2, 3], "static_friction": 0.04}],
        "robot.cables": {"springs": [5]},
        "robot.dashpots": [{"ratio": 0.1}],
        "robot.loads": [{"masses": [7], "mass": 0.5}],
    }
    (robot,) = scene(changes=changes).build_robots()
    expected = (
        ws.shapes.cube()
        .replace(masses=[0.1] * 7 + [0.5])
        .with_cables([5])
        .with_dashpots(0.1)
        .fixed([0], "xz")
    )
    expected = expected.held_to(ws.Sphere(center=(0, 0, 0), radius=0.2), [7])
    expected = expected.tethered([1], 5.0, end=2.0).shod([2, 3], static_friction=0.04)
    assert robot == expected.pushed([0, 1, 2, 3], (1, 0, 0), duration=0.1)


def test_springs_of_a_robot(scene):
    changes = {
        "robot.waveforms": [{"values": [0, 0.1, 0, -0.1, 0], "omega": 3.0, "harmonics": 2}],
        "robot.omegas": [{"omega": 5.0, "springs": [0]}],
        "robot.curves": [{"stretch": [0.0, 0.1], "stiffness": [0.5, 1, 2], "springs": [1]}],
        "robot.hardening": [{"cubic": 1e4, "springs": [2]}],
        "robot.limits": [{"breaks": 1e6, "yields": 5e5, "area": 1e-4, "springs": [3]}],
        "robot.stiffness": [{"times": [0, 1], "factors": [1, 2], "period": 2, "springs": [4]}],
        "robot.winches": [{"times": [0, 1], "offsets": [0, 0.1], "period": 2, "springs": [5]}],
    }
    (robot,) = scene(changes=changes).build_robots()
    wave = ws.Waveform.fit([0, 0.1, 0, -0.1, 0], harmonics=2)
    expected = (
        ws.shapes.cube()
        .with_waveform(wave, 3.0)
        .with_omegas(5.0, [0])
        .with_curve([0.0, 0.1], [0.5, 1, 2], [1])
        .with_hardening(1e4, [2])
        .with_limits(1e6, 5e5, [3], area=1e-4)
        .with_stiffness_in_time([0, 1], [1, 2], [4], period=2)
        .with_winch([0, 1], [0, 0.1], [5], period=2)
    )
    assert robot == expected


SEEKER = """
name = "seeker"

[robot]
body.shape = "cube"
rotation = {angle = 1.0}
position = [0.0, 0.0, 0.01]

[[robot.controllers]]
springs = [0, 1, 5]
outputs = [0, 0, 1]
hidden = 2
recurrent = true
reach = 0.3
rate = 50.0
seed = 3
spread = 0.5
sensors = [
    {type = "contact", box = [[-1, -1, -1], [1, 1, 0.01]]},
    {type = "force", masses = [0], full = 5.0},
    {type = "length", springs = [3], full = 0.1},
    {type = "velocity", full = 2.0},
    {type = "tilt"},
    {type = "goal", place = [1, 2, 0], full = 3.0, motion = [0.1, 0, 0]},
    {type = "light", masses = [1, 2], place = [0, 1, 1], full = 0.5},
    {type = "clock", period = 0.4},
]

[[robot.controllers]]
springs = [7]
hidden = 0
weights = [0.25, -0.5, 1.0]
response = 0.1
growth = {speed = 0.3, budget = 0.5}
sensors = [{type = "clock", period = 1.0}]

[simulation]
duration = 0.2
"""


def test_closed_loops(scene):
    config = scene(SEEKER)
    (robot,) = config.build_robots()
    s = ws.sensors
    first = ws.Controller(
        sensors=[
            s.contact([0, 2, 4, 6]),
            s.force([0], 5.0),
            s.length([3], 0.1),
            s.velocity(2.0),
            s.tilt(),
            s.goal((1, 2, 0), 3.0, (0.1, 0, 0)),
            s.light([1, 2], (0, 1, 1), 0.5),
            s.clock(0.4),
        ],
        muscles=[0, 1, 5],
        outputs=[0, 0, 1],
        hidden=2,
        recurrent=True,
        reach=0.3,
        rate=50.0,
    )
    first = first.replace(weights=0.5 * np.random.default_rng(3).normal(size=first.n_weights))
    second = ws.Controller([s.clock(1.0)], [7], [0.25, -0.5, 1.0], hidden=0, response=0.1)
    second = second.replace(growth=ws.Growth(speed=0.3, budget=0.5))
    expected = ws.shapes.cube().controlled(first).controlled(second)
    expected = expected.rotated((0, 0, 1), 1.0).moved((0, 0, 0.01))
    assert robot == expected
    result, direct = config.run(), ws.Simulation(expected, ws.Scene()).run(0.2)
    assert np.array_equal(result.signals(0), direct.signals(0)) and np.any(result.signals(0))
    assert np.array_equal(result.positions(0), direct.positions(0))


def test_everything_of_a_scene(scene):
    changes = {
        "scene.drag": 0.1,
        "scene.wind": [1, 0, 0],
        "scene.water": {"level": 0.1, "density": 2.0},
        "scene.collisions": {"stiffness": 5e3},
        "scene.ground": False,
        "scene.obstacles": [
            {"type": "plane", "normal": [1, 0, 1], "material": ["steel", "steel"]},
            {"type": "sphere", "center": [1, 0, 0], "radius": 0.2},
            {"type": "box", "center": [1, 0, 0], "size": [1, 1, 1], "angle": 0.3},
            {"type": "height_field", "spacing": 0.1, "heights": [[0, 1], [2, 3]]},
        ],
    }
    built = scene(changes=changes).scene.build()
    assert built.ground is None and built.wind == (1.0, 0.0, 0.0)
    assert built.water == ws.Water(level=0.1, density=2.0)
    assert built.collisions == ws.Collisions(stiffness=5e3)
    plane, sphere, box, field = built.obstacles
    assert plane == ws.Plane(normal=(1, 0, 1), static_friction=0.74, kinetic_friction=0.57)
    assert sphere == ws.Sphere(center=(1, 0, 0), radius=0.2)
    assert box == ws.Box(center=(1, 0, 0), size=(1, 1, 1), angle=0.3)
    assert field.heights.tolist() == [[0, 1], [2, 3]]


def test_random_orientations_are_uniform(scene):
    """The image of any direction is uniform on the sphere: its z is uniform in (-1, 1)."""
    config = scene(changes={"robot.copies": 2000, "robot.orientation": "random"})
    edges = np.array([robot.positions[1] - robot.positions[0] for robot in config.build_robots()])
    z = np.sort(edges[:, 2] / 0.1)
    uniform = np.linspace(-1, 1, len(z))
    assert np.abs(z - uniform).max() < 0.06  # Kolmogorov and Smirnov: 1.36 * 2 / sqrt(2000)


# -- text ------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [MINIMAL, RICH, SEEKER])
def test_a_scene_survives_being_written(scene, text):
    config = scene(text)
    again = parse(SceneFile, dump(config), "copy")
    assert again.model_dump() == config.model_dump()
    assert again.build_robots() == config.build_robots()


def test_no_ground_survives_being_written(scene):
    config = scene(changes={"scene.ground": False})
    assert parse(SceneFile, dump(config), "copy").scene.ground is None


def test_keys_in_lists_can_be_set(scene):
    config = scene(RICH, {"robots.1.copies": 2, "robots.0.materials.0.name": "bone"})
    assert len(config.build_robots()) == 3
    assert config.build_robots()[0].materials[0] == ws.materials.BONE


MISTAKES = [
    ({"robot.body.edg": 0.2}, "unknown key robot.body.edg (did you mean 'edge'?)"),
    ({"robot.body.shape": "blob"}, "robot.body.shape must be one of 'cube', "),
    ({"robot.copies": 0}, "robot.copies: input should be greater than or equal to 1, not 0"),
    ({"robot.materials": [{"name": 3}]}, "robot.materials.0.name: input should be a valid string"),
    ({"robot.materials": [{"name": "goo"}]}, "robot: goo: give either stiffness"),
    ({"robot.fixed": [{"masses": [8]}]}, "robot: masses: 8 given, there are 8"),
    (
        {"robot.fixed": [{"masses": [1], "box": [[0, 0, 0], [1, 1, 1]]}]},
        "robot.fixed.0: give either masses or a box, not both",
    ),
    ({"robot.actuation": {"phase": "fast"}}, "robot.actuation.phase: expected a number, a list"),
    ({"robot.actuation": {"phase": [1, 2]}}, "actuation.phase: 2 given, for 28 springs"),
    ({"robot.body": {"shape": "saved", "path": "x.npz"}}, "x.npz"),
    ({"robot.body": {"shape": "mesh", "path": "x.stl"}}, "x.stl: there is no such file"),
    ({"robot.controllers": [{"sensors": []}]}, "robot.controllers.0.sensors: tuple should have"),
    ({"robot.controllers": [{"sensors": [{"type": "nose"}]}]}, "0.sensors.0.type must be one of"),
    (
        {"robot.controllers": [{"sensors": [{"type": "tilt"}], "weights": [1.0]}]},
        "robot: weights: shape (1,) given, (276,) expected",
    ),
    ({"robot.winches": [{"times": [0, 0], "offsets": [0, 1]}]}, "robot: times"),
    ({"robots": [{"body": {"shape": "cube"}}]}, "give either one [robot] or several [[robots]]"),
    (
        {"scene.ground.material": ["ice", "cheese"]},
        "ground: no friction of ('ice', 'cheese')",
    ),
    ({"scene.ground": 5}, "scene.ground: input should be a valid dictionary"),
    ({"scene.obstacles": [{"type": "cone"}]}, "scene.obstacles.0.type must be one of 'plane', "),
    ({"scene.obstacles": [{"type": "sphere"}]}, "scene.obstacles.0.center is missing"),
    ({"scene.gravity": [0, 0]}, "scene.gravity.2 is missing"),
    ({"scene.gravity": [0, 0, math.inf]}, "scene.gravity.2: input should be a finite number"),
    ({"scene.wind": [1, 0, 0]}, "scene: Scene.wind: a wind without drag has no force"),
    ({"simulation.dt": "fast"}, "simulation.dt: expected a number of seconds above 0, or 'auto'"),
    ({"simulation.duration": 0}, "simulation.duration: input should be greater than 0, not 0"),
    ({"simulation.device": "tpu"}, "simulation: "),
    ({"record.write": ["gif"]}, "record.write.0: input should be 'result', 'usd', "),
    ({"record.robots": [3]}, "record.robots: 3 given, there are 1"),
    ({"name": "a/b"}, "name: string should match pattern"),
    ({"nam": "x"}, "unknown key nam (did you mean 'name'?)"),
]


@pytest.mark.parametrize(("changes", "message"), MISTAKES, ids=lambda x: str(x)[:40])
def test_mistakes_are_named_in_one_line(scene, changes, message):
    with pytest.raises((ConfigError, OSError)) as error:
        scene(changes=changes).run()
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert "scene.toml" in str(error.value) or isinstance(error.value, OSError)


def test_files_that_are_no_scenes(tmp_path):
    path = tmp_path / "broken.toml"
    with pytest.raises(ConfigError, match=r"there is no file .*broken.toml"):
        load_scene(path)
    path.write_text("name = = 3")
    with pytest.raises(ConfigError, match=r"broken.toml is not valid TOML: .*line 1"):
        load_scene(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"cannot read .*broken.toml"):
        load_scene(path)
    path.write_text("")
    with pytest.raises(ConfigError, match=r"broken.toml: name is missing \(and 1 more error\)"):
        load_scene(path)


def test_settings_are_read_as_toml():
    assert parse_settings(["a.b=[1, 2]", "c=word", "d=true"]) == {
        "a.b": [1, 2],
        "c": "word",
        "d": True,
    }
    with pytest.raises(ConfigError, match="--set takes KEY=VALUE"):
        parse_settings(["a"])


def test_the_reference_explains_every_key():
    lines = reference(SceneFile).splitlines()
    keys = [line for line in lines if " = " in line or line.endswith(" =")]
    assert len(keys) > 100
    bare = [line for line in keys if "#" not in line]
    assert all(line.startswith(("shape", "type")) for line in bare), bare
    headings = [line for line in lines if line.startswith("[")]
    for table in ("[robot.body]", "[[robot.materials]]", "[scene.ground]", "[record]"):
        assert table in headings
    assert headings.count("[robot.body]") == 12


def test_the_command_prints_the_reference(capsys):
    from rich.console import Console

    from warp_springs.commands.run import RunCommand

    assert RunCommand(keys=True).run(Console()) == 0
    assert capsys.readouterr().out == reference(SceneFile)


def test_robots_of_a_file_may_share_a_world():
    text = SCENE_TOGETHER.replace("WORLD", "together")
    config = parse(SceneFile, text, "scene.toml")
    assert config.names == {0: "two"}
    together = config.run()
    assert len(together) == 1 and together.positions(0)[8:, 2].min() > 0.08  # it lies on the other
    apart = parse(SceneFile, text.replace("together", "apart"), "scene.toml").run()
    assert len(apart) == 2 and apart.positions(1)[:, 2].min() < 0.05


SCENE_TOGETHER = """
name = "two"
[robot]
positions = [[0.0, 0.0, 0.0], [0.01, 0.02, 0.12]]
[robot.body]
shape = "cube"
[scene]
damping = 2.0
[scene.collisions]
[simulation]
duration = 0.5
world = "WORLD"
"""
