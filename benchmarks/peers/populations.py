"""The populations of the comparison: those of ``warp-springs bench``, as plain arrays."""

import numpy as np

import warp_springs as ws
from peers.problem import Problem
from warp_springs.bench.populations import DT, scene_of, variants

__all__ = ["BODIES", "population", "problem_of"]

BODIES = ("cube", "lattice")  # 28 and 296 springs


def population(body: str, robots: int) -> Problem:
    """Robots that land in the first milliseconds on the classroom's ground, breathing."""
    return problem_of(variants(body, robots), scene_of())


def problem_of(robots: ws.Variants, scene: ws.Scene) -> Problem:
    """The same robots and world as plain arrays."""
    names = ("masses", "positions", "velocities", "stiffness", "rest_length", "amplitude", "phase")
    ground = scene.ground
    return Problem(
        springs=robots.body.springs.astype(np.int32),
        omega=np.array(robots.array("omega")),
        gravity=np.array(scene.gravity, np.float64),
        dt=DT,
        keep=float(np.exp(-scene.damping * DT)),
        ground_stiffness=ground.stiffness if ground else 0.0,
        static_friction=ground.static_friction if ground else 0.0,
        kinetic_friction=ground.kinetic_friction if ground else 0.0,
        **{name: np.ascontiguousarray(robots.array(name)) for name in names},
    )
