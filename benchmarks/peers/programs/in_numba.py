"""Numba: loops over one robot at a time, and robots as SIMD lanes by an expert."""

import numba
import numpy as np
from numba import njit, prange

from peers.lanes import Lanes
from peers.problem import Problem

__all__ = ["PROGRAMS", "NumbaLanes", "NumbaLoops", "versions"]


@njit(parallel=True)
def loop(x, v, f, m, ends, k, rest, amplitude, phase, omega, gravity, world, first, steps):
    """Step all robots, one after the other on each thread."""
    dt, keep, ground, static, kinetic = world
    for r in prange(len(x)):
        for n in range(first, first + steps):
            angle = omega[r] * x.dtype.type(n) * dt
            for s in range(len(ends)):
                i, j = ends[s]
                dx = x[r, j, 0] - x[r, i, 0]
                dy = x[r, j, 1] - x[r, i, 1]
                dz = x[r, j, 2] - x[r, i, 2]
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                long = length - rest[r, s] - amplitude[r, s] * np.sin(angle + phase[r, s])
                pull = k[r, s] * long / length
                f[r, i, 0] += pull * dx
                f[r, i, 1] += pull * dy
                f[r, i, 2] += pull * dz
                f[r, j, 0] -= pull * dx
                f[r, j, 1] -= pull * dy
                f[r, j, 2] -= pull * dz
            for i in range(x.shape[1]):
                for c in range(3):
                    f[r, i, c] += m[r, i] * gravity[c]
                z = x[r, i, 2]
                if ground > 0 and z < 0:
                    normal = -ground * z
                    along = np.sqrt(f[r, i, 0] ** 2 + f[r, i, 1] ** 2)
                    left = x.dtype.type(0)
                    if along < static * normal:
                        v[r, i, 0] = 0
                        v[r, i, 1] = 0
                    else:
                        left = max(left, x.dtype.type(1) - kinetic * normal / along)
                    f[r, i, 0] *= left
                    f[r, i, 1] *= left
                    f[r, i, 2] += normal
                for c in range(3):
                    v[r, i, c] = (v[r, i, c] + f[r, i, c] * (dt / m[r, i])) * keep
                    x[r, i, c] += v[r, i, c] * dt
                    f[r, i, c] = 0


class NumbaLoops:
    """The plain loops, compiled and shared out by ``prange``."""

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        numba.set_num_threads(threads)
        names = ("masses", "stiffness", "rest_length", "amplitude", "phase", "omega", "gravity")
        m, *springs, omega, gravity = (getattr(problem, name).astype(precision) for name in names)
        p, self.x = problem, problem.positions.astype(precision)
        numbers = (p.dt, p.keep, p.ground_stiffness, p.static_friction, p.kinetic_friction)
        world = tuple(np.dtype(precision).type(number) for number in numbers)
        v, f = problem.velocities.astype(precision), np.zeros_like(self.x)
        self._arguments = (self.x, v, f, m, p.springs, *springs, omega, gravity, world)
        self._steps = 0

    def run(self, steps: int) -> None:
        """Step all robots."""
        loop(*self._arguments, self._steps, steps)
        self._steps += steps

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self.x.astype(np.float64)


@njit(parallel=True, fastmath=True, error_model="numpy")
def lane_loop(x, v, f, kick, springs, rows, partners, wave, turn, fall, world, steps):
    """Step all groups; every innermost loop runs over robots and compiles to SIMD instructions."""
    width = x.shape[3]
    dt, keep, ground, static, kinetic = world
    zero, one = x.dtype.type(0), x.dtype.type(1)
    for g in prange(len(x)):
        for _ in range(steps):
            for i in range(x.shape[1]):
                xi, fi = x[g, i], f[g, i]
                for s in range(rows[i], rows[i + 1]):
                    xj, fj, c = x[g, partners[s]], f[g, partners[s]], springs[g, s]
                    for w in range(width):
                        dx, dy, dz = xj[0, w] - xi[0, w], xj[1, w] - xi[1, w], xj[2, w] - xi[2, w]
                        q = c[1, w] + c[2, w] * wave[g, 0, w] + c[3, w] * wave[g, 1, w]
                        pull = c[0, w] - q / np.sqrt(dx * dx + dy * dy + dz * dz)
                        fi[0, w] += pull * dx
                        fi[1, w] += pull * dy
                        fi[2, w] += pull * dz
                        fj[0, w] -= pull * dx
                        fj[1, w] -= pull * dy
                        fj[2, w] -= pull * dz
                vi = v[g, i]
                for w in range(width):
                    weight = kick[g, i, w]
                    ax = fi[0, w] * weight + fall[0]
                    ay = fi[1, w] * weight + fall[1]
                    push = ground * weight * max(-xi[2, w], zero)
                    along = np.sqrt(ax * ax + ay * ay)
                    sticks = along < static * push
                    left = max(one - kinetic * push / max(along, x.dtype.type(1e-30)), zero)
                    left = zero if sticks else left
                    hold = zero if sticks else keep
                    vi[0, w] = vi[0, w] * hold + ax * left
                    vi[1, w] = vi[1, w] * hold + ay * left
                    vi[2, w] = vi[2, w] * keep + fi[2, w] * weight + fall[2] + push
                    xi[0, w] += vi[0, w] * dt
                    xi[1, w] += vi[1, w] * dt
                    xi[2, w] += vi[2, w] * dt
                    fi[0, w] = fi[1, w] = fi[2, w] = zero
            for w in range(width):
                sine, cosine = wave[g, 0, w], wave[g, 1, w]
                wave[g, 0, w] = sine * turn[g, 1, w] + cosine * turn[g, 0, w]
                wave[g, 1, w] = cosine * turn[g, 1, w] - sine * turn[g, 0, w]


class NumbaLanes:
    """Robots as lanes, springs in rows, the sine split, all steps of a group in one go."""

    width = 128  # the best of 16, 32, 64, 128, 256

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        numba.set_num_threads(threads)
        self._lanes = lanes = Lanes.of(problem, precision, self.width)
        self._robots = problem.n_robots
        self._wave = np.empty_like(lanes.turn)
        self._steps = 0
        self._arguments = (lanes.x, lanes.v, np.zeros_like(lanes.x), lanes.kick, lanes.springs)
        self._arguments += (lanes.rows, lanes.partners, self._wave, lanes.turn, lanes.fall)
        self._arguments += (tuple(lanes.world),)

    def run(self, steps: int) -> None:
        """Step all robots."""
        self._wave[:] = self._lanes.wave(self._steps)
        lane_loop(*self._arguments, steps)
        self._steps += steps

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self._lanes.robots_first(self._lanes.x, self._robots)


PROGRAMS = {"Numba": NumbaLoops, "Numba lanes": NumbaLanes}


def versions() -> dict[str, str]:
    """The version of Numba."""
    return {"numba": numba.__version__}
