"""Variants: equal to the robots built one by one, and as strict."""

import pickle
from collections.abc import Sequence

import numpy as np
import pytest

from warp_springs.body.fields import FIELDS
from warp_springs.body.variants import STACKABLE, Variants
from warp_springs.robot import Robot
from warp_springs.shapes import lattice

N = 6
BODY = lattice(2, 1, 1).replace(omega=1.0)
M, S = BODY.n_masses, BODY.n_springs


def stack(seed=0):
    rng = np.random.default_rng(seed)
    return {
        "masses": rng.uniform(0.1, 1.0, (N, M)),
        "positions": BODY.positions + rng.normal(0.0, 0.01, (N, M, 3)),
        "velocities": rng.normal(size=(N, M, 3)),
        "stiffness": rng.uniform(100.0, 1000.0, (N, S)),
        "rest_length": rng.uniform(0.1, 0.2, (N, S)),
        "amplitude": rng.uniform(0.0, 0.01, (N, S)),
        "phase": rng.uniform(0.0, 6.0, (N, S)),
        "omega": rng.uniform(1.0, 9.0, N),
    }


def alone(i, fields):
    kept = {name: getattr(BODY, name) for name in FIELDS}
    return Robot(**(kept | {name: array[i] for name, array in fields.items()}))


@pytest.mark.parametrize("names", [STACKABLE, ("phase",), ("omega", "stiffness"), ("positions",)])
def test_variants_equal_robots_built_alone(names):
    fields = {name: array for name, array in stack().items() if name in names}
    variants = BODY.variants(**fields)
    assert isinstance(variants, Sequence)
    assert len(variants) == N
    assert list(variants) == [alone(i, fields) for i in range(N)]
    assert {robot.topology for robot in variants} == {BODY.topology}


def test_indices_and_slices():
    variants = BODY.variants(**stack())
    robots = list(variants)
    assert variants[-1] == robots[-1]
    assert variants[np.int64(2)] == robots[2]
    for part in (slice(1, 4), slice(None, None, -1), slice(0, 6, 2), slice(4, 4), slice(3, None)):
        assert isinstance(variants[part], Variants)
        assert list(variants[part]) == robots[part]
        assert len(variants[part]) == len(robots[part])
    assert robots[3] in variants
    assert variants.index(robots[3]) == 3
    for i in (N, -N - 1):
        with pytest.raises(IndexError, match=f"there are {N} variants"):
            variants[i]
    with pytest.raises(TypeError):
        variants[1.0]


def test_nothing_is_copied_on_the_way_to_a_robot():
    variants = BODY.variants(phase=stack()["phase"])
    assert np.shares_memory(variants[2].phase, variants.stacked["phase"])
    assert np.shares_memory(variants[1:][1].phase, variants.stacked["phase"])
    assert variants[2].springs is BODY.springs
    assert variants[2].positions is BODY.positions


def test_array_gives_every_field_of_all_robots():
    fields = {name: stack()[name] for name in ("phase", "omega")}
    variants = BODY.variants(**fields)
    for name in FIELDS.keys() - {"materials"}:
        array = variants.array(name)
        assert np.array_equal(array, [getattr(robot, name) for robot in variants])
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    assert np.shares_memory(variants.array("springs"), BODY.springs)
    with pytest.raises(ValueError, match="no field 'colour'"):
        variants.array("colour")
    with pytest.raises(ValueError, match="no array"):
        variants.array("materials")


def test_variants_are_immutable_copies():
    phase = stack()["phase"]
    variants = BODY.variants(phase=phase)
    first = phase[0, 0]
    phase[0, 0] = 99.0
    assert variants[0].phase[0] == first
    with pytest.raises(ValueError, match="read-only"):
        variants.stacked["phase"][0, 0] = 1.0
    with pytest.raises(TypeError):
        variants.stacked["phase"] = phase
    with pytest.raises(AttributeError, match="immutable"):
        variants.body = BODY


def test_pickle_and_repr():
    variants = BODY.variants(**stack())
    again = pickle.loads(pickle.dumps(variants))
    assert list(again) == list(variants)
    assert again.body == BODY
    assert repr(BODY.variants(omega=np.ones(3))).startswith("Variants(3 of Robot(12 masses")


def test_no_robots_are_an_empty_sequence():
    assert list(BODY.variants(omega=[])) == []
    assert BODY.variants(phase=np.zeros((0, S))).array("phase").shape == (0, S)


def changed(name, index, value):
    array = stack()[name]
    array[index] = value
    return {name: array}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (changed("stiffness", (3, 7), -1.0), r"stiffness\[3, 7\] = -1.0: .*greater than 0 \(N/m\)"),
        (changed("masses", (0, 2), 0.0), r"masses\[0, 2\] = 0.0"),
        (changed("phase", (5, 0), np.nan), r"phase\[5, 0\] = nan: must be finite"),
        (changed("positions", (1, 2, 0), np.inf), r"positions\[1, 2, 0\] = inf"),
        (changed("rest_length", (4, 4), -0.1), r"rest_length\[4, 4\] = -0.1: .*at least 0"),
        (changed("omega", 2, np.nan), r"omega\[2\] = nan"),
        ({"phase": np.zeros((N, S + 1))}, rf"phase: shape \(6, {S + 1}\) given, \(any, {S}\)"),
        ({"phase": np.zeros(S)}, rf"phase: shape \({S},\) given"),
        ({"omega": 3.0}, r"omega: shape \(\) given, \(any,\) expected"),
        ({"omega": np.ones(3), "phase": np.zeros((4, S))}, r"phase: shape \(4, 50\) .*\(3, 50\)"),
        ({}, "at least one stacked field of masses, positions"),
    ],
)
def test_malformed_stacks_are_refused_by_name(fields, message):
    with pytest.raises(ValueError, match=message):
        BODY.variants(**fields)


@pytest.mark.parametrize("name", ["springs", "faces", "colour"])
def test_what_cannot_differ_is_refused(name):
    with pytest.raises(TypeError, match=f"cannot stack '{name}'"):
        BODY.variants(**{name: np.zeros((N, 2))})
