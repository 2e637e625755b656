"""Where collisions are stiffest: two cubes that meet corner on corner, without losses.

All triangles and edges around both corners push at once. A step is unstable where a hit, of many
that differ by a little, ends with twice the energy it began with.
"""

import numpy as np

import warp_springs as ws

__all__ = ["NAME", "limit"]

NAME = "cubes, corner on corner"
RATIOS = np.geomspace(0.96, 2.9, 14)
GROWN, HITS, DURATION = 2.0, 40, 0.04  # energy, how many, s
SCENE = ws.Scene(
    gravity=(0, 0, 0),
    ground=None,
    collisions=ws.Collisions(static_friction=0.0, kinetic_friction=0.0, damping=0.0),
)


def limit(integrator: str) -> float:
    """The smallest unstable step over ``ws.stable_dt``; inf: none up to 2.9."""
    robots = _pairs()
    bound = ws.stable_dt(robots[0], SCENE, integrator)
    return next((r for r in RATIOS.tolist() if _grows(robots, r * bound, integrator)), np.inf)


def _pairs() -> list[ws.Robot]:
    """Cubes two by two, the second on its way down onto the first."""
    cube = ws.shapes.cube(edge=0.1, mass=0.8, stiffness=1e4)
    cube = cube.moved(-cube.center_of_mass)
    low = cube.rotated(np.cross((1, 1, 1), (0, 0, 1)), np.arccos(1 / np.sqrt(3)))
    high = low.rotated((1, 0, 0), np.pi).moving((0, 0, -1.0))
    shifts = np.random.default_rng(0).normal(0, 0.0015, (HITS, 2))
    return [r for shift in shifts for r in (low, high.moved((*shift, 0.1 * np.sqrt(3) + 0.01)))]


def _grows(robots: list[ws.Robot], dt: float, integrator: str) -> bool:
    worlds, limits = np.arange(len(robots)) // 2, ws.Limits(gain=1e9)
    simulation = ws.Simulation(
        robots, SCENE, dt, world=worlds, integrator=integrator, limits=limits
    )
    result = simulation.run(DURATION, fps=500, energy=True)
    if np.median(np.ptp(result.energy.kinetic, axis=1)) < 0.05:
        raise SystemExit("the cubes did not meet")
    grown = result.energy.total / result.energy.total[:, :1]
    return bool(result.status.any() or grown.max() > GROWN)
