"""How far the packaged presets come in two minutes: python benchmarks/presets.py

For each preset the best fitness of its first generation, the best after so many seconds or all its
generations, and how long that took, kernels loaded before. `--seconds 20` for a glance,
`--only worm,snake` for some of them.
"""

from __future__ import annotations

import argparse
import time

import warp_springs as ws
from evolve import Search, load, preset_names
from evolve.fitness import UNITS

COLUMNS = ("preset", "fitness", "start", "end", "generations", "seconds")


def progress(preset: str, seconds: float) -> tuple[str, ...]:
    """Evolve a preset for so long; a row of the table."""
    config = load(preset)
    search = Search(config)
    try:
        search.prepare()
        started = time.perf_counter()
        search.step()
        first = search.optimizer.best_fitness
        while not search.finished and time.perf_counter() - started < seconds:
            search.step()
        spent = time.perf_counter() - started
    finally:
        search.close()
    measure = config.task.fitness
    return (
        preset,
        f"{measure} [{UNITS[measure]}]",
        f"{first:.3f}",
        f"{search.optimizer.best_fitness:.3f}",
        str(search.optimizer.generation),
        f"{spent:.0f}",
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
