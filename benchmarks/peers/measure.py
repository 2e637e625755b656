"""Check, then time: the same population in every program, in turns."""

import dataclasses
import functools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from peers.fleet import Fleet, Program
from peers.problem import Problem
from peers.programs.in_numpy import NumPy

__all__ = ["ALLOWED", "CHECKED_STEPS", "FEATURES", "Row", "Truth", "compare"]

FEATURES = "ground, classroom friction, damping, actuation; symplectic Euler, dt 1e-4 s"
#: Steps until the check: robots land after 100, and slide or stick.
CHECKED_STEPS = 200
#: How far centers of mass may be from the truth [m]. In float32 a mass near the stick limit may
#: flip a step earlier, so the typical robot must agree, in float64 every one.
ALLOWED = {"float64": 1e-10, "float32": 1e-6}


@dataclass
class Row:
    """What was measured of one program.

    Attributes:
        program: Which, with its threads.
        precision: Its precision.
        error: How far centers of mass are from NumPy's in float64 [m]: the largest in float64, the
            median in float32; in free flight where the program's physics differs.
        strays: Median distance of centers of mass from NumPy's in the timed scene [m].
        first_use: Seconds until the first step was done: making and compiling.
        rates: Springs per second of each round; none where the program is wrong or failed.
        failure: Why there are no rates.
        pace: Steps a second when last timed.
    """

    program: Program
    precision: str
    error: float = np.nan
    strays: float = np.nan
    first_use: float = np.nan
    rates: Sequence[float] = ()
    failure: str = ""
    pace: float = np.nan

    @property
    def rate(self) -> float:
        """Springs per second, the median over the rounds."""
        return float(np.median(self.rates)) if len(self.rates) else np.nan

    def times_faster(self, other: "Row") -> float:
        """The median over the rounds of this rate over the other's."""
        if not len(self.rates) or not len(other.rates):
            return np.nan
        return float(np.median(np.divide(self.rates, other.rates)))


class Truth:
    """Where NumPy in float64 puts the centers of mass (N, 3) after some steps.

    Args:
        problem: The population.
        steps: After how many steps.
    """

    def __init__(self, problem: Problem, steps: int) -> None:
        self.problem, self.steps = problem, steps
        self.free = dataclasses.replace(problem, ground_stiffness=0.0, keep=1.0)

    @functools.cached_property
    def in_scene(self) -> np.ndarray:
        """In the scene that is timed."""
        return _centers(self.problem, self.steps)

    @functools.cached_property
    def in_flight(self) -> np.ndarray:
        """Without ground and damping, where the programs with other physics agree too."""
        return _centers(self.free, self.steps)


def _centers(problem: Problem, steps: int) -> np.ndarray:
    program = NumPy(problem, "float64", 1)
    program.run(steps)
    return problem.center_of_mass(program.positions())


def compare(
    fleet: Fleet,
    truth: Truth,
    precision: str,
    rounds: int,
    seconds: float,
    say: Callable[[str], None],
) -> list[Row]:
    """A row for each program: checked against the truth, then timed for ``seconds`` a round."""
    rows = [Row(p, precision) for p in fleet.programs if precision in p.precisions]
    with tempfile.TemporaryDirectory() as folder:
        scene, flying = Path(folder, "scene.npz"), Path(folder, "free.npz")
        truth.problem.save(scene)
        truth.free.save(flying)
        for row in rows:
            say(f"checking {row.program.name} on {row.program.threads}")
            try:
                if row.program.differs:
                    _check(fleet, row, flying, truth.in_flight, truth.steps)
                _check(fleet, row, scene, truth.in_scene, truth.steps)
                _time(fleet, row, 0.1)  # warm, at the pace without the first calls
            except RuntimeError as error:
                row.failure = str(error)
        _race(fleet, [row for row in rows if not row.failure], truth.problem, rounds, seconds, say)
    fleet.drop()
    return rows


def _check(fleet: Fleet, row: Row, scene: Path, truth: np.ndarray, steps: int) -> None:
    """Make the program, run it and compare with the truth."""
    ask, program = fleet.ask, row.program
    made = ask(program, "make", precision=row.precision, problem=str(scene))
    if np.isnan(row.first_use):
        row.first_use = made["seconds"]
    row.pace = (steps - 1) / ask(program, "run", steps=steps - 1)["seconds"]
    out = scene.with_suffix(".npy")
    ask(program, "centers", out=str(out))
    wrong = np.linalg.norm(np.load(out) - truth, axis=1)
    row.strays = float(np.median(wrong))
    if not np.isnan(row.error):
        return  # already judged in free flight
    row.error = float(wrong.max()) if row.precision == "float64" else row.strays
    if not row.error < ALLOWED[row.precision]:
        raise RuntimeError(f"wrong by {row.error:.1e} m")


def _time(fleet: Fleet, row: Row, seconds: float) -> None:
    """Step for about so many seconds, and note the pace."""
    steps = max(1, round(row.pace * seconds))
    steps = -(-steps // 20) * 20 if steps > 20 else steps  # whole graphs
    row.pace = steps / fleet.ask(row.program, "run", steps=steps)["seconds"]


def _race(fleet, rows: list[Row], problem: Problem, rounds: int, seconds: float, say) -> None:
    """Time all in turns, so that they share whatever disturbs the machine."""
    work = problem.n_robots * problem.n_springs
    for row in rows:
        row.rates = []
    for turn in range(rounds):
        say(f"round {turn + 1} of {rounds}")
        for row in rows:
            if row.failure:
                continue
            try:
                _time(fleet, row, seconds)
                row.rates.append(work * row.pace)
            except RuntimeError as error:
                row.failure, row.rates = str(error), []
