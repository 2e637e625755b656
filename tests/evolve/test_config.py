from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import warp_springs as ws
from evolve.encodings import ENCODINGS
from evolve.errors import ConfigError
from evolve.optimizers import OPTIMIZERS
from evolve.toml import dump, load, parse, parse_settings, preset_names


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_complete_and_survives_being_written(name):
    config = load(name)
    assert config.name == name and config.about and "\n" not in config.about
    assert parse(dump(config), "copy") == config
    encoding = config.make_encoding()
    for robot in encoding.express(encoding.random(2, np.random.Generator(np.random.Philox(1)))):
        assert robot.bounds[0, 2] == 0.0, "it stands on the ground"


def test_the_presets_are_there():
    wanted = {"walker", "cube", "octahedron", "worm", "starfish", "tripod", "blob"}
    assert wanted <= set(preset_names())


def test_a_body_is_there_exactly_where_an_encoding_needs_one():
    with pytest.raises(ConfigError, match="body: the encoding direct needs one"):
        load("critter", {"encoding.type": "direct"})
    with pytest.raises(ConfigError, match="body: the encoding voxels makes its own bodies"):
        load("critter", {"body.shape": "cube"})


@given(
    about=st.text(),
    damping=st.floats(0.0, 1e300),
    low=st.floats(1e-300, 1.0),
    seed=st.integers(0, 2**62),
)
def test_a_configuration_survives_being_written(about, damping, low, seed):
    changes = {
        "about": about,
        "scene.damping": damping,
        "encoding.rest_length": [low, 1.0],
        "seed": seed,
    }
    config = load("cube", changes)
    assert parse(dump(config), "copy") == config


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_every_optimizer_can_be_chosen_by_its_name(name):
    encoding = "arena" if name == "coevolution" else "direct"
    config = load("cube", {"optimizer.type": name, "encoding.type": encoding})
    assert isinstance(config.make_optimizer(config.make_encoding()), OPTIMIZERS[name])


@pytest.mark.parametrize("name", ENCODINGS)
def test_every_encoding_can_be_chosen_by_its_name(name):
    preset = "cube" if ENCODINGS[name].needs_body else "critter"
    settings = {"encoding.type": name, "task.goals": [[1.0, 0.0, 0.5]]}  # some sense a light
    assert isinstance(load(preset, settings).make_encoding(), ENCODINGS[name])


SHAPES = [
    ({"shape": "cube", "mass": 1.6}, 28, 1.6),
    ({"shape": "tetrahedron"}, 6, 0.4),
    ({"shape": "octahedron"}, 15, 0.6),
    ({"shape": "lattice", "nx": 2, "ny": 1, "nz": 1}, 50, 1.2),
    ({"shape": "voxels", "layers": [["##"]]}, 50, 1.2),
]


@pytest.mark.parametrize(("body", "springs", "mass"), SHAPES, ids=lambda x: str(x))
def test_every_body_can_be_built(body, springs, mass):
    robot = load("cube", {"body": body}).body.build()
    assert robot.n_springs == springs
    assert robot.mass == pytest.approx(mass)


def test_bodies_may_come_from_files_beside_the_configuration(tmp_path):
    body = ws.shapes.sphere(subdivisions=1).made_of(ws.materials.BONE)
    body.save(tmp_path / "ball.npz")
    ws.write_mesh(body, tmp_path / "ball.vtu")
    path = tmp_path / "mine.toml"
    text = dump(load("cube", {"body": {"shape": "tetrahedron"}}))
    path.write_text(text)
    saved = load(path, {"body": {"shape": "saved", "path": "ball.npz"}})
    assert saved.body.build() == body
    assert parse(dump(saved), "a copy in another folder").body.build() == body
    mesh = load(path, {"body": {"shape": "mesh", "path": "ball.vtu"}})
    assert np.array_equal(mesh.make_encoding().body.springs, body.springs)


def test_layers_are_maps_seen_from_above():
    layers = [["#..", "..."], ["###", "..#"]]
    mask = load("cube", {"body": {"shape": "voxels", "layers": layers}}).body.mask
    assert mask.shape == (3, 2, 2)
    assert mask[0, 1, 0], "the first row of a layer is the farthest, its first sign at x = 0"
    assert mask[2, 0, 1] and mask.sum() == 5
    numbers = [[[1, 0, 0], [0, 0, 0]], [[1, 1, 1], [0, 0, 1]]]
    again = load("cube", {"body": {"shape": "voxels", "layers": numbers}}).body.mask
    np.testing.assert_array_equal(mask, again)


