"""The physics of warp_springs once more, written plainly: one robot, NumPy, float64.

Nothing here is shared with the simulator, so that ``warp-springs bench`` and the tests can judge
it. `Trial` repeats its discrete algorithm step by step, one statement per rule, so that the two
must agree to rounding. `continuum` knows no algorithm at all: it integrates the differential
equations with Runge-Kutta steps, so that the algorithm itself can be judged.

A robot is anything with the arrays of `warp_springs.Robot`, a scene anything with the fields of
`warp_springs.Scene`. Units are SI, z is up, the ground is the plane z = 0.
"""

from dataclasses import dataclass

import numpy as np

__all__ = ["Energies", "Trial", "continuum", "energies", "rest_lengths", "spring_forces"]

XY = slice(0, 2)
Z = 2


def norms(vectors):
    """Euclidean length of each row, shape (n,)."""
    return np.sqrt((vectors * vectors).sum(axis=1))


def rest_lengths(robot, time):
    """L0(t) = rest_length + amplitude sin(omega t + phase) [m], shape (S,)."""
    return robot.rest_length + robot.amplitude * np.sin(robot.omega * time + robot.phase)


def spring_forces(robot, positions, time):
    """Force of all springs on each mass [N], shape (M, 3): k (L - L0) towards the other end."""
    i, j = robot.springs.T
    reach = positions[j] - positions[i]
    length = norms(reach)
    tension = robot.stiffness * (length - rest_lengths(robot, time))
    direction = reach / np.where(length > 0.0, length, 1.0)[:, None]  # none, so no force
    forces = np.zeros_like(positions)
    np.add.at(forces, i, tension[:, None] * direction)
    np.add.at(forces, j, -tension[:, None] * direction)
    return forces


@dataclass
class Energies:
    """The four kinds of energy a lossless robot exchanges [J]."""

    kinetic: float
    gravity: float
    spring: float
    ground: float

    @property
    def total(self):
        """Their sum [J]."""
        return self.kinetic + self.gravity + self.spring + self.ground


def energies(robot, scene, positions, velocities, time):
    """Energies [J] of a pose: textbook formulas, zero height at the origin."""
    lengths = norms(positions[robot.springs[:, 1]] - positions[robot.springs[:, 0]])
    stretch = lengths - rest_lengths(robot, time)
    depth = np.minimum(positions[:, Z], 0.0)
    stiffness = scene.ground.stiffness if scene.ground is not None else 0.0
    return Energies(
        kinetic=0.5 * (robot.masses * (velocities**2).sum(axis=1)).sum(),
        gravity=-(robot.masses * (positions @ np.asarray(scene.gravity))).sum(),
        spring=0.5 * (robot.stiffness * stretch**2).sum(),
        ground=0.5 * stiffness * (depth**2).sum(),
    )


