"""The family of an individual, on a tree whose answer is known."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from evolve.record import Ancestor
from evolve.reports.family import family_tree, line, steps

EVERYBODY = [
    Ancestor(5, 3, 4.0, (4, 3)),
    Ancestor(4, 2, 2.0, (1, 2)),
    Ancestor(3, 2, np.nan, (2,)),
    Ancestor(2, 1, 3.0, ()),
    Ancestor(1, 1, np.nan, ()),
]


def test_the_line_follows_the_fitter_parent():
    assert [one.id for one in line(EVERYBODY)] == [2, 4, 5]
    assert [one.id for one in steps(line(EVERYBODY))] == [2, 5]


def test_the_tree_binds_everybody_to_its_parents():
    ax = family_tree(Figure().subplots(), EVERYBODY, "m")
    bonds = ax.collections[0].get_segments()
    assert len(bonds) == 5
    way = ax.lines[0].get_xydata()
    np.testing.assert_array_equal(way, [[1, 3.0], [2, 2.0], [3, 4.0]])
    assert ax.get_ylabel() == "fitness [m]"
