"""The scenes of the accuracy benchmark, each with the truth it is judged by.

A truth is a closed form wherever there is one, otherwise the motion found by ``accuracy_truth`` or
an equilibrium found by Newton's method. All errors are in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from accuracy_bodies import (
    G,
    breathing_cube,
    breathing_lattice,
    cantilever,
    inchworm,
    pair,
    plate,
    slinky,
    tumbling_cube,
)
from accuracy_truth import rest, solve

import warp_springs as ws

__all__ = ["CASES", "Case", "Truth"]

WEIGHTLESS = ws.Scene(gravity=(0.0, 0.0, 0.0), ground=None)
#: Siblings start up to so much higher [m], spread by the golden section.
LIFT, GOLDEN = 0.05, (math.sqrt(5.0) - 1.0) / 2.0
SMOOTH = ws.Ground(stiffness=1e5, static_friction=0.0, kinetic_friction=0.0)


@dataclass(frozen=True)
class Truth:
    """What the measurements of a scene's robots should give.

    Attributes:
        values: The measurement of each robot that is judged, shape (R, ...).
        uncertainty: Error of the values themselves [m], an estimate from above.
        source: Where they come from.
    """

    values: np.ndarray
    uncertainty: float
    source: str


def positions(result: ws.Result, robot: int) -> np.ndarray:
    """Positions of a robot [m], shape (M, 3)."""
    return result.positions(robot)


@dataclass(frozen=True)
class Case:
    """A scene to measure errors in.

    Attributes:
        title: What it is, a few words.
        robot: The robot.
        scene: Its world.
        duration: Simulated time [s].
        find: Computes the truth.
        scale: The length that errors are compared with [m].
        of: What that length is.
        fraction: Part of it that an error may be, for a step to be recommended.
        measure: What is compared with the truth, of a result's robot.
        tolerance: Local tolerance of the solver, if it finds the truth.
        judged: How many robots of the batch are judged. The error of one that hits the ground
            depends on where within a step it does; the median of several does not.
    """

    title: str
    robot: ws.Robot
    scene: ws.Scene
    duration: float
    find: Callable[[Case], Truth]
    scale: float
    of: str
    fraction: float = 1e-3
    measure: Callable[[ws.Result, int], np.ndarray] = positions
    tolerance: float = 1e-11
    judged: int = 1

    @property
    def target(self) -> float:
        """Error that a recommended step stays below [m]."""
        return self.fraction * self.scale

    @property
    def features(self) -> str:
        """What the kernels compute, in words."""
        scene, friction = self.scene, self.scene.ground and self.scene.ground.has_friction
        present = {
            "ground": scene.ground,
            "Coulomb friction": friction,
            "damping": scene.damping,
            "drag": scene.drag,
            "actuation": self.robot.is_actuated,
        }
        return ", ".join(name for name, on in present.items() if on) or "springs only"

    def truth(self) -> Truth:
        """What the measurement should give."""
        return self.find(self)

    def batch(self, robots: int) -> ws.Variants:
        """The scene's robot and its siblings, which start a little higher, ever another height.

        Those that share a vector register then do not all touch the ground at once.
        """
        lifts = (np.arange(robots) * GOLDEN % 1.0) * (LIFT if self.scene.ground else 0.0)
        starts = np.repeat(self.robot.positions[None], robots, axis=0)
        starts[:, :, 2] += lifts[:, None]
        return self.robot.variants(positions=starts)

    def errors(self, result: ws.Result, truth: Truth) -> np.ndarray:
        """Roots of the mean squared errors of the robots [m], (R,); infinite if it was stopped."""
        errors = [self.measure(result, i) - value for i, value in enumerate(truth.values)]
        sizes = np.array([np.sqrt(np.mean(error**2)) for error in errors])
        return np.where(result.status[: len(sizes)] == ws.Status.OK, sizes, np.inf)


# Truths.


def solved(case: Case, measure: Callable[[np.ndarray], np.ndarray] = np.asarray) -> Truth:
    """Truth by the solver; ``measure`` takes positions (M, 3).

    Its uncertainty is what a tolerance ten times larger changes.
    """

    def one(robot: ws.Robot, tolerance: float) -> np.ndarray:
        return measure(solve(robot, case.scene, case.duration, tolerance).positions)

    values = np.array([one(robot, case.tolerance) for robot in case.batch(case.judged)])
    uncertainty = np.abs(values[0] - one(case.robot, 10 * case.tolerance)).max()
    return Truth(values, float(uncertainty), "event-driven Runge-Kutta 8")


def closed_form(value: np.ndarray) -> Truth:
    """Truth by a formula, good to rounding."""
    return Truth(value[None], 1e-15, "closed form")


def oscillation(case: Case) -> Truth:
    """Two masses about their common centre: the stretch is a cosine."""
    robot, (m1, m2) = case.robot, case.robot.masses
    frequency = np.sqrt(robot.stiffness[0] * (1 / m1 + 1 / m2))
    stretch = robot.lengths[0] - robot.rest_length[0]
    shortening = stretch * (1 - np.cos(frequency * case.duration))
    x = robot.positions.copy()
    x[:, 0] += shortening * np.array([m2, -m1]) / (m1 + m2)
    return closed_form(x)


def released_chain(case: Case) -> Truth:
    """A vertical chain in free fall: a sum of its normal modes about a parabola.

    Along a line the law of a spring is linear, so the heights obey M z'' = -K z + f.
    """
    robot = case.robot
    n, k = robot.n_masses, robot.stiffness[0]
    strain = np.diff(np.eye(n), axis=0)
    root = np.sqrt(robot.masses)
    squares, modes = np.linalg.eigh(k * strain.T @ strain / np.outer(root, root))
    frequencies = np.sqrt(np.clip(squares, 0.0, None))
    slack = np.concatenate([[0.0], -np.cumsum(robot.rest_length)])  # heights without stretch
    start = modes.T @ (root * (robot.positions[:, 2] - slack))
    swing = modes @ (start * np.cos(frequencies * case.duration)) / root
    x = robot.positions.copy()
    x[:, 2] = slack + swing - G * case.duration**2 / 2
    return closed_form(x)


def braked_distance(case: Case) -> Truth:
    """v^2 / (2 mu g) along the start velocity."""
    velocity = case.robot.velocities[0]
    distance = velocity @ velocity / (2 * case.scene.ground.kinetic_friction * G)
    return closed_form(velocity[:2] / np.linalg.norm(velocity) * distance)


def fall_with_drag(case: Case) -> Truth:
    """From rest: v_t^2 / g ln cosh(g t / v_t) deep, with v_t^2 = m g / c."""
    square = case.robot.masses[0] * G / case.scene.drag
    depth = square / G * np.log(np.cosh(G * case.duration / np.sqrt(square)))
    return closed_form(case.robot.positions - [0.0, 0.0, depth])


def sagging(case: Case) -> Truth:
    """Height of the tip at rest."""
    x, remaining = rest(case.robot, case.scene)
    return Truth(_tip(x)[None], remaining, "equilibrium by Newton's method")


def walked(case: Case) -> Truth:
    """Distance that the centre of mass has gone."""
    return solved(case, lambda x: _center(case.robot, x)[:2] - case.robot.center_of_mass[:2])


# Measurements.


def travelled(result: ws.Result, robot: int) -> np.ndarray:
    """Horizontal way of the centre of mass [m], shape (2,)."""
    return (result.center_of_mass[robot] - result.robots[robot].center_of_mass)[:2]


def tip(result: ws.Result, robot: int) -> np.ndarray:
    """Height of the masses at the end of the arm [m]."""
    return _tip(result.positions(robot))


def _tip(x: np.ndarray) -> np.ndarray:
    return x[-4:, 2]


def _center(robot: ws.Robot, x: np.ndarray) -> np.ndarray:
    return robot.masses @ x / robot.masses.sum()


# Scenes.


def _cases() -> dict[str, Case]:
    """All scenes, by name."""
    falling = ws.Scene(gravity=(0.0, 0.0, -G), ground=None)
    smooth = ws.Scene(ground=SMOOTH)
    sliding = ws.Scene(ground=ws.Ground(static_friction=0.4, kinetic_friction=0.3))
    settling = ws.Scene(ground=SMOOTH, damping=40.0)
    rubber = ws.Scene(ground=ws.Ground(static_friction=0.6, kinetic_friction=0.5), damping=10.0)
    wood = ws.Scene(ground=ws.Ground(static_friction=0.5, kinetic_friction=0.4), damping=20.0)
    cube = tumbling_cube()
    still_cube = cube.replace(velocities=np.zeros((8, 3)))
    return {
        "oscillator": Case(
            title="two masses on a spring",
            robot=pair(),
            scene=WEIGHTLESS,
            duration=0.5,
            find=oscillation,
            scale=0.01,
            of="the stretch",
        ),
        "free cube": Case(
            title="spinning cube in free fall",
            robot=cube,
            scene=falling,
            duration=0.2,
            find=solved,
            scale=0.1,
            of="an edge",
        ),
        "slinky": Case(
            title="hanging chain, let go",
            robot=slinky(),
            scene=falling,
            duration=0.2,
            find=released_chain,
            scale=0.05,
            of="a link",
        ),
        "drag": Case(
            title="cube falls against drag",
            robot=still_cube,
            scene=ws.Scene(ground=None, drag=0.05),
            duration=1.0,
            find=fall_with_drag,
            scale=0.1,
            of="an edge",
        ),
        "bouncing cube": Case(
            title="spinning, bouncing cube",
            robot=cube,
            scene=smooth,
            duration=0.5,
            find=solved,
            scale=0.1,
            of="an edge",
            judged=9,
        ),
        "lattice": Case(
            title="lattice lands on a corner",
            robot=breathing_lattice(),
            scene=smooth,
            duration=0.5,
            find=solved,
            scale=0.1,
            of="an edge",
            judged=9,
        ),
        "cantilever": Case(
            title="sag of a cantilever",
            robot=cantilever(),
            scene=settling,
            duration=0.8,
            find=sagging,
            scale=0.011,
            of="the sag",
            measure=tip,
        ),
        "slide": Case(
            title="sliding plate brakes",
            robot=plate(),
            scene=sliding,
            duration=0.5,
            find=braked_distance,
            scale=0.17,
            of="the way",
            measure=travelled,
        ),
        "breathing cube": Case(
            title="breathing cube slides and sticks",
            robot=breathing_cube(),
            scene=rubber,
            duration=0.4,
            find=solved,
            scale=0.1,
            of="an edge",
            fraction=1e-2,
            tolerance=1e-10,
        ),
        "walker": Case(
            title="way of a walking inchworm",
            robot=inchworm(),
            scene=wood,
            duration=1.0,
            find=walked,
            scale=0.0232,
            of="the way",
            fraction=1e-2,
            measure=travelled,
            tolerance=1e-10,
        ),
    }


CASES = _cases()
