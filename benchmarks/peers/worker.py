"""One library's process: makes, checks and times programs as it is told, a JSON line at a time.

    python -m peers.worker LIBRARY THREADS

Reads requests from standard input and answers each with a line on standard output; whatever the
library itself prints goes to standard error.
"""

import importlib
import json
import os
import sys
import time

import numpy as np

from peers.problem import Problem

__all__ = ["Worker", "main"]


class Worker:
    """The programs of one library by name, and what can be asked of them."""

    def __init__(self, library: str, threads: int) -> None:
        self._module = importlib.import_module(f"peers.programs.in_{library}")
        self._threads = threads
        self._made = {}

    def describe(self) -> dict:
        """Which programs there are, and on what they stand."""
        programs = {
            name: {
                "most_threads": getattr(program, "most_threads", None),
                "precisions": getattr(program, "precisions", ("float32", "float64")),
                "differs": getattr(program, "differs", ""),
            }
            for name, program in self._module.PROGRAMS.items()
        }
        return {"programs": programs, "versions": self._module.versions()}

    def make(self, program: str, precision: str, problem: str) -> dict:
        """Make a program and take its first step, which may compile."""
        loaded = Problem.load(problem)
        start = time.perf_counter()
        made = self._module.PROGRAMS[program](loaded, precision, self._threads)
        made.run(1)
        self._made[program] = loaded, made
        return {"seconds": time.perf_counter() - start}

    def run(self, program: str, steps: int) -> dict:
        """Step and say how long it took."""
        start = time.perf_counter()
        self._made[program][1].run(steps)
        return {"seconds": time.perf_counter() - start}

    def centers(self, program: str, out: str) -> dict:
        """Write the centers of mass (N, 3) to a file."""
        problem, made = self._made[program]
        np.save(out, problem.center_of_mass(made.positions()))
        return {}

    def drop(self) -> dict:
        """Forget all programs that were made."""
        self._made.clear()
        return {}


def main() -> None:
    """Answer until the input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    library, threads = sys.argv[1], int(sys.argv[2])
    worker = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            worker = worker or Worker(library, threads)
            answer = getattr(worker, request.pop("do"))(**request)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
