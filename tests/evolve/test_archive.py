"""The atlas of a run: the best of every kind, its heat map, and the zoo that is chosen from it."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from evolve.reports.archive import atlas, heat_map, niches
from evolve.reports.bodies import various
from evolve.reports.comparison import groups
from evolve.reports.diversity import diversity
from evolve.run import Run
from evolve.search import Search
from evolve.store import Store
from evolve.toml import load

GRID = {
    "population": 48,
    "generations": 4,
    "task.measure": 1.0,
    "optimizer": {
        "type": "map_elites",
        "descriptors": ["springs", "symmetry"],
        "bins": [8, 5],
        "lowest": [50.0, 0.5],
        "highest": [450.0, 1.0],
    },
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    found = Run.create(load("critter", GRID), tmp_path_factory.mktemp("atlas") / "run")
    assert found.evolve()
    return found


def test_the_atlas_holds_the_elites_of_the_optimizer(run):
    search = Search(run.config)
    with Store.open(run.record_path) as store:
        search.restore(store)
        found = atlas(run, store)
        elites = search.optimizer._survivors
        assert sorted(found.filled.tolist()) == sorted(elites.ids.tolist())
        cells = search.optimizer.cells(elites)
        np.testing.assert_array_equal(found.ids.ravel()[cells], elites.ids)
        np.testing.assert_array_equal(found.fitness.ravel()[cells], elites.scores.fitness)
        assert found.filled[0] == store.best(1)[0]
    assert found.coverage == pytest.approx(len(elites) / 40)


def test_the_heat_map_shows_every_cell(run):
    with Store.open(run.record_path) as store:
        found = atlas(run, store)
    ax = heat_map(Figure().subplots(), found, "steady", np.array([[60.0, 0.9], [900.0, 0.7]]))
    shown = np.ma.filled(ax.collections[0].get_array(), np.nan)
    np.testing.assert_array_equal(shown, found.fitness.T)
    assert [text.get_text() for text in ax.texts] == ["1", "2"]
    assert ax.texts[1].get_position() == (450.0, 0.7), "whoever is outside is in the last cell"
    assert ax.get_xlabel() == "springs" and ax.get_ylabel() == "symmetry"


def test_the_zoo_of_an_archive_is_of_its_elites(run):
    with Store.open(run.record_path) as store:
        zoo, found = various(run, store, 6), atlas(run, store)
    assert set(zoo) <= set(found.filled.tolist()) and zoo[0] == found.filled[0]
    places = {tuple(np.argwhere(found.ids == one)[0].tolist()) for one in zoo}
    assert len(places) == len(zoo) == 6


def test_bodies_have_an_atlas_without_an_archive_and_controllers_have_none(run, tmp_path):
    changes = {"population": 32, "generations": 2, "task.measure": 1.0}
    bodies = Run.create(load("critter", changes), tmp_path / "bodies")
    bodies.evolve()
    assert niches(bodies.config) == ("springs", "muscles", "symmetry")
    with Store.open(bodies.record_path) as store:
        found = atlas(bodies, store)
        worth = store.record().fitness
        table = store.descriptors(found.names)
        every = store.descriptors(["springs", "muscles", "symmetry"])
    alike = np.abs(np.corrcoef(every[np.isfinite(worth)].T))[0]
    assert found.names == ("springs", "muscles" if alike[1] < alike[2] else "symmetry")
    assert np.nanmax(found.fitness) == np.nanmax(worth)
    # Whoever is in a cell is the best of it, counted by hand.
    i, j = np.argwhere(found.ids == int(np.nanargmax(worth)) + 1)[0]
    edges = [np.append(edge[:-1], np.inf) for edge in found.edges]
    inside = (table[:, 0] >= edges[0][i]) & (table[:, 0] < edges[0][i + 1])
    inside &= (table[:, 1] >= edges[1][j]) & (table[:, 1] < edges[1][j + 1])
    assert found.fitness[i, j] == np.nanmax(worth[inside])
    controllers = Run.create(load("cube", changes), tmp_path / "controllers")
    controllers.evolve()
    with Store.open(controllers.record_path) as store:
        assert atlas(controllers, store) is None
    assert diversity(controllers).bodies is None
    evolving, fixed = groups([bodies, controllers])
    assert evolving.label.startswith("age fitness, voxels, bodies evolve")
    assert fixed.label.startswith("genetic, direct, fixed body")


def test_the_diversity_of_bodies(run):
    found = diversity(run)
    assert (found.bodies > 0.2).all() and (found.bodies <= 1.0).all()
    assert found.shape[0] > 0.3
