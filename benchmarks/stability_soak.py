"""Soak: chunks of garbage with healthy robots between them, in every precision and step.

What must hold: nothing raises; a malformed robot is refused by its constructor; every other ends
with a Status or with a finite history within the reach of the speed limit; and every healthy robot
has the bits it has alone.
"""

import collections
import time
import traceback
import warnings
from dataclasses import dataclass, field

import numpy as np
from stability_garbage import garbage, healthy

import warp_springs as ws

__all__ = ["MODES", "WORLDS", "Report", "soak"]

CHUNK = 500
FRAMES = 5
CHECKED = 64  # steps between two looks at a robot's health
#: precision, step, simulated time [s]; every chunk runs in each of them.
MODES = (
    ("float64", 1e-4, 0.0256),
    ("float32", 1e-4, 0.0256),
    ("float64", "auto", 0.005),
    ("float32", "auto", 0.005),
)
#: integrator and world; chunks take turns.
WORLDS = (
    ("chin4", ws.Scene()),
    ("leapfrog", ws.Scene(damping=0.5, drag=0.01, ground=ws.Ground(friction="course"))),
    ("euler", ws.Scene()),
    ("chin4", ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)),
)


@dataclass
class Report:
    """What was counted.

    Attributes:
        garbage: Robots made.
        refused: Of them, refused by the constructor.
        statuses: (precision, step) -> name of the status -> robots.
        runs: Garbage robots simulated, over all modes.
        neighbours: Healthy robots compared with themselves alone.
        failures: What did not hold, in words.
        warnings: Warnings that escaped to the user, and how often.
        seconds: Time that it took.
    """

    garbage: int = 0
    refused: int = 0
    statuses: dict = field(default_factory=lambda: collections.defaultdict(collections.Counter))
    runs: int = 0
    neighbours: int = 0
    failures: list[str] = field(default_factory=list)
    warnings: collections.Counter = field(default_factory=collections.Counter)
    seconds: float = 0.0

    def summary(self) -> dict:
        """Everything, for JSON."""
        return {
            "garbage_robots": self.garbage,
            "refused_by_the_constructor": self.refused,
            "simulated_garbage_robots": self.runs,
            "statuses": {f"{p}, dt {dt}": dict(c) for (p, dt), c in self.statuses.items()},
            "healthy_robots_compared": self.neighbours,
            "failures": self.failures,
            "warnings": {str(key): count for key, count in self.warnings.items()},
            "seconds": self.seconds,
        }


def soak(count: int, seed: int = 0, progress=None) -> Report:
    """Make ``count`` garbage robots and simulate them in all modes."""
    report, alone, started = Report(), {}, time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for chunk, first in enumerate(range(0, count, CHUNK)):
            indices = range(first, min(first + CHUNK, count))
            robots, kinds = _make(seed, indices, report)
            integrator, scene = WORLDS[chunk % len(WORLDS)]
            for mode in MODES:
                _try(robots, kinds, mode, integrator, scene, alone, report)
            if progress is not None:
                progress((first + len(indices)) / count)
    for warning in caught:
        report.warnings[warning.category.__name__, str(warning.message)] += 1
    report.seconds = time.perf_counter() - started
    return report


def _make(seed: int, indices: range, report: Report) -> tuple[list[ws.Robot], list[str]]:
    """Garbage robots with a healthy one after every tenth, and their kinds."""
    neighbours, robots, kinds = healthy(), [], []
    for place, index in enumerate(indices):
        kind, robot = garbage(seed, index)
        report.garbage += 1
        report.refused += robot is None
        if (robot is None) != (kind == "malformed"):
            wrong = "refused" if robot is None else "not refused"
            report.failures.append(f"{kind} robot {index} was {wrong}")
        if robot is not None:
            robots.append(robot)
            kinds.append(f"{kind} robot {index}")
        if place % 10 == 0:
            robots.append(neighbours[place // 10 % len(neighbours)])
            kinds.append("healthy")
    return robots, kinds


def _try(robots, kinds, mode, integrator, scene, alone, report: Report) -> None:
    try:
        _run(robots, kinds, mode, integrator, scene, alone, report)
    except Exception:
        last = traceback.format_exc().splitlines()[-1]
        report.failures.append(f"{kinds[0]} and others, {mode[:2]}, {integrator}: {last}")


def _run(robots, kinds, mode, integrator, scene, alone, report: Report) -> None:
    precision, dt, duration = mode
    fps = FRAMES / duration

    def simulate(some: list[ws.Robot]) -> tuple[ws.Result, np.ndarray]:
        options = {"precision": precision, "integrator": integrator}
        simulation = ws.Simulation(some, scene, dt, **options)
        return simulation.run(duration, fps=fps), simulation.robot_dt

    key = mode, integrator, scene
    if key not in alone:
        alone[key] = [_bits(simulate([robot])[0], 0) for robot in healthy()]
    result, steps = simulate(robots)
    place = 0
    for i, (robot, kind) in enumerate(zip(robots, kinds, strict=True)):
        where = f"{kind}, {precision}, dt {dt}, {integrator}"
        if kind == "healthy":
            report.neighbours += 1
            if _bits(result, i) != alone[key][place % len(alone[key])]:
                report.failures.append(f"{where}: other bits than alone")
            place += 1
            continue
        status = ws.Status(result.status[i])
        report.runs += 1
        report.statuses[precision, dt][status.name] += 1
        if status != ws.Status.INVALID and not _bounded(robot, result, i, steps[i]):
            report.failures.append(f"{where}: {status.name}, and its history is not bounded")


def _bits(result: ws.Result, robot: int) -> tuple[bytes, ...]:
    parts = (
        result.frames(robot),
        result.positions(robot),
        result.velocities(robot),
        result.center_of_mass[robot],
        result.status[robot],
    )
    return tuple(np.asarray(part).tobytes() for part in parts)


def _bounded(robot: ws.Robot, result: ws.Result, index: int, step: float) -> bool:
    """Whether all that is shown is finite, and no mass went further than the speed limit lets it.

    The steps since the last look at its health count once more, and where a position is a large
    number, a thousandth of it is rounding.
    """
    frames, velocities = result.frames(index), result.velocities(index)
    if not (np.isfinite(frames).all() and np.isfinite(velocities).all()):
        return False
    reach = ws.Limits().speed * (result.end_time + CHECKED * step)
    with np.errstate(over="ignore"):
        way = np.linalg.norm(frames - robot.positions, axis=-1)
        return bool((way <= reach + 1e-3 * np.abs(robot.positions).max()).all())
