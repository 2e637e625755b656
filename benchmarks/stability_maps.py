"""Maps of what becomes of a tumbling, bouncing cube over step and stiffness, mass, or ground.

Every cell is one cube, dropped on a corner with spin and friction, and simulated for 0.3 s. A
column of a map has one reference: chin4 with a step a hundredth of the column's stable one. All
cubes of one step that share a world run in one Simulation.
"""

from dataclasses import dataclass

import numpy as np

import warp_springs as ws

__all__ = ["ACCURATE", "AXES", "INTEGRATORS", "STABLE", "Axis", "Map", "measure"]

INTEGRATORS = ("chin4", "leapfrog", "euler")
DURATION = 0.3
EDGE, MASS, STIFFNESS, GROUND = 0.1, 0.1, 1000.0, 1e5  # of what a map does not vary
#: A cell is accurate if the masses end up within this distance [m], root mean square.
ACCURATE = 1e-3
#: A cell is unstable if the robot was stopped, or ends with so many times the energy it had.
#: Symplectic Euler loses and gains in every bounce, but less than this while it is stable.
STABLE = 3.0
#: The reference step, as a part of the stable one, and within these bounds [s].
REFERENCE, REFERENCE_BOUNDS = 0.01, (1e-6, 5e-6)
STOPPED = 1.0  # stands for the error of a robot that was stopped


@dataclass(frozen=True)
class Axis:
    """What varies along the horizontal axis of a map.

    Attributes:
        name: Key in the JSON.
        label: Text at the axis.
        low: Decade at which it starts.
        high: Decade at which it ends.
        default: Value in the other maps.
    """

    name: str
    label: str
    low: float
    high: float
    default: float

    def values(self, count: int) -> np.ndarray:
        """Values from end to end, evenly spaced in their logarithm."""
        return np.geomspace(10.0**self.low, 10.0**self.high, count)


AXES = (
    Axis("stiffness", "spring stiffness k [N/m]", 1.0, 6.0, STIFFNESS),
    Axis("mass", "mass of a vertex m [kg]", -4.0, 1.0, MASS),
    Axis("ground", "ground stiffness K$_G$ [N/m]", 2.0, 8.0, GROUND),
)


@dataclass(frozen=True)
class Map:
    """What was measured over steps (rows) and values (columns) for one integrator.

    Attributes:
        axis: What varies.
        integrator: The integrator.
        steps: Steps [s], shape (R,).
        values: Values of the axis, shape (C,).
        error: Root-mean-square distance from the reference [m], shape (R, C).
        gain: Energy at the end over energy at the start, inf where stopped, shape (R, C).
        status: ``ws.Status``, shape (R, C).
        bound: ``ws.stable_dt`` [s], shape (C,).
    """

    axis: Axis
    integrator: str
    steps: np.ndarray
    values: np.ndarray
    error: np.ndarray
    gain: np.ndarray
    status: np.ndarray
    bound: np.ndarray

    @property
    def unstable(self) -> np.ndarray:
        """Cells whose robot was stopped or gained energy, shape (R, C)."""
        return (self.status != ws.Status.OK) | (self.gain > STABLE)

    @property
    def accurate(self) -> np.ndarray:
        """Cells within ``ACCURATE`` of the reference, shape (R, C)."""
        return ~self.unstable & (self.error <= ACCURATE)

    @property
    def violations(self) -> int:
        """Unstable cells below the bound."""
        return int((self.unstable & (self.steps[:, None] < self.bound)).sum())

    def summary(self) -> dict:
        """Everything, for JSON."""
        return {
            "axis": self.axis.name,
            "integrator": self.integrator,
            "steps_s": self.steps.tolist(),
            "values": self.values.tolist(),
            "stable_dt_s": self.bound.tolist(),
            "error_m": self.error.tolist(),
            "energy_gain": np.minimum(self.gain, 1e9).tolist(),
            "status": self.status.tolist(),
            "unstable_below_the_bound": self.violations,
        }


