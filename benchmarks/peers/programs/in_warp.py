"""Warp as everybody writes it first: two kernels a step, forces by atomic additions."""

import numpy as np
import two_kernels
import warp

import warp_springs as ws
from peers.problem import Problem
from peers.programs.in_warp_springs import robots_of, scene_of

__all__ = ["PROGRAMS", "WarpKernels", "versions"]


class WarpKernels:
    """The program of ``benchmarks/two_kernels.py``, which knows the classroom's world only."""

    most_threads = 1

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        ws.quiet()
        if scene_of(problem) != two_kernels.SCENE or problem.dt != two_kernels.DT:
            raise ValueError("two_kernels.py steps the classroom's world only")
        self._program = two_kernels.TwoKernels(robots_of(problem), precision)

    def run(self, steps: int) -> None:
        """Step all robots."""
        self._program.run(steps)

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self._program.positions().astype(np.float64)


PROGRAMS = {"Warp, two kernels": WarpKernels}


def versions() -> dict[str, str]:
    """The version of Warp."""
    return {"warp-lang": warp.config.version}
