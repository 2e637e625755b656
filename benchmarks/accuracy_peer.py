"""What an accuracy costs the program everybody writes first, and what it costs here.

Two kernels a step, one thread a spring and one thread a mass, with atomics; symplectic Euler in
float64. Its spring kernel is that of ``two_kernels``; the ground here is smooth.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import warp as wp
from accuracy_measure import Row, Series, cost_of, evaluations, simulate
from accuracy_scenes import Case, Truth
from two_kernels import two_kernels

import warp_springs as ws

__all__ = ["Comparison", "TwoKernels", "compare"]

EULER = Series("euler", "float64", "none")
ROBOTS, STEPS = 1024, 100


@dataclass(frozen=True)
class Comparison:
    """Costs of one accuracy, ours against theirs; the last two as medians of paired rounds.

    Attributes:
        scene: Name of the scene.
        target: The accuracy, a root mean squared error [m].
        ours: The cheapest way here, in seconds.
        dt: Its step [s].
        error: Its error [m].
        their_dt: Step of symplectic Euler [s].
        their_error: Its error [m].
        difference: By how much the two programs differ when both take symplectic Euler [m].
        evaluations: Spring evaluations of one robot, ours and theirs.
        seconds: Wall time for one robot [s], ours and theirs.
        ratio: Theirs over ours, in seconds.
        threads: Cores that are used here; the two kernels use one.
    """

    scene: str
    target: float
    ours: Series
    dt: float
    error: float
    their_dt: float
    their_error: float
    difference: float
    evaluations: tuple[float, float]
    seconds: tuple[float, float]
    ratio: float
    threads: int


class TwoKernels:
    """Robots of one body on a smooth ground, stepped by the two kernels."""

    _kernels = None

    def __init__(self, robots: ws.Variants, scene: ws.Scene, dt: float) -> None:
        if TwoKernels._kernels is None:
            TwoKernels._kernels = _kernels()
        self._pull, self._move = TwoKernels._kernels
        body, count = robots.body, len(robots)
        self._shape = (count, body.n_masses, 3)
        self._omega, self._dt, self._step = body.omega, dt, 0
        ends = body.springs + body.n_masses * np.arange(count)[:, None, None]
        self._ends = wp.array(ends.reshape(-1, 2).astype(np.int32), dtype=wp.vec2i, device="cpu")
        names = ("stiffness", "rest_length", "amplitude", "phase")
        self._springs = [_device(robots.array(name), wp.float64) for name in names]
        self._mass = _device(robots.array("masses"), wp.float64)
        self._x = _device(robots.array("positions"), wp.vec3d)
        self._v = _device(robots.array("velocities"), wp.vec3d)
        self._force = wp.zeros_like(self._x)
        stiffness = scene.ground.stiffness if scene.ground else 0.0
        self._world = [wp.vec3d(*scene.gravity), wp.float64(stiffness), wp.float64(dt)]

    def run(self, steps: int) -> float:
        """Step, and return the seconds that it took."""
        started = time.perf_counter()
        for _ in range(steps):
            angle = self._step * self._dt * self._omega
            inputs = [self._x, self._ends, *self._springs, angle]
            wp.launch(self._pull, len(self._ends), inputs, [self._force], device="cpu")
            outputs = [self._x, self._v, self._force]
            wp.launch(self._move, len(self._x), [self._mass, *self._world], outputs, device="cpu")
            self._step += 1
        return time.perf_counter() - started

    def positions(self, robot: int) -> np.ndarray:
        """Positions of a robot [m], shape (M, 3)."""
        return self._x.numpy().reshape(self._shape)[robot]


def _device(values: np.ndarray, dtype) -> wp.array:
    flat = np.ascontiguousarray(values.reshape(-1, *values.shape[2:]), np.float64)
    return wp.array(flat, dtype=dtype, device="cpu")


def _kernels():
    """The kernel of the springs and the kernel of the masses."""
    pull, _, _ = two_kernels("float64")

    @wp.kernel(module="two_kernels_smooth", enable_backward=False)
    def move(
        mass: wp.array(dtype=wp.float64),
        gravity: wp.vec3d,
        ground_stiffness: wp.float64,
        dt: wp.float64,
        # state
        x: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        force: wp.array(dtype=wp.vec3d),
    ):
        i = wp.tid()
        p = x[i]
        f = force[i] + gravity * mass[i]
        if p[2] < wp.float64(0.0):
            f -= wp.vec3d(wp.float64(0.0), wp.float64(0.0), ground_stiffness * p[2])
        u = v[i] + f * (dt / mass[i])
        v[i] = u
        x[i] = p + u * dt
        force[i] = wp.vec3d()

    return pull, move


def compare(
    name: str, case: Case, truth: Truth, rows: Iterable[Row], target: float, rounds: int = 5
) -> Comparison | None:
    """Both at one accuracy, in turns; ``None`` if either does not reach it."""
    series: dict[Series, list[Row]] = {}
    for row in rows:
        series.setdefault(row.series, []).append(row)
    seconds = {way: cost_of(own, target, "seconds") for way, own in series.items()}
    reached = {way: cost for way, cost in seconds.items() if cost is not None}
    if EULER not in reached or len(reached) == 1:
        return None
    ours = min(reached.keys() - {EULER}, key=lambda way: (reached[way], str(way)))
    own_dt, own_error = _step(case, truth, ours, cost_of(series[ours], target), target)
    their_dt, their_error = _step(case, truth, EULER, cost_of(series[EULER], target), target)

    robots = case.batch(ROBOTS)
    theirs = TwoKernels(robots, case.scene, their_dt)
    theirs.run(1)
    share = round(case.duration / their_dt) / STEPS
    walls, threads = [], 1
    for _ in range(rounds):
        simulation = simulate(robots, case, ours, own_dt)
        own = simulation.run(case.duration).wall_time / ROBOTS
        walls.append((own, theirs.run(STEPS) * share / ROBOTS))
        threads = simulation.threads
    own_wall, their_wall = np.median(walls, axis=0)
    return Comparison(
        scene=name,
        target=target,
        ours=ours,
        dt=own_dt,
        error=own_error,
        their_dt=their_dt,
        their_error=their_error,
        difference=_difference(case),
        evaluations=(evaluations(case, ours, own_dt), evaluations(case, EULER, their_dt)),
        seconds=(float(own_wall), float(their_wall)),
        ratio=float(np.median([peer / own for own, peer in walls])),
        threads=threads,
    )


def _step(
    case: Case, truth: Truth, series: Series, cost: float, target: float
) -> tuple[float, float]:
    """The largest step with which a series reaches an error, and its error there.

    The search comes down from above the step that the curve promises, and the next smaller step
    must do as well: one alone may be luck.
    """
    dt = 1.4e-3 * evaluations(case, series, 1e-3) / cost
    robots, before = case.batch(len(truth.values)), None
    while True:
        dt = case.duration / round(case.duration / dt)
        result = simulate(robots, case, series, dt).run(case.duration)
        error = float(np.median(case.errors(result, truth)))
        if error <= target and before:
            return before
        before = (dt, error) if error <= target else None
        dt *= 0.93


def _difference(case: Case, dt: float = 1e-4, robots: int = 4) -> float:
    """Largest difference between our symplectic Euler and that of the two kernels [m]."""
    few = case.batch(robots)
    ours = simulate(few, case, EULER, dt).run(case.duration)
    theirs = TwoKernels(few, case.scene, dt)
    theirs.run(ours.steps)
    return max(float(np.abs(ours.positions(i) - theirs.positions(i)).max()) for i in range(robots))
