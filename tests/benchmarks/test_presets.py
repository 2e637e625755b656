"""The table of the presets: what it shows is what a search finds."""

import presets

from evolve import Evaluator, Search, load


def test_the_table_shows_start_and_champion_of_a_search(capsys):
    presets.main(["--only", "cube", "--seconds", "0.01"])
    row = capsys.readouterr().out.splitlines()[-1].strip("| ").split(" | ")
    search = Search(load("cube"))
    generation = search.step()
    assert row[:2] == ["cube", "speed [body diameters per cycle]"]
    assert row[2] == f"{search.optimizer.best_fitness:.3f}" and row[4] == "1"
    fitness = generation.scores.fitness
    (place,) = [i for i, value in enumerate(fitness) if f"{value:.3f}" == row[3]][:1]
    robot = search.encoding.express(generation.candidates.genomes)[place]
    look = Evaluator(search.config).second_look([robot], fitness[place : place + 1])
    assert row[6:8] == [f"{look.halved_kept[0]:.0%}", f"{look.perturbed_kept[0]:.0%}"]
    assert row[8] == "yes" and look.survives[0]
