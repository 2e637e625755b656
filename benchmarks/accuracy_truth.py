"""The motion that the simulator approximates, to ten digits or so, by an independent solver.

Nothing here is shared with the simulator but the numbers of a robot and a scene. The differential
equations of springs, weight, damping, drag, ground and Coulomb friction are smooth as long as every
mass keeps its state: airborne, sliding or stuck. SciPy's Runge-Kutta method of order eight solves
them piece by piece, and the instant at which a mass changes its state is found as a root of the
dense output. So its error is that of a smooth problem, however hard the impacts are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

import warp_springs as ws

__all__ = ["Motion", "solve"]

#: A sliding mass slower than this [m/s] is at the end of its slide.
CRAWL = 1e-7
#: Places inside a step where the states of the masses are looked at.
LOOKS = np.linspace(0.0, 1.0, 6)[1:]


@dataclass(frozen=True)
class Motion:
    """Where a robot is after a while.

    Attributes:
        positions: Positions [m], shape (M, 3).
        velocities: Velocities [m/s], shape (M, 3).
        switches: How often a mass landed, took off, stuck or slipped.
    """

    positions: np.ndarray
    velocities: np.ndarray
    switches: int


def solve(robot: ws.Robot, scene: ws.Scene, duration: float, tolerance: float = 1e-11) -> Motion:
    """The motion of a robot after ``duration`` seconds, each step good to ``tolerance``.

    Raises:
        RuntimeError: The steps became too small, or masses change their states without end.
    """
    world = _World(robot, scene)
    y, time, step, switches = world.start(), 0.0, 1e-5, 0
    while time < duration:
        solver = DOP853(
            world.rate, time, y, duration, rtol=tolerance, atol=tolerance,
            first_step=min(step, duration - time),
        )  # fmt: skip
        time, y, broken = _until_a_switch(world, solver)
        step = solver.step_size
        if broken is not None:
            y = world.switch(time, y, broken)
            switches += 1
        if switches > 1_000_000:
            raise RuntimeError(f"masses change their states without end at {time} s")
    positions, velocities = world.split(y)
    return Motion(positions, velocities, switches)


def _until_a_switch(world: _World, solver: DOP853):
    """Step until the state of a mass breaks: time, solution, and which margin, or ``None``."""
    while solver.status == "running":
        solver.step()
        if solver.status == "failed":
            raise RuntimeError(f"the step became too small at {solver.t} s")
        dense = solver.dense_output()
        before, times = solver.t_old, solver.t_old + LOOKS * (solver.t - solver.t_old)
        for now in times:
            margins = world.margins(now, dense(now))
            if margins.min() < 0.0:
                at, broken = _first_root(world, dense, before, now, np.flatnonzero(margins < 0.0))
                return at, dense(at), broken
            before = now
        world.arm(solver.y)
    return solver.t, solver.y, None


def _first_root(world: _World, dense, before: float, now: float, candidates: np.ndarray):
    """When the first of some margins crosses zero between two instants, and which."""
    roots = []
    for broken in candidates:

        def margin(t: float, broken=broken) -> float:
            return world.margins(t, dense(t))[broken]

        is_positive = margin(before) > 0.0
        at = brentq(margin, before, now, xtol=1e-15, rtol=1e-14) if is_positive else before
        roots.append((at, int(broken)))
    return min(roots)


class _World:
    """The differential equations of a robot while the states of its masses do not change."""

    def __init__(self, robot: ws.Robot, scene: ws.Scene) -> None:
        self.robot, self.scene, self.ground = robot, scene, scene.ground
        self.masses = robot.masses[:, None]
        self.i, self.j = robot.springs.T
        self.incidence = np.zeros((robot.n_masses, robot.n_springs))
        self.incidence[self.i, np.arange(robot.n_springs)] = 1.0
        self.incidence[self.j, np.arange(robot.n_springs)] -= 1.0
        self.weight = self.masses * np.asarray(scene.gravity)
        self.touching = np.zeros(robot.n_masses, bool)
        self.stuck = np.zeros(robot.n_masses, bool)
        #: Sliding masses that have been faster than a crawl since they began to slide.
        self.armed = np.zeros(robot.n_masses, bool)

    def start(self) -> np.ndarray:
        """The solution at time 0; a mass below the ground touches it, and slides at first."""
        if self.ground is not None:
            self.touching = self.robot.positions[:, 2] < 0.0
        y = np.concatenate([self.robot.positions.ravel(), self.robot.velocities.ravel()])
        self.arm(y)
        if self.ground is not None and self.ground.has_friction:
            for mass in np.flatnonzero(self.touching & ~self.armed):
                self._settle(0.0, y, mass)
        return y

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities, (M, 3) each."""
        return y.reshape(2, -1, 3)

    def rate(self, time: float, y: np.ndarray) -> np.ndarray:
        """The right-hand side of the differential equations."""
        x, v = self.split(y)
        forces, push = self._forces(time, x)
        if self.scene.drag:
            forces = forces - self.scene.drag * np.linalg.norm(v, axis=1)[:, None] * v
        if self.ground is not None and self.touching.any():
            forces[:, 2] += push
            self._add_friction(forces, v, push)
        acceleration = forces / self.masses - self.scene.damping * v
        acceleration[self.stuck, :2] = 0.0
        return np.concatenate([v.ravel(), acceleration.ravel()])

    def margins(self, time: float, y: np.ndarray) -> np.ndarray:
        """How far each mass is from a change of its state, flat from (3, M), negative beyond it.

        The rows are height (landing, taking off), speed (the end of a slide) and grip (slipping).
        """
        x, v = self.split(y)
        margins = np.ones((3, len(x)))
        if self.ground is not None:
            margins[0] = np.where(self.touching, -x[:, 2], x[:, 2])
            if self.armed.any():
                margins[1, self.armed] = np.hypot(v[:, 0], v[:, 1])[self.armed] - CRAWL
            if self.stuck.any():
                margins[2, self.stuck] = self._grip(time, x)[self.stuck]
        return margins.ravel()

    def switch(self, time: float, y: np.ndarray, broken: int) -> np.ndarray:
        """Change the state of a mass whose margin is used up; the solution it goes on with."""
        y = y.copy()
        x = self.split(y)[0]
        kind, mass = divmod(broken, len(x))
        if kind == 0:
            x[mass, 2] = 0.0
            self.touching[mass] = not self.touching[mass]
            self.stuck[mass] = self.armed[mass] = False
            self.arm(y)
        elif kind == 1:
            self._settle(time, y, mass)
        else:
            self.stuck[mass] = False
        return y

    def arm(self, y: np.ndarray) -> None:
        """Note which sliding masses are now faster than a crawl."""
        if self.ground is None or not self.ground.has_friction:
            return
        _, v = self.split(y)
        self.armed |= self.touching & ~self.stuck & (np.hypot(v[:, 0], v[:, 1]) > 2.0 * CRAWL)

    def _settle(self, time: float, y: np.ndarray, mass: int) -> None:
        """End of a slide: the mass sticks if static friction holds it, or turns back."""
        x, v = self.split(y)
        self.armed[mass] = False
        if self._grip(time, x)[mass] >= 0.0:
            self.stuck[mass] = True
            v[mass, :2] = 0.0

    def _forces(self, time: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Springs and weight [N], (M, 3), and the push of the ground [N], (M,)."""
        robot = self.robot
        reach = x[self.j] - x[self.i]
        length = np.sqrt(np.einsum("sk,sk->s", reach, reach))
        rest = robot.rest_length + robot.amplitude * np.sin(robot.omega * time + robot.phase)
        pull = robot.stiffness * (1.0 - rest / length)
        forces = self.incidence @ (pull[:, None] * reach) + self.weight
        if self.ground is None:
            return forces, np.zeros(len(x))
        return forces, np.where(self.touching, -self.ground.stiffness * x[:, 2], 0.0)

    def _grip(self, time: float, x: np.ndarray) -> np.ndarray:
        """Static friction that is not yet used [N], shape (M,)."""
        forces, push = self._forces(time, x)
        return self.ground.static_friction * push - np.hypot(forces[:, 0], forces[:, 1])

    def _add_friction(self, forces: np.ndarray, v: np.ndarray, push: np.ndarray) -> None:
        """Kinetic friction of the sliding masses, against velocity, or, at rest, against force."""
        if not self.ground.has_friction:
            return
        sliding = self.touching & ~self.stuck
        along = np.where(self.armed[:, None], v[:, :2], forces[:, :2])
        size = np.hypot(along[:, 0], along[:, 1])
        size[size == 0.0] = 1.0
        drag = self.ground.kinetic_friction * np.where(sliding, push, 0.0) / size
        forces[:, :2] -= drag[:, None] * along


def rest(robot: ws.Robot, scene: ws.Scene, rounds: int = 60) -> tuple[np.ndarray, float]:
    """Equilibrium of a robot on a smooth ground, (M, 3), and how far the last step moved it [m].

    Newton's method on the forces of springs, weight and ground. The stiffness matrix leaves the
    robot free to move and turn along the ground; of those steps the smallest is taken.

    Raises:
        RuntimeError: It did not converge.
    """
    x, i, j = robot.positions.copy(), *robot.springs.T
    count = robot.n_masses
    for _ in range(rounds):
        reach = x[j] - x[i]
        length = np.linalg.norm(reach, axis=1)
        along = reach / length[:, None]
        tension = robot.stiffness * (length - robot.rest_length)
        forces = robot.masses[:, None] * np.asarray(scene.gravity)
        np.add.at(forces, i, tension[:, None] * along)
        np.add.at(forces, j, -tension[:, None] * along)
        inside = x[:, 2] < 0.0
        forces[inside, 2] -= scene.ground.stiffness * x[inside, 2]

        outer = along[:, :, None] * along[:, None, :]
        blocks = robot.stiffness[:, None, None] * outer
        blocks += (tension / length)[:, None, None] * (np.eye(3) - outer)
        stiffness = np.zeros((count, 3, count, 3))
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            np.add.at(stiffness, (a, slice(None), b), sign * blocks)
        feet = np.flatnonzero(inside)
        stiffness[feet, 2, feet, 2] += scene.ground.stiffness
        matrix = stiffness.reshape(3 * count, 3 * count)
        step = np.linalg.lstsq(matrix, forces.ravel(), rcond=1e-9)[0].reshape(-1, 3)
        step *= min(1.0, 0.02 / np.abs(step).max())
        x += step
        if np.abs(step).max() < 1e-13:
            return x, float(np.abs(step).max())
    raise RuntimeError(f"no equilibrium after {rounds} steps of Newton's method")
