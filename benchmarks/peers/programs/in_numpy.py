"""NumPy, vectorised over robots and springs, as its users ordinarily write it."""

import numpy as np

from peers.problem import Problem

__all__ = ["PROGRAMS", "NumPy", "versions"]


class NumPy:
    """All robots at once in whole-array operations; forces are summed by an incidence matrix."""

    most_threads = 1

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        self.p, self.steps = problem, 0
        self.x = problem.positions.astype(precision)
        self.v = problem.velocities.astype(precision)
        names = ("masses", "stiffness", "rest_length", "amplitude", "phase")
        self.m, self.k, self.rest, self.amplitude, self.phase = (
            getattr(problem, name).astype(precision) for name in names
        )
        self.gravity = problem.gravity.astype(precision)
        self.incidence = np.zeros((problem.n_masses, problem.n_springs), precision)
        springs = np.arange(problem.n_springs)
        self.incidence[problem.springs[:, 0], springs] = 1.0
        self.incidence[problem.springs[:, 1], springs] = -1.0

    def run(self, steps: int) -> None:
        """Step all robots."""
        for _ in range(steps):
            self._step()

    def _step(self) -> None:
        p, x, v = self.p, self.x, self.v
        i, j = p.springs.T
        angle = p.omega[:, None] * (self.steps * p.dt)
        rest = self.rest + self.amplitude * np.sin(angle.astype(x.dtype) + self.phase)
        d = x[:, j] - x[:, i]
        length = np.sqrt((d * d).sum(axis=2))
        pulls = (self.k * (length - rest) / length)[:, :, None] * d
        force = self.incidence @ pulls + self.m[:, :, None] * self.gravity
        if p.ground_stiffness:
            self._touch(force)
        v += force / self.m[:, :, None] * p.dt
        v *= p.keep
        x += v * p.dt
        self.steps += 1

    def _touch(self, force: np.ndarray) -> None:
        """The ground and the classroom's friction, in place."""
        p, n, c = self.p, *np.nonzero(self.x[:, :, 2] < 0.0)
        normal = -p.ground_stiffness * self.x[n, c, 2]
        along = np.hypot(force[n, c, 0], force[n, c, 1])
        sticks = along < p.static_friction * normal
        keep = 1.0 - p.kinetic_friction * normal / np.where(sticks, 1.0, along)
        keep = np.where(sticks, 0.0, np.maximum(keep, 0.0))
        force[n, c, :2] *= keep[:, None]
        force[n, c, 2] += normal
        self.v[n[sticks], c[sticks], :2] = 0.0

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self.x.astype(np.float64)


PROGRAMS = {"NumPy": NumPy}


def versions() -> dict[str, str]:
    """The version of NumPy."""
    return {"numpy": np.__version__}
