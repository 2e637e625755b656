"""Springs per second beside the hand-tuned limit of this processor.

    python benchmarks/peers/run.py [--robots 1024] [--threads 1 2]

Steps the same robots in C++ as a good programmer writes it, in C++ tuned to the limit, and in
warp_springs, in turns; prints rates, and how far the centers of mass differ from the plain program.
"""

import argparse
import time

import numpy as np
from populations import BODIES, problem_of, scene_of, variants
from programs import in_cpp, in_warp_springs

PROGRAMS = in_cpp.PROGRAMS | in_warp_springs.PROGRAMS
CHECKED_STEPS = 500  # 0.05 s: all have landed by then


def compare(body: str, precision: str, robots: int, threads: list[int], rounds: int) -> None:
    """Validate, then time all programs in turns; rates are medians over the rounds."""
    problem = problem_of(variants(body, robots), scene_of())
    keys = [(name, count) for count in threads for name in PROGRAMS]
    programs = {key: PROGRAMS[key[0]](problem, precision, key[1]) for key in keys}
    centers = {}
    for key, program in programs.items():
        program.run(CHECKED_STEPS)
        centers[key] = problem.center_of_mass(program.positions())
    rates = {key: [] for key in keys}
    work = problem.n_robots * problem.n_springs
    for _ in range(rounds):
        for key, program in programs.items():
            steps = max(1, int((2e6 if key[0] == "C++ plain" else 4e7) / work))
            start = time.perf_counter()
            program.run(steps)
            rates[key].append(work * steps / (time.perf_counter() - start))
    for name, count in keys:
        rate = np.median(rates[name, count])
        ratio = np.median(np.divide(rates[name, count], rates["C++ limit", count]))
        error = np.median(np.abs(centers[name, count] - centers["C++ plain", threads[0]]))
        print(
            f"{body:8} {precision} {count} threads {name:13} {rate / 1e6:6,.0f} M springs/s"
            f"  {ratio:.2f} of the limit  differs by {error:.0e} m",
            flush=True,
        )


def main() -> None:
    """Compare on cubes and lattices."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=1024)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--rounds", type=int, default=7)
    args = parser.parse_args()
    for body in BODIES:
        for precision in ("float64", "float32"):
            compare(body, precision, args.robots, args.threads, args.rounds)


if __name__ == "__main__":
    main()
