"""The table of the presets: what it shows is what a search finds."""

from benchmarks import presets
from evolve import Search, load


def test_the_table_shows_start_and_end_of_a_search(capsys):
    presets.main(["--only", "cube", "--seconds", "0.01"])
    row = capsys.readouterr().out.splitlines()[-1].strip("| ").split(" | ")
    search = Search(load("cube"))
    search.step()
    assert row[:2] == ["cube", "speed [body diameters per cycle]"]
    assert row[2] == row[3] == f"{search.optimizer.best_fitness:.3f}"
    assert row[4] == "1"
