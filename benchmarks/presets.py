"""How far the packaged presets come in two minutes: python benchmarks/presets.py

For each preset the best fitness of its first generation, that of its champion after so many seconds
or all its generations, and how long that took, kernels loaded before. The champion is the fittest
of the best 32 that survives the second look, or the fittest of all if none does; the last columns
tell what is left of its fitness at half the time step in float64, and in the median from perturbed
starts. `--seconds 20` for a glance, `--only worm,snake` for some of them.
"""

from __future__ import annotations

import argparse
import time

from search import finish

import warp_springs as ws
from evolve import Evaluator, Search, load, preset_names
from evolve.fitness import UNITS
from evolve.judging.worlds import looked_at_again

COLUMNS = (
    *("preset", "fitness", "start", "champion", "generations", "seconds"),
    *("half dt, float64", "perturbed", "survives"),
)


def progress(preset: str, seconds: float) -> tuple[str, ...]:
    """Evolve a preset for so long; a row of the table."""
    config = load(preset)
    search = Search(config)
    try:
        search.prepare()
        started = time.perf_counter()
        best = finish(search, config.task.second_look.candidates, seconds)
        spent = time.perf_counter() - started
    finally:
        search.close()
    look = looked_at_again(Evaluator(config), search.encoding, best.genomes, best.fitness)
    champion, measure = int(look.survives.argmax()), config.task.fitness
    return (
        preset,
        f"{measure} [{UNITS[measure]}]",
        f"{best.first:.3f}",
        f"{best.fitness[champion]:.3f}",
        str(search.optimizer.generation),
        f"{spent:.0f}",
        f"{look.halved_kept[champion]:.0%}",
        f"{look.perturbed_kept[champion]:.0%}",
        "yes" if look.survives[champion] else "no",
    )


def main(arguments: list[str] | None = None) -> None:
    """Print the table as Markdown, row by row."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=120.0, help="for each preset")
    parser.add_argument("--only", default="", help="names of presets, with commas between")
    options = parser.parse_args(arguments)
    ws.quiet()
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for preset in options.only.split(",") if options.only else preset_names():
        print(f"| {' | '.join(progress(preset, options.seconds))} |", flush=True)


if __name__ == "__main__":
    main()