class Trial:
    """One robot stepped by the simulator's discrete algorithm.

    `contact_substeps` is the number of sub-steps of the vertical motion that a mass near the
    ground takes within a drift; `euler` has no drift and ignores it.

    `margin` is the smallest relative distance of any stick-or-slip decision from its threshold.
    The outcome of friction jumps there: where the margin is of the order of rounding, two correct
    programs may part ways, and a comparison proves nothing.
    """

    def __init__(self, robot, scene, dt, integrator="leapfrog", contact_substeps=1):
        self.robot = robot
        self.scene = scene
        self.dt = dt
        self.contact_substeps = contact_substeps
        self._takes_back = integrator == "chin4"
        self.positions = np.array(robot.positions, dtype=np.float64)
        self.masses = np.asarray(robot.masses, dtype=np.float64)
        self.gravity = np.asarray(scene.gravity, dtype=np.float64)
        self.steps = 0
        self.margin = np.inf
        self._state = np.array(robot.velocities, dtype=np.float64)
        # The step, the length of its drifts, and the part of its first kick that ends the last one.
        self._advance, self._span, self._closing_kick = {
            "euler": (self._euler, dt, None),
            "leapfrog": (self._leapfrog, dt, dt / 2),
            "chin4": (self._chin4, dt / 2, dt / 6),
        }[integrator]

    def step(self):
        """Advance by dt."""
        self._advance()
        self.steps += 1

    def run(self, steps):
        """Advance by `steps` steps; positions and velocities at every time, (steps + 1, M, 3)."""
        positions, velocities = [self.positions.copy()], [self.velocities]
        for _ in range(steps):
            self.step()
            positions.append(self.positions.copy())
            velocities.append(self.velocities)
        return np.array(positions), np.array(velocities)

    @property
    def time(self):
        """The time reached [s], counted in whole steps from the start."""
        return self.steps * self.dt

    @property
    def velocities(self):
        """Velocities at the same instant as the positions [m/s], shape (M, 3).

        A step that kicks and drifts keeps them before the kick that would end it; it is added to
        a copy here. The state has had its friction already; a mass in the ground that the kick
        would not set free reports rest.
        """
        if self._closing_kick is None or self.steps == 0:
            return self._state.copy()
        velocities = self._dragged(self._damped(self._state, self._span / 2), self._span / 2)
        velocities = self._kicked(velocities, self._spring_forces(), self._closing_kick)
        if self._friction == "coulomb":
            impulse = self._normal_forces() / self.masses * self._closing_kick
            self._rub(velocities, impulse, np.zeros_like(impulse))
        return velocities

    # What acts on a mass.

    @property
    def _friction(self):
        return None if self.scene.ground is None else self.scene.ground.friction

    def _spring_forces(self):
        return spring_forces(self.robot, self.positions, self.time)

    def _normal_forces(self):
        """Force of the ground on each mass [N], shape (M,)."""
        if self.scene.ground is None:
            return np.zeros(len(self.masses))
        return self.scene.ground.stiffness * np.maximum(-self.positions[:, Z], 0.0)

    def _damped(self, velocities, duration):
        return velocities * np.exp(-self.scene.damping * duration)

    def _dragged(self, velocities, duration):
        """The exact solution of dv/dt = -(c/m) |v| v over `duration`."""
        rate = self.scene.drag * norms(velocities) / self.masses
        return velocities / (1.0 + rate * duration)[:, None]

    def _note(self, value, threshold):
        scale = max(value, threshold, np.finfo(float).tiny)
        self.margin = min(self.margin, abs(value - threshold) / scale)

    def _rub(self, velocities, hold, impulse):
        """Coulomb friction in place, by normal impulses per mass [m/s], (M,).

        `hold` may stop a mass, `impulse` slows one that is not stopped.
        """
        ground = self.scene.ground
        for i in np.flatnonzero(hold > 0.0):
            slip = np.hypot(*velocities[i, XY])
            self._note(slip, ground.static_friction * hold[i])
            if slip <= ground.static_friction * hold[i]:
                velocities[i, XY] = 0.0
            elif impulse[i] > 0.0:
                keep = 1.0 - ground.kinetic_friction * impulse[i] / slip
                velocities[i, XY] *= max(0.0, keep)

    def _course_rule(self, forces, velocities):
        """The classroom rule in place: horizontal force against mu times the normal force."""
        ground = self.scene.ground
        normal = self._normal_forces()
        for i in np.flatnonzero(normal > 0.0):
            horizontal = np.hypot(*forces[i, XY])
            self._note(horizontal, ground.static_friction * normal[i])
            if horizontal < ground.static_friction * normal[i]:
                forces[i, XY] = 0.0
                velocities[i, XY] = 0.0
            else:
                lost = ground.kinetic_friction * normal[i]
                forces[i, XY] *= 1.0 - lost / horizontal if horizontal > lost else 0.0

    # The classroom method: symplectic Euler.

    def _euler(self):
        dt = self.dt
        forces = self._spring_forces() + self.masses[:, None] * self.gravity
        velocities = self._state
        if self._friction == "course":
            self._course_rule(forces, velocities)
        velocities = velocities + forces / self.masses[:, None] * dt
        impulse = self._normal_forces() / self.masses * dt
        if self._friction == "coulomb":
            self._rub(velocities, impulse, impulse)
        velocities[:, Z] += impulse
        velocities = self._dragged(self._damped(velocities, dt), dt)
        self._state = velocities
        self.positions = self.positions + velocities * dt

    # Springs kick; in the drifts between, gravity and ground act. A kick that ends a step and the
    # one that begins the next are one.

    def _leapfrog(self):
        begins, forces = self.steps == 0, self._spring_forces()
        self._lossy_kick(forces, self.dt / 2 if begins else self.dt, begins)
        impulse = self._fall(self._with_weight(forces), ahead=self.dt / 2)
        self._slide(impulse, impulse)

    def _chin4(self):
        """Chin's 4A: the middle kick takes the forces a little further along the acceleration."""
        dt, begins, forces = self.dt, self.steps == 0, self._spring_forces()
        bow = dt**2 / 24
        self._lossy_kick(forces, dt / 6 if begins else dt / 3, begins)
        first = self._fall(self._with_weight(forces), ahead=dt / 6, after=bow)
        self._slide(first * 2 / 3, first)  # after a third of the step's kicks

        middle = self.time + dt / 2
        forces = spring_forces(self.robot, self.positions, middle)
        shift = self._with_weight(forces) / self.masses[:, None] * bow
        forces = spring_forces(self.robot, self.positions + shift, middle)
        self._lossy_kick(forces, dt * 2 / 3, begins=False)
        second = self._fall(self._with_weight(forces), ahead=dt / 3, before=bow)
        self._slide(np.where(second > 0.0, first / 3 + second, 0.0), second)

    def _with_weight(self, forces):
        """`forces` and the weight, but for its vertical part where that belongs to the drift."""
        weight = self.masses[:, None] * self.gravity
        if self.scene.ground is not None:
            weight[:, Z] = 0.0
        return forces + weight

    def _kicked(self, velocities, forces, duration):
        """`velocities` after `forces` and the weight acted for `duration`."""
        forces = self._with_weight(forces)
        velocities = velocities.copy()
        if self._friction == "course":
            self._course_rule(forces, velocities)
        return velocities + forces / self.masses[:, None] * duration

    def _lossy_kick(self, forces, duration, begins):
        """Kick between the losses of half the drift before, unless it begins all, and after."""
        half = self._span / 2
        velocities = self._state
        if not begins:
            velocities = self._dragged(self._damped(velocities, half), half)
        velocities = self._kicked(velocities, forces, duration)
        self._state = self._damped(self._dragged(velocities, half), half)

    def _slide(self, hold, impulse):
        """Friction, then the horizontal drift: what slides moves by the mean of two velocities."""
        mean = self._state[:, XY].copy()
        if self._friction == "coulomb":
            self._rub(self._state, hold, impulse)
            slides = self._state[:, XY].any(axis=1)[:, None]
            mean = np.where(slides, (mean + self._state[:, XY]) / 2, 0.0)
        self.positions[:, XY] += mean * self._span

    def _fall(self, forces, ahead, before=0.0, after=0.0):
        """Vertical drift; returns the ground's impulse per mass [m/s], (M,).

        `forces` are those of the kick before it. Where a mass may touch down or leave, they act
        during the drift instead: then it is at `before` [s^2] times their acceleration above its
        place when the drift begins, at `after` times that when it ends, and its kicks are `ahead`
        [s] of it.
        """
        impulse = np.zeros(len(self.masses))
        if self.scene.ground is None:
            self.positions[:, Z] += self._state[:, Z] * self._span
            return impulse
        g, span = self.gravity[Z], self._span
        for i, mass in enumerate(self.masses):
            z, w, a = self.positions[i, Z], self._state[i, Z], forces[i, Z] / mass
            free = z + w * span + g * span**2 / 2
            if z + a * before < 0.0 or free + a * after < 0.0:
                start, going = z + a * before, w - a * ahead
                if not self._takes_back or self._stays(start, going, g + a, mass):
                    start, going, a = z, w, 0.0
                z, w, impulse[i] = self._contact(start, going, g + a, mass)
                z, w = z - a * after, w + a * (ahead - span)
            else:
                z, w = free, w + g * span
            self.positions[i, Z], self._state[i, Z] = z, w
        return impulse

    def _stays(self, z, w, g, mass):
        """Whether a mass under g [m/s^2] is in contact and surely stays so for a drift."""
        push = self.scene.ground.stiffness / mass * max(-z, 0.0)
        return z < 0.0 and z + w * self._span + (push + g) * self._span**2 / 2 < 0.0

    def _contact(self, z, w, g, mass):
        """Sub-steps of one mass under the ground and g [m/s^2]: z, w, impulse.

        Kick-drift-kick, while it is held with the lengths that make an oscillation exact, as
        series; half a spring's force where the contact begins or ends inside a sub-step.
        """
        h, push = self._span / self.contact_substeps, self.scene.ground.stiffness / mass
        q = push * h**2 if push * h**2 < 1.0 else 0.0
        kicks = {True: h / 2 * (1 + q / 12 + q**2 / 120), False: h / 2}
        ways = {True: h * (1 - q / 6 + q**2 / 120), False: h}
        start = w
        for _ in range(self.contact_substeps):
            before, held = z, z < 0.0
            w += (g + push * max(-z, 0.0)) * kicks[held]
            z += w * ways[held]
            w += (g + push * max(-z, 0.0)) * kicks[held]
            if held != (z < 0.0):
                w -= push * h / 2 * abs(z * before) / (abs(z) + abs(before))
        return z, w, max(w - start - g * self._span, 0.0)


