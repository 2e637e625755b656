"""L-systems against the strings that textbooks give, and the bodies their turtle builds."""

from __future__ import annotations

import numpy as np
import pytest

from evolve.bodies.build import robot
from evolve.bodies.cells import BEND, LEFT, RIGHT, TIP, UP, Cells, Tissue
from evolve.bodies.lsystem import MOST_MOVES, Module, Production, build, rewrite
from evolve.encodings import ENCODINGS
from evolve.encodings.evolving import BodySettings

TISSUES = {"A": Tissue(swing=1.0, kind=BEND), "B": Tissue(swing=0.5, phase=0.25)}


def names(string) -> str:
    return "".join(module.symbol for module in string)


def test_algae_grow_as_lindenmayer_wrote():
    rules = {"A": Production.always("B"), "B": Production.always("A", "B")}
    grown = [names(rewrite([Module("A")], rules, n)) for n in range(6)]
    assert grown == ["A", "B", "AB", "BAB", "ABBAB", "BABABBAB"]


def test_parameters_are_handed_on_and_chance_chooses():
    first, second = (Module("A", phase=0.25, size=1.1),), (Module("B"),)
    rules = {"A": Production((0.25, 0.75), (first, second))}
    (child,) = rewrite([Module("A", phase=0.5)], rules, 2, lambda: 0.2)
    assert child.symbol == "A" and child.phase == 1.0 and child.size == pytest.approx(1.21)
    draws = np.random.Generator(np.random.Philox(1)).random(4000)
    share = np.mean([rules["A"].choose(draw) == second for draw in draws])
    assert share == pytest.approx(0.75, abs=0.03)


def test_a_string_that_explodes_stops_growing():
    rules = {"A": Production.always("A", "A")}
    assert len(rewrite([Module("A")], rules, 60, most=100)) == 64


def test_twins_are_mirror_images_and_bodies_are_closed():
    twins = [Module("{", amount=LEFT, phase=0.5), Module("B"), Module("^", amount=-0.7)]
    knee = [Module("+", amount=0.4), Module("B"), Module("]")]
    string = [Module("A"), *twins, *knee, Module("A")]
    cells = build(string, TISSUES, Cells(0.1, 10, 2.0))
    assert len(cells) == 6 and cells.parents.count(0) == 3
    made = robot(cells.plan(), BodySettings())
    assert made.n_masses == 8 + 4 * 5 and made.n_springs == 28 + 22 * 5
    assert len({tuple(sorted(pair)) for pair in made.springs.tolist()}) == made.n_springs
    # The twin of every point, and faces that enclose the body: each edge once in each direction.
    image = made.positions * [1.0, -1.0, 1.0]
    assert np.linalg.norm(image[:, None] - made.positions, axis=2).min(axis=1).max() < 1e-6
    edges = {(int(t[i]), int(t[(i + 1) % 3])) for t in made.faces for i in range(3)}
    assert edges == {(b, a) for a, b in edges} and made.volume > 0.0


@pytest.mark.parametrize("side, way", [(UP, (0, 0, 1)), (RIGHT, (0, -1, 0)), (TIP, (1, 0, 0))])
def test_sides_face_where_their_names_say(side, way):
    cells = Cells(0.1, 5, 1.0)
    cells.seed(TISSUES["A"])
    np.testing.assert_allclose(cells.side(0, side)[1], way, atol=1e-12)
    assert cells.grow(0, side, TISSUES["A"]) == 1
    assert cells.grow(0, side, TISSUES["A"]) is None, "something grew there"
    gap = cells.centres[1] - cells.centres[0]
    np.testing.assert_allclose(gap, 0.1 * np.array(way), atol=1e-12)


def test_twins_within_twins_do_not_stall():
    """They doubled the way of the turtle with each level: 2^60 moves."""
    string = [Module("A"), *[Module("{", amount=LEFT)] * 60]
    assert len(build(string, TISSUES, Cells(0.1, 500, 9.0))) == 1
    assert MOST_MOVES < 10_000


def test_a_bending_cell_pulls_above_while_it_pushes_below():
    cells = Cells(0.1, 1, 1.0)
    cells.seed(TISSUES["A"])
    plan = cells.plan()
    ends = plan.positions[plan.springs]
    rails = np.abs(np.ptp(ends[:, :, 0], axis=1) - plan.lengths) < 1e-6
    above = ends[:, :, 2].min(axis=1) > 0.0
    assert rails.sum() == 4 and (plan.genes[rails, 1] == 1.0).all()
    assert (plan.genes[rails & above, 2] == 0.0).all()
    assert (plan.genes[rails & ~above, 2] == 0.5).all()


def test_bodies_keep_to_their_limits():
    cls = ENCODINGS["lsystem"]
    encoding = cls(None, cls.Settings(most_springs=100, largest_extent=0.45))
    genomes = encoding.random(200, np.random.Generator(np.random.Philox(4)))
    robots = encoding.express(genomes)
    assert max(robot.n_springs for robot in robots) == 28 + 3 * 22
    assert max(np.ptp(robot.positions, axis=0).max() for robot in robots) <= 0.45 + 1e-6
