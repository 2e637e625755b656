"""Robots at rest, for a long time: nothing may drift, creep, or warm up.

They are laid down with damping, which ends before the clock starts; from then on nothing takes
energy from them but friction. On a slope they must stick; without friction they must stay all the
same. What the first and the last tenth of the time show is compared.
"""

import time
from dataclasses import dataclass

import numpy as np

import warp_springs as ws

__all__ = ["CASES", "Rest", "measure"]

DT = 1e-3
SETTLE, SETTLE_DAMPING = 4.0, 20.0  # s, 1/s
FRAMES = 200
#: The slope is one of 20 degrees, the ice has no friction.
GROUNDS = {
    "level": ws.Scene(),
    "slope": ws.Scene(gravity=(9.81 * np.sin(np.pi / 9), 0.0, -9.81 * np.cos(np.pi / 9))),
    "ice": ws.Scene(ground=ws.Ground(static_friction=0.0, kinetic_friction=0.0)),
}
CASES = tuple(
    (integrator, precision, ground)
    for integrator in ("chin4", "leapfrog")
    for precision in ("float64", "float32")
    for ground in GROUNDS
)


@dataclass(frozen=True)
class Rest:
    """What was measured, the worst of all robots.

    Attributes:
        integrator: The integrator.
        precision: The precision.
        ground: What they lie on.
        seconds: Simulated time [s].
        drift: Mean positions of the masses in the last tenth less those in the first [m].
        wobble: Largest distance from the start at any time [m].
        early: Largest kinetic energy in the first tenth, over the energy of lifting by an edge.
        late: The same in the last tenth.
        stopped: Robots that were stopped.
        wall_time: Time that it took [s].
    """

    integrator: str
    precision: str
    ground: str
    seconds: float
    drift: float
    wobble: float
    early: float
    late: float
    stopped: int
    wall_time: float


def measure(integrator: str, precision: str, ground: str, seconds: float) -> Rest:
    """Lay robots down and wait."""
    scene, started = GROUNDS[ground], time.perf_counter()
    robots = _resting(_robots(), scene, integrator)
    simulation = ws.Simulation(robots, scene, DT, integrator=integrator, precision=precision)
    result = simulation.run(seconds, fps=FRAMES / seconds, energy=True)
    part = FRAMES // 10
    drift, wobble = [], []
    for i in range(len(robots)):
        frames = result.frames(i)
        drift.append(np.abs(frames[-part:].mean(axis=0) - frames[1 : part + 1].mean(axis=0)).max())
        wobble.append(np.abs(frames - frames[0]).max())
    weights = np.array([9.81 * robot.mass * 0.1 for robot in robots])
    kinetic = result.energy.kinetic / weights[:, None]
    return Rest(
        integrator,
        precision,
        ground,
        seconds,
        drift=float(max(drift)),
        wobble=float(max(wobble)),
        early=float(kinetic[:, 1 : part + 1].max()),
        late=float(kinetic[:, -part:].max()),
        stopped=int((result.status != ws.Status.OK).sum()),
        wall_time=time.perf_counter() - started,
    )


def _robots() -> list[ws.Robot]:
    """Shapes as they stand, and a cube turned on the spot."""
    bridge = np.ones((3, 1, 2), bool)
    bridge[1, 0, 0] = False
    shapes = ws.shapes
    return [
        shapes.cube(),
        shapes.cube().rotated((0, 0, 1), 0.4),
        shapes.cube(stiffness=1e4),
        shapes.tetrahedron(),
        shapes.octahedron(),
        shapes.lattice(2, 2, 1),
        shapes.lattice(1, 1, 3, stiffness=5e3),
        shapes.voxels(bridge, stiffness=3e3),
    ]


def _resting(robots: list[ws.Robot], scene: ws.Scene, integrator: str) -> list[ws.Robot]:
    """The robots where damping brings them to rest in this world."""
    still = ws.Scene(scene.gravity, scene.ground, damping=SETTLE_DAMPING)
    result = ws.Simulation(robots, still, DT, integrator=integrator).run(SETTLE)
    return [robot.replace(positions=result.positions(i)) for i, robot in enumerate(robots)]
