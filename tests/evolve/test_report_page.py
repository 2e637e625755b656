"""The report of real runs: complete, true to the record, small, and readable from the disk."""

from __future__ import annotations

import csv
import sqlite3

import numpy as np
import pytest

from evolve.config import RunConfig
from evolve.errors import RunError
from evolve.record import Finalist, Record
from evolve.reports.comparison import groups
from evolve.reports.diversity import diversity
from evolve.reports.export import crown
from evolve.reports.findings import findings
from evolve.reports.page import write_report
from evolve.reports.parameters import parameters
from evolve.reports.plots import figure, performance
from evolve.reports.tables import write_table
from evolve.run import Run
from evolve.store import Store
from evolve.toml import load
from tests.chromium import Browser
from tests.evolve.conftest import TINY
from warp_springs.view.pages import exhibits


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> list[Run]:
    """Two seeds of a genetic search and one of random search; the first is crowned."""
    folder = tmp_path_factory.mktemp("runs")
    made = []
    for name, changes in {
        "one": {"seed": 1}, "two": {"seed": 2}, "chance": {"optimizer.type": "random"},
    }.items():  # fmt: skip
        run = Run.create(load("cube", TINY | {"task.measure": 3.0} | changes), folder / name)
        run.evolve()
        made.append(run)
    with Store.open(made[0].record_path, write=True) as store:
        crown(made[0], store)
    return made


@pytest.fixture(scope="module", autouse=True)
def small_films():
    """Films as a whole report has them, only of fewer and smaller pictures."""
    usual = exhibits.FILMS
    exhibits.FILMS = tuple((kind, (160, 90), 10.0) for kind, _, _ in usual)
    yield
    exhibits.FILMS = usual


@pytest.fixture(scope="module")
def written(runs, small_films):
    return write_report(runs, notes="We tried <b>everything</b>.\n\nIt walked.")[0]


@pytest.fixture(scope="module")
def page(written):
    with Browser() as browser:
        yield browser.open(written.as_uri(), size=(1100, 1400))


def words(page) -> str:
    return page.evaluate("document.body.innerText")


def test_it_opens_from_the_disk_without_network_or_complaint(page, written):
    page.picture()
    assert page.requests == [written.as_uri()]
    assert page.complaints == []
    assert written.stat().st_size < 5_000_000
    broken = "[...document.images].filter(i => !i.naturalWidth).length"
    assert page.evaluate(broken) == 0
    targets = page.evaluate("[...document.querySelectorAll('table a')].map(a => a.href)")
    assert len(targets) >= 2 and all(_exists(target) for target in targets)


def _exists(url: str) -> bool:
    from pathlib import Path
    from urllib.parse import unquote, urlparse

    return Path(unquote(urlparse(url).path)).is_file()


def test_the_films_and_the_page_are_in_it(page, runs):
    films = page.evaluate("document.querySelectorAll('video, img[src*=webp]').length")
    assert films >= 4, "the best, the best side by side, the best dropped, the zoo"
    assert "dropped from as high as it is long" in words(page)
    lengths = page.evaluate("[...document.querySelectorAll('video')].map(v => v.duration)")
    three = 3.0 * runs[0].config.encoding.period
    assert all(length == pytest.approx(three, abs=0.1) for length in lengths), "three cycles"
    inner = page.evaluate("document.querySelector('iframe').srcdoc")
    assert "webgl2" in inner and page.evaluate("document.querySelectorAll('svg').length") >= 10


def test_a_stranger_learns_what_was_evolved_and_how_to_make_it_again(page, runs):
    text = words(page)
    with runs[0].read() as store:
        finalists, digest, record = store.finalists(), store.digest(), store.record()
    assert f"#{finalists[0].id}" in text and f"{finalists[0].fitness:.3f}" in text
    assert "96\nevaluations" in text and digest in text
    assert "genetic over direct genomes" in text and "body diameters per cycle" in text
    assert "evolve run one/run.toml --out again" in text
    assert "evolve report one two chance" in text
    assert "We tried <b>everything</b>." in text and "It walked." in text
    assert f"the best of all {np.nanmax(record.fitness):.3f}" in text


def test_every_parameter_is_told(page, runs):
    text = words(page)
    told = list(parameters(runs[0].config))
    for name, value, meaning in told:
        assert name in text and value in text and meaning in text
    flat = _leaves(runs[0].config.model_dump())
    assert {name for name, _, _ in told} >= set(flat)


def _leaves(data, prefix=""):
    for key, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key


def test_what_a_parameter_means_is_read_from_the_configuration():
    told = {name: (value, meaning) for name, value, meaning in parameters(load("walker"))}
    assert told["task.settle"] == ("1", "How long they move before they are measured [cycles].")
    assert told["simulation.threads"][0] == "not set"
    assert told["scene.gravity"][0] == "[0, 0, -9.81]"


def test_seeds_are_averaged_and_others_compared(runs):
    first, chance = groups(runs)
    assert (first.label, chance.label) == ("genetic", "random")
    assert [seed.config.seed for seed in first.seeds] == [1, 2]
    curve = first.curve()
    best = np.array([np.fmax.accumulate(seed.record.fitness) for seed in first.seeds])
    np.testing.assert_allclose(curve.mean, best.mean(axis=0)[curve.evaluations - 1])
    error = np.abs(best[0] - best[1]) / 2.0  # of two values: their distance / 2
    np.testing.assert_allclose(curve.error, error[curve.evaluations - 1], atol=1e-15)
    assert np.isnan(chance.curve().error).all(), "one seed has no error"


