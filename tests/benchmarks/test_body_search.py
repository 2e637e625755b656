"""The comparison of body searches with fixed bodies: equal terms, a table, and a picture."""

from __future__ import annotations

import body_search

from evolve.run import open_all
from evolve.toml import load


def test_all_searches_are_on_equal_terms():
    for preset, changes in body_search.SEARCHES.values():
        config = load(preset, {**changes, **body_search.COMMON})
        assert config.population * config.generations == 96 * 32
        assert (config.encoding.period, config.encoding.amplitude) == (1.0, 0.2)
        assert (config.task.fitness, config.task.measure) == ("steady", 4.0)
        assert (config.scene.damping, config.simulation.dt) == (4.0, 1e-3)


def test_a_search_is_run_once_and_told_and_drawn(tmp_path, monkeypatch, capsys):
    out, picture = tmp_path / "out", tmp_path / "curves.png"
    words = ["body_search", "--only", "walker, operators", "creature from walker", "--seeds", "2"]
    words += ["--population", "8", "--generations", "2", "--out", str(out), "--draw", str(picture)]
    words += ["--gains"]
    monkeypatch.setattr("sys.argv", words)
    body_search.main()
    first = [line.rpartition("|")[0] or line for line in capsys.readouterr().out.splitlines()]
    assert "| walker, operators | fixed | 16 | 2 |" in first[2]
    assert "| creature from walker | evolves | 16 | 2 |" in first[3]
    assert " with a parent's body: " in first[4]
    assert picture.stat().st_size > 10_000
    kept = open_all(out / "walker-operators")
    topologies = set()
    for run in kept:
        with run.read() as store:
            genomes = store.genomes(store.record().ids.tolist())
        encoding = run.config.make_encoding()
        topologies |= {r.topology for r in encoding.express(encoding.from_bytes(genomes))}
    assert len(topologies) == 1, "its body stays as it is"
    body_search.main()
    again = [line.rpartition("|")[0] or line for line in capsys.readouterr().out.splitlines()]
    assert again == first
