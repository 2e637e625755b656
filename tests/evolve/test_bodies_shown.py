"""The zoo of a run that evolves bodies shows different robots, not siblings."""

from __future__ import annotations

import numpy as np

from evolve.reports.bodies import shown, spread_out, various
from evolve.reports.export import crown
from evolve.run import Run
from evolve.store import Store
from evolve.toml import load


def closest(store: Store, ids) -> float:
    """Distance of the two of these that are most alike, in springs and symmetry."""
    found = store.scores(ids).descriptors
    values = np.stack([found["springs"] / 50.0, found["symmetry"] / 0.1], axis=1)
    apart = np.linalg.norm(values[:, None] - values, axis=2)
    return float(apart[~np.eye(len(ids), dtype=bool)].min())


def test_rows_far_apart():
    line = np.array([[0.0], [0.1], [10.0], [9.9], [5.0]])
    assert spread_out(line, 3).tolist() == [0, 2, 4]
    assert spread_out(np.zeros((3, 2)), 9).tolist() == [0, 1, 2]


def test_the_zoo_differs_by_descriptors(tmp_path):
    config = load("blueprint", {"population": 96, "generations": 3, "task.measure": 2.0})
    run = Run.create(config, tmp_path / "run")
    run.evolve()
    with Store.open(run.record_path, write=True) as store:
        chosen, best = various(run, store, 6), store.best(6)
        assert chosen[0] == best[0] and len(set(chosen)) == 6
        assert closest(store, chosen) > closest(store, best)
        finalists = crown(run, store, 6)
        zoo = [one.id for one in shown(run, store, finalists, 6)]
        assert zoo[0] == finalists[0].id and len(set(zoo) & set(chosen)) >= 5