def continuum(robot, scene, duration, steps):
    """Positions and velocities (M, 3) after `duration` [s] by classical Runge-Kutta steps.

    Solves the differential equations of springs, weight, damping, drag and a frictionless ground;
    the scene's friction coefficients are ignored.
    """
    masses = robot.masses[:, None]
    incidence = np.zeros((len(robot.masses), len(robot.springs)))
    i, j = robot.springs.T
    incidence[i, np.arange(len(i))] = 1.0
    incidence[j, np.arange(len(j))] = -1.0

    def acceleration(x, v, t):
        reach = x[j] - x[i]
        length = norms(reach)
        tension = robot.stiffness * (length - rest_lengths(robot, t)) / length
        forces = incidence @ (tension[:, None] * reach) + masses * np.asarray(scene.gravity)
        if scene.ground is not None:
            forces[:, Z] += scene.ground.stiffness * np.maximum(-x[:, Z], 0.0)
        if scene.drag:
            forces -= scene.drag * norms(v)[:, None] * v
        return forces / masses - scene.damping * v

    x, v = robot.positions.copy(), robot.velocities.copy()
    h = duration / steps
    for step in range(steps):
        t = step * h
        v1, a1 = v, acceleration(x, v, t)
        v2, a2 = v + a1 * h / 2, acceleration(x + v1 * h / 2, v + a1 * h / 2, t + h / 2)
        v3, a3 = v + a2 * h / 2, acceleration(x + v2 * h / 2, v + a2 * h / 2, t + h / 2)
        v4, a4 = v + a3 * h, acceleration(x + v3 * h, v + a3 * h, t + h)
        x = x + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, v