MISTAKES = [
    ({"sed": 3}, "unknown key sed (did you mean 'seed'?)"),
    ({"optimizer.elite": 0.1}, "unknown key optimizer.elite (did you mean 'elites'?)"),
    ({"encoding.foo": 1}, "unknown key encoding.foo"),
    ({"population": 0}, "population: input should be greater than or equal to 1, not 0"),
    ({"population": "many"}, "population: input should be a valid integer"),
    ({"generations": 0}, "generations: input should be greater than or equal to 1, not 0"),
    ({"optimizer.type": "genetik"}, "optimizer.type must be one of 'random', 'hill_climber', "),
    ({"body.shape": "blob"}, "body.shape must be one of 'cube', "),
    ({"body.shape": "voxels"}, "body.layers is missing"),
    ({"body": {"shape": "voxels", "layers": [["#", "x"]]}}, "layer 0, row 1: 'x' is neither"),
    ({"body": {"shape": "voxels", "layers": [["#", "##"]]}}, "layer 0, row 1: every layer and row"),
    ({"body": {"shape": "voxels", "layers": [["."]]}}, "body.layers: there is no voxel"),
    ({"encoding.stiffness": [2, 1]}, "encoding.stiffness: expected two finite numbers"),
    ({"encoding.stiffness": [1, math.inf]}, "encoding.stiffness: expected two finite numbers"),
    ({"simulation.dt": 0.2}, "simulation.dt = 0.2 s is too long for cycles of 0.5 s"),
    ({"simulation.dt": "auto", "encoding.period": 5e-3}, "simulation.dt = 0.001 s is too long for"),
    (
        {"simulation.dt": 0.0},
        "simulation.dt: expected a number of seconds above 0, or 'auto', not 0",
    ),
    ({"simulation.dt": "fast"}, "simulation.dt: expected a number of seconds above 0, or"),
    ({"simulation.dt": math.nan}, "simulation.dt: expected a number of seconds above 0, or"),
    ({"task.second_look": 0.8}, "task.second_look: expected a table; the share to keep is"),
    (
        {"task.second_look.trails": 3},
        "unknown key task.second_look.trails (did you mean 'trials'?)",
    ),
    (
        {"task.fitness": "sped"},
        "task.fitness: expected measures, which are approach, brightness, diameter,",
    ),
    ({"name": "../up"}, "name: string should match pattern"),
    ({"seed.x": 1}, "seed: input should be a valid integer"),
    ({"name.x": 1}, "name.x: name is a value, not a table"),
]


@pytest.mark.parametrize(("change", "message"), MISTAKES, ids=lambda x: str(x)[:40])
def test_mistakes_are_named_in_one_line(change, message):
    with pytest.raises(ConfigError) as error:
        load("cube", change)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("integrator", ["chin4", "leapfrog", "euler"])
@pytest.mark.parametrize("dt", [1e-3, "auto"])
def test_steps_and_integrators_can_be_chosen(integrator, dt):
    config = load("cube", {"simulation.dt": dt, "simulation.integrator": integrator})
    assert config.simulation.dt == dt and parse(dump(config), "copy") == config


def test_presets_and_files_that_do_not_exist(tmp_path):
    with pytest.raises(ConfigError, match=r"no preset 'walkr' \(did you mean 'walker'\?\)"):
        load("walkr")
    with pytest.raises(ConfigError, match=r"there is no file .*missing.toml"):
        load(tmp_path / "missing.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("seed = = 3")
    with pytest.raises(ConfigError, match=r"broken.toml is not valid TOML: .*line 1"):
        load(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"cannot read .*broken.toml"):
        load(broken)


def test_settings_are_read_as_toml():
    pairs = ["seed=3", "encoding.rest_length=[0.8, 1.2]", "optimizer.type=random", "a = 'x'"]
    expected = {
        "seed": 3,
        "encoding.rest_length": [0.8, 1.2],
        "optimizer.type": "random",
        "a": "x",
    }
    assert parse_settings(pairs) == expected
    with pytest.raises(ConfigError, match="--set takes KEY=VALUE"):
        parse_settings(["seed"])


def test_another_kind_of_a_section_starts_from_its_defaults():
    config = load("cube", {"optimizer.tournament": 7})
    assert config.optimizer.tournament == 7
    assert load("cube", {"optimizer.type": "random"}).optimizer.model_dump() == {"type": "random"}
