"""Fitness: what robots are selected for and described by, read off the results of their trial.

A measure is a function of a `Trial` that gives one number for each robot::

    @measure("m")
    def rise(trial):
        return trial.measured.center_of_mass[:, 2]

Its name can stand as `task.fitness` of a run's configuration (higher is better), among
`task.descriptors`, and among the objectives of an optimizer. A measure need not look at the status:
whoever was stopped gets no fitness whatever it says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import warp_springs as ws

__all__ = ["FITNESS", "UNITS", "Measure", "Trial", "body_diameters", "measure", "omegas"]

SAMPLES_PER_CYCLE = 20
"""How often a measure that needs the path sees the centre of mass."""

LEAST_WALK = 0.01
"""Speed [body diameters per cycle] up to which a robot stands still, as far as economy goes."""


@dataclass(frozen=True)
class Trial:
    """What was seen of N robots: they settle first, then they are measured."""

    robots: Sequence[ws.Robot]
    settled: ws.Result
    """At the end of the settling time, where the measurement starts."""
    pieces: Sequence[ws.Result]
    """The measurement, in one piece or in several that follow each other."""
    direction: tuple[float, float] = (1.0, 0.0)
    """Where forward is: a vector over the ground of length one."""
    goal: tuple[float, float, float] | None = None
    """Where the goal is at time 0 [m]."""
    motion: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """How it moves [m/s]."""

    @property
    def measured(self) -> ws.Result:
        """At the end of the measurement."""
        return self.pieces[-1]

    @property
    def displacement(self) -> np.ndarray:
        """Way of the centre of mass during the measurement [m], shape (N, 3)."""
        return self.measured.center_of_mass - self.settled.center_of_mass

    @property
    def path(self) -> np.ndarray:
        """Centre of mass at the start and after each of K pieces [m], shape (N, K + 1, 3)."""
        return np.stack([r.center_of_mass for r in (self.settled, *self.pieces)], axis=1)

    @property
    def gap(self) -> np.ndarray:
        """Distance over the ground to the goal at the times of `path` [m], shape (N, K + 1)."""
        times = np.array([r.end_time for r in (self.settled, *self.pieces)])
        goal = np.asarray(self.goal) + times[:, None] * np.asarray(self.motion)
        way = self.path[:, :, :2] - goal[:, :2]
        return np.hypot(way[..., 0], way[..., 1])

    @property
    def work(self) -> np.ndarray:
        """Net work of the breathing springs during the measurement [J], shape (N,)."""
        return sum(piece.energy.work[:, -1] for piece in self.pieces)

    @property
    def given_up(self) -> np.ndarray:
        """What a robot has less at the end of the measurement than at its start [J], shape (N,).

        No less than its kinetic energy at the start: the momentum carries it on.
        """
        first, last = self.pieces[0].energy, self.pieces[-1].energy
        return np.maximum(first.total[:, 0] - last.total[:, -1], first.kinetic[:, 0])

    @property
    def duration(self) -> float:
        """Length of the measurement [s]."""
        return self.measured.end_time - self.settled.end_time

    @property
    def cycles(self) -> np.ndarray:
        """Actuation cycles in the measurement, shape (N,)."""
        return np.abs(omegas(self.robots)) * self.duration / (2.0 * np.pi)


@dataclass(frozen=True)
class Measure:
    """A figure of every robot of a trial, and what must be recorded to know it."""

    function: Callable[[Trial], np.ndarray]
    unit: str
    needs_path: bool
    needs_energy: bool
    needs_goal: bool = False

    def __call__(self, trial: Trial) -> np.ndarray:
        """The figure of each robot, shape (N,)."""
        return np.asarray(self.function(trial), np.float64)

    @property
    def about(self) -> str:
        """What it is, in a line."""
        return (self.function.__doc__ or "").partition("\n")[0]


FITNESS: dict[str, Measure] = {}
"""Name in the configuration -> measure."""

UNITS: dict[str, str] = {}
"""What the figures of each measure are measured in, for plots and reports."""


def measure(
    unit: str, path: bool = False, energy: bool = False, goal: bool = False
) -> Callable[[Callable[[Trial], np.ndarray]], Measure]:
    """Register a function of a trial under its name.

    Args:
        unit: Of its figures.
        path: Whether it reads `Trial.path` between its ends: `SAMPLES_PER_CYCLE` pieces a cycle.
        energy: Whether it reads `Trial.work`, or energies of the results.
        goal: Whether it reads `Trial.goal`.
    """

    def register(function: Callable[[Trial], np.ndarray]) -> Measure:
        found = Measure(function, unit, path, energy, goal)
        FITNESS[function.__name__] = found
        UNITS[function.__name__] = unit
        return found

    return register


@measure("body diameters per cycle")
def speed(trial: Trial) -> np.ndarray:
    """Speed over the ground in body diameters per actuation cycle, in any direction.

    The net horizontal distance of the centre of mass, divided by the largest distance between two
    masses of the body at rest and by the number of cycles 2 pi / omega that it took. A robot that
    does not cycle (omega = 0) has speed 0.
    """
    return _per_diameter_and_cycle(distance(trial), trial)


@measure("body diameters per cycle")
def forward(trial: Trial) -> np.ndarray:
    """Speed along `task.direction` in body diameters per actuation cycle; negative backwards."""
    way = trial.displacement[:, :2]
    along = way[:, 0] * trial.direction[0] + way[:, 1] * trial.direction[1]
    return _per_diameter_and_cycle(along, trial)


@measure("body diameters per cycle", path=True)
def steady(trial: Trial) -> np.ndarray:
    """Speed in the slower half of the measurement: who falls over once does not fall again.

    As `speed`, of twice the shorter of the two ways in the two halves; way that the second half
    takes back does not count.
    """
    path = trial.path[:, :, :2]
    middle = path.shape[1] // 2
    ways = [path[:, middle] - path[:, 0], path[:, -1] - path[:, middle]]
    halves = np.minimum(*(np.linalg.norm(way, axis=1) for way in ways))
    return _per_diameter_and_cycle(np.minimum(2.0 * halves, distance(trial)), trial)


@measure("m")
def distance(trial: Trial) -> np.ndarray:
    """Net distance of the centre of mass over the ground, straight from start to end."""
    return np.hypot(trial.displacement[:, 0], trial.displacement[:, 1])


@measure("m", path=True)
def jump(trial: Trial) -> np.ndarray:
    """Highest rise of the centre of mass above where it was after settling."""
    height = trial.path[:, :, 2]
    return height.max(axis=1) - height[:, 0]


@measure("m/J", energy=True)
def economy(trial: Trial) -> np.ndarray:
    """Net distance for every joule that the springs worked, or that the robot had and gave up.

    Zero for who hardly moves: muscles that breathe by a nanometre spend next to nothing, and any
    rounding of the way would make them champions; and who falls over pays with the fall.
    """
    way, work = distance(trial), np.abs(trial.work)
    walks = (_per_diameter_and_cycle(way, trial) > LEAST_WALK) & (work > 0.0)
    return np.divide(way, work + trial.given_up, out=np.zeros_like(way), where=walks)


@measure("J", energy=True)
def energy(trial: Trial) -> np.ndarray:
    """Net work of the breathing springs."""
    return np.abs(trial.work)


@measure("m/s^2", path=True)
def smoothness(trial: Trial) -> np.ndarray:
    """Less is rougher: minus the rms acceleration of the centre of mass, a twentieth of a cycle."""
    interval = trial.duration / len(trial.pieces)
    acceleration = np.diff(trial.path, n=2, axis=1) / interval**2
    return -np.sqrt((acceleration**2).sum(axis=2).mean(axis=1))


@measure("", path=True)
def straightness(trial: Trial) -> np.ndarray:
    """Net distance over the ground divided by the length of the way: 1 is straight."""
    steps = np.linalg.norm(np.diff(trial.path[:, :, :2], axis=1), axis=2).sum(axis=1)
    return np.divide(distance(trial), steps, out=np.zeros_like(steps), where=steps > 0.0)


@measure("m", goal=True)
def approach(trial: Trial) -> np.ndarray:
    """How much nearer to the goal the centre of mass comes, over the ground."""
    gap = trial.gap
    return gap[:, 0] - gap[:, -1]


@measure("of the lamp's light", path=True, goal=True)
def brightness(trial: Trial) -> np.ndarray:
    """Mean level of the light of a lamp above the goal: 1 under it, one half a metre away."""
    return (1.0 / (1.0 + trial.gap**2)).mean(axis=1)


@measure("of the lamp's light", goal=True)
def light(trial: Trial) -> np.ndarray:
    """Level of the light of a lamp at the goal on the brightest mass at the end: 1 at the lamp.

    One half a metre away from it, in any direction.
    """
    end = trial.measured
    lamp = np.asarray(trial.goal) + end.end_time * np.asarray(trial.motion)
    gaps = [np.linalg.norm(end.positions(i) - lamp, axis=1).min() for i in range(len(end))]
    return 1.0 / (1.0 + np.square(gaps))


@measure("m")
def displacement_x(trial: Trial) -> np.ndarray:
    """Way of the centre of mass along x."""
    return trial.displacement[:, 0]


@measure("m")
def displacement_y(trial: Trial) -> np.ndarray:
    """Way of the centre of mass along y."""
    return trial.displacement[:, 1]


@measure("m")
def height(trial: Trial) -> np.ndarray:
    """Height of the centre of mass at the end."""
    return trial.measured.center_of_mass[:, 2]


@measure("kg")
def mass(trial: Trial) -> np.ndarray:
    """Mass of the body."""
    import warp_springs as ws

    robots = trial.robots
    if isinstance(robots, ws.Variants):
        return robots.array("masses").sum(axis=1)
    return np.array([robot.mass for robot in robots])


@measure("m")
def diameter(trial: Trial) -> np.ndarray:
    """Largest distance between two masses of the body at rest."""
    return body_diameters(trial.robots)


@measure("springs")
def springs(trial: Trial) -> np.ndarray:
    """Number of springs of the body."""
    return np.array([float(robot.n_springs) for robot in trial.robots])


@measure("springs")
def muscles(trial: Trial) -> np.ndarray:
    """Number of springs of the body that breathe."""
    return np.array([float(np.count_nonzero(robot.amplitude)) for robot in trial.robots])


@measure("")
def symmetry(trial: Trial) -> np.ndarray:
    """How far the body is its own mirror image, left and right or front and back: 1 is wholly.

    One minus twice the mean distance from the mirror image of a mass, in the plane through the
    centre of mass across x or across y, to the nearest mass, in body diameters; the better plane
    counts.
    """
    return np.array([_symmetry(robot) for robot in trial.robots])


@measure("", path=True)
def footfall(trial: Trial) -> np.ndarray:
    """Share of the time that a foot stands on the ground z = 0, on average.

    Feet are the masses that touch it at one of the sampled instants. 1 crawls, a runner is below
    one half; 0 has no feet.
    """
    return np.array([_duty(trial, i) for i in range(len(trial.robots))])


def _duty(trial: Trial, robot: int) -> float:
    """Mean share of the sampled instants at which a foot of a robot is down."""
    down = np.mean([piece.positions(robot)[:, 2] <= 0.0 for piece in trial.pieces], axis=0)
    return float(down[down > 0.0].mean()) if down.any() else 0.0


def _symmetry(robot: ws.Robot) -> float:
    places = robot.positions - robot.center_of_mass
    found = [0.0]
    for axis in (0, 1):
        image = places.copy()
        image[:, axis] *= -1.0
        gap = np.linalg.norm(image[:, None] - places[None], axis=2).min(axis=1).mean()
        found.append(1.0 - 2.0 * float(gap) / max(robot.diameter, 1e-12))
    return max(found)


def omegas(robots: Sequence[ws.Robot]) -> np.ndarray:
    """Angular frequency of every robot's actuation [rad/s], shape (N,)."""
    import warp_springs as ws

    if isinstance(robots, ws.Variants):
        return robots.array("omega")
    return np.array([robot.omega for robot in robots])


def body_diameters(robots: Sequence[ws.Robot]) -> np.ndarray:
    """Largest distance between two masses of every robot as it was built [m], shape (N,)."""
    import warp_springs as ws

    if isinstance(robots, ws.Variants) and "positions" not in robots.stacked:
        return np.full(len(robots), robots.body.diameter)
    return np.array([robot.diameter for robot in robots])


def _per_diameter_and_cycle(way: np.ndarray, trial: Trial) -> np.ndarray:
    lengths, cycles = way / body_diameters(trial.robots), trial.cycles
    return np.divide(lengths, cycles, out=np.zeros_like(lengths), where=cycles > 0.0)
