"""Errors and costs of a scene for every integrator, precision and step."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from accuracy_scenes import Case, Truth

import warp_springs as ws

__all__ = [
    "Row",
    "Series",
    "cost_of",
    "evaluations",
    "recommended",
    "series_of",
    "simulate",
    "step_name",
    "sweep",
]

#: The steps that are tried [s], for every integrator.
STEPS = {
    "chin4": (4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5),
    "leapfrog": (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5),
    "euler": (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6),
}
QUICK_STEPS = {
    "chin4": (2e-3, 1e-3, 5e-4, 2e-4),
    "leapfrog": (2e-3, 1e-3, 5e-4, 2e-4, 1e-4),
    "euler": (1e-3, 5e-4, 2e-4, 1e-4, 5e-5),
}
#: Steps so small that one robot costs more spring evaluations are left out.
MOST_EVALUATIONS = 13_000_000
#: Runs that take longer than so many seconds are timed only so often.
LONG, LONG_ROUNDS = 0.1, 3
#: Robots in a batch: enough for spring evaluations worth a measurement, and whole bundles of lanes.
EVALUATIONS_WANTED, FEWEST, MOST = 10_000_000, 64, 1024


@dataclass(frozen=True)
class Series:
    """A way to step.

    Attributes:
        integrator: ``"chin4"``, ``"leapfrog"`` or ``"euler"``.
        precision: ``"float64"``, ``"float32"`` or ``"mixed"``.
        substeps: ``"chosen"`` contact sub-steps, ``"one"``, or ``"none"`` without a contact flow.
    """

    integrator: str
    precision: str
    substeps: str

    def __str__(self) -> str:
        one = ", one sub-step" if self.substeps == "one" else ""
        return f"{self.integrator} {self.precision}{one}"


@dataclass(frozen=True)
class Row:
    """Error and cost of one run.

    Attributes:
        scene: Name of the scene.
        series: How it was stepped.
        dt: Step [s].
        contact_substeps: Steps of the contact flow within a drift of the robot that is judged.
        error: Root of the mean squared error [m], the median over the robots that are judged;
            infinite if they were stopped.
        first_error: The same of the scene's own robot.
        evaluations: Spring evaluations of one robot.
        robots: Robots in the batch.
        seconds: Wall time for one robot of the batch [s], the median over the rounds.
    """

    scene: str
    series: Series
    dt: float
    contact_substeps: int
    error: float
    first_error: float
    evaluations: int
    robots: int
    seconds: float


def step_name(dt: float) -> str:
    """A step in the unit that suits it."""
    return f"{dt * 1e3:.3g} ms" if dt >= 1e-4 else f"{dt * 1e6:.3g} µs"


def series_of(case: Case) -> list[Series]:
    """The ways to step that differ in a scene."""
    contact = ("chosen", "one") if case.scene.ground else ("none",)
    ways = [(name, s) for name in ("chin4", "leapfrog") for s in contact] + [("euler", "none")]
    return [Series(name, real, s) for real in ("float64", "float32", "mixed") for name, s in ways]


def sweep(
    name: str,
    case: Case,
    truth: Truth,
    *,
    steps: dict[str, tuple[float, ...]] = STEPS,
    rounds: int = 5,
) -> tuple[list[Row], float]:
    """All rows of a scene, and the seconds that it took to compile its kernels.

    The rounds take all runs in turn, so that a busy moment of the machine meets all alike.
    """
    runs = [
        (series, dt)
        for series in series_of(case)
        for dt in steps[series.integrator]
        if evaluations(case, series, dt) <= MOST_EVALUATIONS
    ]
    started = time.perf_counter()
    for series in series_of(case):
        simulate(case.batch(FEWEST), case, series, 1e-3).run(1e-3)
    compiling = time.perf_counter() - started
    rows, walls = {}, {run: [] for run in runs}
    for number in range(rounds):
        for run in runs:
            if number >= LONG_ROUNDS and walls[run][0] * _robots(case, *run) > LONG:
                continue
            series, dt = run
            simulation = simulate(case.batch(_robots(case, series, dt)), case, series, dt)
            result = simulation.run(case.duration)
            walls[run].append(result.wall_time / len(result))
            if run not in rows:
                rows[run] = case.errors(result, truth), int(simulation.contact_substeps[0])
    return [
        Row(
            scene=name,
            series=series,
            dt=dt,
            contact_substeps=rows[series, dt][1],
            error=float(np.median(rows[series, dt][0])),
            first_error=float(rows[series, dt][0][0]),
            evaluations=evaluations(case, series, dt),
            robots=_robots(case, series, dt),
            seconds=float(np.median(walls[series, dt])),
        )
        for series, dt in runs
    ], compiling


def recommended(rows: Iterable[Row], target: float) -> Row | None:
    """The largest step of one series that is within an error, if any.

    The next smaller step must be so too: one alone may be luck.
    """
    rows = _from_coarse_to_fine(rows)
    place = _first_within(rows, target)
    return None if place is None else rows[place]


def cost_of(rows: Iterable[Row], target: float, cost: str = "evaluations") -> float | None:
    """What it costs one series to come within an error [m], or ``None`` if it does not.

    Between two steps cost and error follow a power law. A series that is good enough with its
    largest step costs no more than that.
    """
    rows = _from_coarse_to_fine(rows)
    place = _first_within(rows, target)
    if place is None:
        return None
    costs = [float(getattr(row, cost)) for row in rows]
    if place == 0 or math.isinf(rows[place - 1].error):
        return costs[place]
    errors = np.log([rows[place].error, rows[place - 1].error])
    return float(
        np.exp(np.interp(np.log(target), errors, np.log(costs[place - 1 : place + 1][::-1])))
    )


def _from_coarse_to_fine(rows: Iterable[Row]) -> list[Row]:
    return sorted(rows, key=lambda row: -row.dt)


def _first_within(rows: list[Row], target: float) -> int | None:
    """Index of the first row that is, like the next one, within an error."""
    within = [row.error <= target for row in rows]
    for place, good in enumerate(within):
        if good and all(within[place : place + 2]):
            return place
    return None


def simulate(
    robots: ws.Robot | ws.Variants, case: Case, series: Series, dt: float
) -> ws.Simulation:
    """A simulation of robots in the world of a scene."""
    return ws.Simulation(
        robots,
        case.scene,
        dt,
        precision=series.precision,
        integrator=series.integrator,
        contact_substeps=1 if series.substeps == "one" else None,
    )


def evaluations(case: Case, series: Series, dt: float) -> int:
    """Spring evaluations of one robot in a whole run."""
    passes = 3 if series.integrator == "chin4" else 1
    return passes * case.robot.n_springs * round(case.duration / dt)


def _robots(case: Case, series: Series, dt: float) -> int:
    wanted = EVALUATIONS_WANTED / evaluations(case, series, dt)
    return int(np.clip(-(-wanted // FEWEST) * FEWEST, FEWEST, MOST))