def measure(rows: int, columns: int, progress=None) -> list[Map]:
    """All maps: a list with the axes outermost, then the integrators."""
    steps = DURATION / np.unique(np.rint(np.geomspace(DURATION / 1e-2, DURATION / 2e-5, rows)))
    maps = []
    for axis in AXES:
        values = axis.values(columns)
        worlds = [_world(axis, value) for value in values]
        references = _references(worlds)
        for integrator in INTEGRATORS:
            cells = [_run(worlds, integrator, dt) for dt in steps]
            positions, gain, status = (np.stack(part) for part in zip(*cells, strict=True))
            distance = np.sqrt(((positions - references) ** 2).sum(axis=-1).mean(axis=-1))
            error = np.where(status == ws.Status.OK, distance, STOPPED)
            bound = np.array([ws.stable_dt(robot, scene, integrator) for robot, scene in worlds])
            maps.append(Map(axis, integrator, steps, values, error, gain, status, bound))
            if progress is not None:
                progress(len(maps) / (len(AXES) * len(INTEGRATORS)))
    return maps


def _world(axis: Axis, value: float) -> tuple[ws.Robot, ws.Scene]:
    """The cube and its scene where the axis has this value."""
    at = {other.name: other.default for other in AXES} | {axis.name: float(value)}
    cube = ws.shapes.cube(edge=EDGE, mass=8.0 * at["mass"], stiffness=at["stiffness"])
    cube = cube.rotated((1, 2, 3), 0.7).spinning((3.0, -2.0, 4.0))
    return cube.moved((0.0, 0.0, 0.02 - cube.bounds[0, 2])), _scene(at["ground"])


def _scene(stiffness: float) -> ws.Scene:
    return ws.Scene(ground=ws.Ground(stiffness, static_friction=0.0, kinetic_friction=0.0))


def _references(worlds) -> np.ndarray:
    """Positions at the end (C, M, 3), each with a step of its own, a power of two of another."""
    stable = np.array([ws.stable_dt(robot, scene, "chin4") for robot, scene in worlds])
    low, high = REFERENCE_BOUNDS
    halvings = np.ceil(np.log2(high / np.clip(REFERENCE * stable, low, high))).astype(int)
    found = np.empty((len(worlds), worlds[0][0].n_masses, 3))
    for level in np.unique(halvings):
        members = np.flatnonzero(halvings == level)
        chosen = [worlds[i] for i in members]
        found[members] = _run(chosen, "chin4", high / 2.0**level)[0]
    return found


def _run(worlds, integrator: str, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions at the end (C, M, 3), energy gains (C,) and statuses (C,)."""
    positions = np.empty((len(worlds), worlds[0][0].n_masses, 3))
    gain, status = np.empty(len(worlds)), np.empty(len(worlds), int)
    scenes = [scene for _, scene in worlds]
    for scene in dict.fromkeys(scenes):
        members = [i for i, other in enumerate(scenes) if other == scene]
        robots = [worlds[i][0] for i in members]
        result = ws.Simulation(robots, scene, dt, integrator=integrator).run(DURATION)
        for row, i in enumerate(members):
            robot, positions[i], status[i] = robots[row], result.positions(row), result.status[row]
            started = _energy(robot, scene, robot.positions, robot.velocities)
            ended = _energy(robot, scene, positions[i], result.velocities(row))
            gain[i] = ended / started if status[i] == ws.Status.OK else np.inf
    return positions, gain, status


def _energy(robot: ws.Robot, scene: ws.Scene, positions, velocities) -> float:
    """Kinetic energy, and that of weight, springs and ground [J]."""
    kinetic = 0.5 * robot.masses @ (velocities**2).sum(axis=1)
    weight = -robot.masses @ (positions @ scene.gravity)
    ends = positions[robot.springs]
    stretch = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - robot.rest_length
    depth = np.minimum(positions[:, 2], 0.0)
    elastic = 0.5 * (robot.stiffness @ stretch**2 + scene.ground.stiffness * (depth**2).sum())
    return float(kinetic + weight + elastic)
