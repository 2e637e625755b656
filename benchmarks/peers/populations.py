"""The populations of the comparison: the classroom's cubes and lattices, made by warp_springs."""

import numpy as np
from problem import Problem

import warp_springs as ws

__all__ = ["BODIES", "DT", "problem_of", "scene_of", "variants"]

DT, OMEGA = 1e-4, 2.0 * np.pi
BODIES = {"cube": (1, 1, 1), "lattice": (4, 2, 2)}  # voxels: 28 and 296 springs


def scene_of(ground: bool = True) -> ws.Scene:
    """The classroom's world: ground, its friction, 0.9999 of the velocity kept each step."""
    plane = ws.Ground(friction="course") if ground else None
    return ws.Scene(ground=plane, damping=ws.damping_rate(0.9999, DT))


def variants(body: str, robots: int, seed: int = 0) -> ws.Variants:
    """Robots that land in the first milliseconds, every spring breathing in a phase of its own."""
    one = ws.shapes.lattice(*BODIES[body]).moved((0.0, 0.0, 0.0005))
    rng = np.random.default_rng(seed)
    shape = (robots, one.n_springs)
    return one.variants(
        stiffness=one.stiffness * rng.uniform(0.8, 1.2, shape),
        amplitude=one.rest_length * rng.uniform(0.05, 0.1, shape),
        phase=rng.uniform(0.0, 2.0 * np.pi, shape),
        omega=np.full(robots, OMEGA),
    )


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
