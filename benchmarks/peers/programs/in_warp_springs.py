"""warp_springs itself, in its own integrator for this physics."""

import numpy as np
import warp

import warp_springs as ws
from peers.problem import Problem

__all__ = ["PROGRAMS", "WarpSprings", "robots_of", "scene_of", "versions"]


class WarpSprings:
    """One batch of robots that share a topology."""

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        ws.quiet()
        self._problem = problem
        self._simulation = ws.Simulation(
            robots_of(problem),
            scene_of(problem),
            problem.dt,
            precision=precision,
            integrator="euler",
            threads=threads,
        )
        self._result = None

    def run(self, steps: int) -> None:
        """Step all robots."""
        self._result = self._simulation.run(steps * self._problem.dt)

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return np.array([self._result.positions(i) for i in range(self._problem.n_robots)])


def robots_of(problem: Problem) -> ws.Variants:
    """The population as variants of its first robot."""
    names = ("masses", "positions", "velocities", "stiffness", "rest_length", "amplitude", "phase")
    arrays = {name: getattr(problem, name) for name in names}
    body = ws.Robot(springs=problem.springs, **{name: array[0] for name, array in arrays.items()})
    return body.variants(omega=problem.omega, **arrays)


def scene_of(problem: Problem) -> ws.Scene:
    """The world of a problem."""
    ground = None
    if problem.ground_stiffness:
        ground = ws.Ground(
            stiffness=problem.ground_stiffness,
            static_friction=problem.static_friction,
            kinetic_friction=problem.kinetic_friction,
            friction="course",
        )
    damping = ws.damping_rate(problem.keep, problem.dt)
    return ws.Scene(gravity=tuple(problem.gravity.tolist()), ground=ground, damping=damping)


PROGRAMS = {"warp_springs": WarpSprings}


def versions() -> dict[str, str]:
    """Versions of the package and of Warp."""
    return {"warp_springs": ws.__version__, "warp-lang": warp.config.version}