def test_the_comparison_is_in_the_report(page, runs):
    rows = page.evaluate("[...document.querySelectorAll('tr')].map(r => r.innerText)")
    mean = np.mean([seed.best for seed in groups(runs)[0].seeds])
    row = next(r for r in rows if r.startswith("genetic\t2\t"))
    assert f"{mean:.3f}" in row.split("\t")


def test_a_report_is_the_same_again(runs, written):
    before = written.read_bytes()
    write_report(runs, notes="We tried <b>everything</b>.\n\nIt walked.")
    assert written.read_bytes() == before


def test_diversity_falls_when_everybody_is_alike(runs, tmp_path):
    found = diversity(runs[0])
    assert found.evaluations.tolist() == [24, 48, 72, 96]
    assert found.genotype[0] == pytest.approx(1.0, abs=0.15), "unrelated at first"
    assert found.genotype[-1] < found.genotype[0]
    again = diversity(runs[0])
    np.testing.assert_array_equal(found.behaviour, again.behaviour)
    encoding = runs[0].config.make_encoding()
    copy = tmp_path / "run"
    copy.mkdir()
    for name in ("run.toml", "run.sqlite"):
        (copy / name).write_bytes((runs[0].directory / name).read_bytes())
    with sqlite3.connect(copy / "run.sqlite") as connection:
        one = encoding.to_bytes(encoding.random(1, np.random.Generator(np.random.Philox(1))))[0]
        connection.execute("UPDATE individual SET genome = ? WHERE generation = 2", (one,))
        connection.execute(
            "UPDATE descriptor SET height = 1, displacement_x = 1, displacement_y = 1 "
            "WHERE individual IN (SELECT id FROM individual WHERE generation = 2)"
        )
    alike = diversity(Run.open(copy))
    assert alike.genotype[2] == 0.0 and alike.behaviour[2] == 0.0
    assert alike.genotype[1] == found.genotype[1]


def test_a_table_of_the_record_has_everybody_and_their_parents(runs, tmp_path):
    path = write_table(runs[0], tmp_path / "record.csv")
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    with runs[0].read() as store:
        record = store.record()
        scores = store.scores(record.ids)
    assert [int(row["id"]) for row in rows] == record.ids.tolist()
    fitness = [float(row["fitness"]) if row["fitness"] else np.nan for row in rows]
    np.testing.assert_array_equal(fitness, record.fitness)
    np.testing.assert_array_equal([float(r["height"]) for r in rows], scores.descriptors["height"])
    with sqlite3.connect(runs[0].record_path) as connection:
        parents = {(c, p): i for c, p, i in connection.execute("SELECT * FROM parent")}
    assert parents
    for row in rows:
        for place in (0, 1):
            expected = parents.get((int(row["id"]), place), "")
            assert row[f"parent_{place + 1}"] == str(expected)


def test_performance_is_drawn_against_its_cost(runs):
    with runs[0].read() as store:
        record, costs = store.record(), store.costs()
        springs, *_ = store.totals()
    ax = performance(figure().subplots(), record, costs)
    line = ax.lines[0]
    assert line.get_xdata()[-1] * 1e9 == pytest.approx(springs)
    np.testing.assert_allclose(
        line.get_ydata(), np.fmax.accumulate(record.fitness)[[23, 47, 71, 95]]
    )


def test_findings_name_exploits_and_failures():
    fitness = np.concatenate([np.full(50, 0.1), np.full(50, 0.5)])
    status = np.zeros(100, int)
    status[:10] = 1
    fitness[:10] = np.nan
    record = Record(np.arange(1, 101), np.repeat([0, 1], 50), fitness, status)
    cheat = Finalist(9, 1, 0.5, 1e-4, 0.05, 0.1, 0.45, 0.9, False)
    lucky = Finalist(8, 1, 0.5, 1e-4, 0.49, 0.98, 0.1, 0.2, False)
    text = " ".join(findings(record, [cheat, lucky], [], "m"))
    assert "the best of all 0.500 m" in text
    assert "10 of 100 robots (10.0%)" in text and "20.0% in the first half" in text
    assert "1 lost more at half the time step" in text and "1 from perturbed starts" in text


def test_a_run_that_has_not_begun_is_refused(tmp_path, tiny: RunConfig):
    run = Run.create(tiny, tmp_path / "run")
    run.evolve(should_stop=lambda: True)
    with pytest.raises(RunError, match="no complete generation yet"):
        write_report([run])


def test_the_shell_writes_it(shell, tmp_path):
    Run.create(load("cube", {"population": 1, "generations": 1}), tmp_path / "lone").evolve()
    notes, out = tmp_path / "notes.txt", tmp_path / "a report.html"
    notes.write_text("Feet help.")
    done = shell("report", "lone", "--notes", notes, "--out", out)
    assert done.returncode == 0, done.stderr
    text = out.read_text()
    assert str(out) in done.stdout and "Feet help." in text
    assert "not looked at twice yet" in text
    assert 'href="lone/run.toml"' in text, "links lead to the run"
    missing = shell("report", tmp_path / "nothing")
    assert missing.returncode == 1 and "nothing" in missing.stderr
