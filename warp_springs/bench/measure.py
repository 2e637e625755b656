"""Check a case against the independent reference, and only then time it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from warp_springs.bench.cases import Case, choices
from warp_springs.bench.populations import DT, different, scene_of, variants
from warp_springs.reference import Trial
from warp_springs.robot import Robot
from warp_springs.simulation import Simulation
from warp_springs.stability import Status

__all__ = ["ALLOWED", "CHECKED_STEPS", "Row", "measure"]

#: Steps until the check: robots have landed, and slide or stick.
CHECKED_STEPS = 150
#: How far masses may be from the reference [m]. Where numbers are shorter than float64, a mass near
#: the stick limit may flip a step earlier: there the typical mass must agree, not every one.
ALLOWED = {"float64": 1e-10}
ALLOWED_SHORTER = 1e-6


@dataclass
class Row:
    """What was measured of a case.

    Attributes:
        case: The case.
        springs: Springs of the first robot.
        error: Distance from the reference [m]: the largest in float64, else the median.
        first_use: Seconds to pack the robots and take the first step, which may compile.
        rates: Spring evaluations per second of each round; none if the case is wrong or failed.
        wrong: What is wrong with it, if anything.
        missing: Why it cannot run here, if it cannot.
        pace: Steps a second, when last timed.
    """

    case: Case
    springs: int = 0
    error: float = np.nan
    first_use: float = np.nan
    rates: list[float] = field(default_factory=list)
    wrong: str = ""
    missing: str = ""
    pace: float = np.nan

    @property
    def allowed(self) -> float:
        """The largest error that counts as right [m]."""
        return ALLOWED.get(self.case.precision, ALLOWED_SHORTER)

    @property
    def rate(self) -> float:
        """Spring evaluations per second, the median over the rounds."""
        return float(np.median(self.rates)) if self.rates else np.nan


def measure(
    cases: Sequence[Case], rounds: int, seconds: float, say: Callable[[str], None]
) -> list[Row]:
    """Check all cases, then time the right ones in turns, so that they share any disturbance.

    Args:
        cases: The cases.
        rounds: Times that each is timed.
        seconds: How long, about, each time.
        say: Called with what is being done.
    """
    rows, ready = [Row(case) for case in cases], []
    for row in rows:
        say(f"checking {describe(row.case)}")
        simulation = _checked(row)
        if simulation is not None:
            _time(row, simulation, seconds / 4)  # to know the pace without the first calls
            ready.append((row, simulation))
    for row, _ in ready:
        row.rates.clear()
    for turn in range(rounds):
        for row, simulation in ready:
            say(f"timing {describe(row.case)}, round {turn + 1} of {rounds}")
            if not row.wrong:
                _time(row, simulation, seconds)
    for row in rows:
        if row.wrong:
            row.rates.clear()
    return rows


def describe(case: Case) -> str:
    """A case in a few words."""
    kind = "" if case.alike else "different "
    return f"{case.robots:,} {kind}{case.body}s, {case.precision}, {case.threads} threads"


def _checked(row: Row) -> Simulation | None:
    """A simulation of the case that agrees with the reference; else the row says why not."""
    case = row.case
    robots = (variants if case.alike else different)(case.body, case.robots, case.features)
    row.springs = robots[0].n_springs
    start = time.perf_counter()
    try:
        simulation = Simulation(
            robots,
            scene_of(case.features),
            DT,
            device=case.device,
            precision=case.precision,
            integrator=case.integrator,
            threads=case.threads,
            **({"layout": case.layout} if choices("layout") else {}),
        )
        result = simulation.run(DT)
        row.first_use = time.perf_counter() - start
        start = time.perf_counter()
        result = simulation.run((CHECKED_STEPS - 1) * DT)
        row.pace = (CHECKED_STEPS - 1) / (time.perf_counter() - start)
    except (NotImplementedError, RuntimeError, ValueError) as error:
        row.missing = str(error)
        return None
    row.error = _error(case, robots, simulation, result)
    if not row.error <= row.allowed:
        row.wrong = f"wrong by {row.error:.1e} m, allowed {row.allowed:.0e} m"
    _check_status(row, result)
    return None if row.wrong else simulation


def _error(case: Case, robots: Sequence[Robot], simulation: Simulation, result) -> float:
    """How far the masses of the first, the middle and the last robot are from the reference [m]."""
    scene, substeps = scene_of(case.features), simulation.contact_substeps
    differences = []
    for index in sorted({0, case.robots // 2, case.robots - 1}):
        key = case.body, case.alike, index, case.features, case.integrator, int(substeps[index])
        if key not in _REFERENCES:
            trial = Trial(robots[index], scene, DT, case.integrator, int(substeps[index]))
            for _ in range(CHECKED_STEPS):
                trial.step()
            _REFERENCES[key] = trial.positions
        differences.append(np.linalg.norm(result.positions(index) - _REFERENCES[key], axis=1))
    every = np.concatenate(differences)
    return float(every.max() if case.precision == "float64" else np.median(every))


#: Where the reference puts the masses of a robot, shape (M, 3), for every case that asked.
_REFERENCES: dict[tuple, np.ndarray] = {}


def _check_status(row: Row, result) -> None:
    stopped = np.flatnonzero(result.status != Status.OK)
    if len(stopped):
        state = Status(int(result.status[stopped[0]])).name
        row.wrong = f"{len(stopped)} robots were stopped, robot {stopped[0]} with {state}"


def _time(row: Row, simulation: Simulation, seconds: float) -> None:
    """Step for about so many seconds."""
    steps = max(1, round(row.pace * seconds))
    start = time.perf_counter()
    result = simulation.run(steps * DT)
    spent = time.perf_counter() - start
    row.pace = steps / spent
    row.rates.append(result.spring_evaluations / spent)
    _check_status(row, result)
