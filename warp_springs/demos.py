"""The classroom's demonstrations: small scenes that show the physics, each one command."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from warp_springs import shapes
from warp_springs.result import Result
from warp_springs.robot import Robot
from warp_springs.scene import Ground, Scene, damping_rate
from warp_springs.simulation import Simulation

__all__ = ["DEMOS", "Demo"]

FRAMES_PER_SECOND = 60


@dataclass(frozen=True)
class Demo:
    """A scene with its robots.

    Attributes:
        summary: What it shows, one line.
        robots: Makes the robots.
        scene: Their world.
        duration: Simulated time [s].
        dt: Step [s].
    """

    summary: str
    robots: Callable[[], Sequence[Robot]]
    scene: Scene
    duration: float
    dt: float = 5e-4

    def run(self, progress: Callable[[float], None] | None = None) -> Result:
        """Simulate it, with all frames and energies."""
        simulation = Simulation(self.robots(), self.scene, self.dt)
        return simulation.run(self.duration, fps=FRAMES_PER_SECOND, energy=True, progress=progress)

    def parameters(self) -> dict[str, object]:
        """Every parameter of the simulation and of its first robot."""
        robot = self.robots()[0]
        ranges = {
            name: _range(getattr(robot, name))
            for name in ("masses", "stiffness", "rest_length", "amplitude", "phase")
        }
        return {
            "robots": len(self.robots()),
            "masses per robot": robot.n_masses,
            "springs per robot": robot.n_springs,
            **{name.replace("_", " "): text for name, text in ranges.items()},
            "omega": f"{robot.omega:g} rad/s",
            **{f"scene {key}": value for key, value in asdict(self.scene).items()},
            "dt": f"{self.dt:g} s",
            "duration": f"{self.duration:g} s",
            "integrator": "chin4",
            "precision": "float64",
        }


UNITS = {"masses": "kg", "stiffness": "N/m", "rest_length": "m", "amplitude": "m", "phase": "rad"}


def _range(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _bouncing_cube() -> Sequence[Robot]:
    cube = shapes.cube(stiffness=10_000.0).rotated((1, 2, 3), 0.7)
    return [cube.moved((0.0, 0.0, 0.3)).spinning((1.0, -0.7, 1.3))]


def _breathing_cube() -> Sequence[Robot]:
    cube = shapes.cube(stiffness=5_000.0)
    phase = np.linspace(0.0, 2.0 * math.pi, cube.n_springs, endpoint=False)
    return [cube.replace(amplitude=0.15 * cube.rest_length, phase=phase, omega=10.0)]


def _ten_cubes() -> Sequence[Robot]:
    rng = np.random.default_rng(10)
    cube = shapes.cube(stiffness=5_000.0)
    return [
        cube.rotated(rng.normal(size=3), rng.uniform(0.0, math.pi)).moved((0.0, 0.0, 0.4))
        for _ in range(10)
    ]


def _tetrahedron() -> Sequence[Robot]:
    body = shapes.tetrahedron(stiffness=5_000.0).rotated((1, 1, 0), 0.4)
    return [body.moved((0.0, 0.0, 0.25))]


_CLASSROOM_DAMPING = damping_rate(per_step=0.9999, dt=1e-4)

DEMOS: dict[str, Demo] = {
    "bouncing-cube": Demo(
        "a spinning cube bounces without losses: its total energy stays constant",
        _bouncing_cube,
        Scene(ground=Ground(static_friction=0.0, kinetic_friction=0.0)),
        duration=3.0,
    ),
    "breathing-cube": Demo(
        "every spring of a cube breathes in a phase of its own, and the cube wanders",
        _breathing_cube,
        Scene(damping=_CLASSROOM_DAMPING),
        duration=4.0,
    ),
    "ten-cubes": Demo(
        "ten cubes dropped at random orientations bounce, tumble and come to rest",
        _ten_cubes,
        Scene(damping=_CLASSROOM_DAMPING),
        duration=3.0,
    ),
    "tetrahedron": Demo(
        "the simplest solid body, dropped on an edge with friction and damping",
        _tetrahedron,
        Scene(damping=_CLASSROOM_DAMPING),
        duration=2.0,
    ),
}
