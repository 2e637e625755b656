"""Health of the robots: which step is safe, why a robot was stopped, and the limits that stop it.

An evolutionary search makes absurd robots. Each robot of a batch carries its own status; one that
goes wrong is stopped where it was last good, and its neighbours do not change by one bit.
"""

from __future__ import annotations

import enum
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warp_springs.body.elements import NONE
from warp_springs.body.variants import Variants
from warp_springs.checks import check_choice, check_number
from warp_springs.engine.colliding import busiest
from warp_springs.engine.packing import Strip, largest, largest_change
from warp_springs.kernels.contact import GRIP_DAMPING
from warp_springs.robot import Robot
from warp_springs.scene import Collisions, Scene

__all__ = ["Limits", "Status", "certainly_unstable", "stable_dt", "stable_step"]

Integrator = Literal["chin4", "leapfrog", "euler"]

#: Largest sqrt(K_G / m) dt. Springs resonate with the ground at pi; what symplectic Euler gains
#: and loses in a bounce adds up to nothing up to 1, and explodes above (measured: 5 times the
#: energy in 5 s at 1.3, 700 times at 1.9).
_LARGEST_GROUND_PHASE = {"chin4": 3.14, "leapfrog": 3.14, "euler": 1.0}
#: Largest phase of the springs of collisions in a step, as a part of what lasting springs may have.
#: Hits begin and end within steps (measured where corners meet without losses: the energy of one
#: hit is up to 1.2 times what it was at 0.75, three times at 0.9, twenty times at 1.3).
_LARGEST_HIT_PART = 0.75


class Status(enum.IntEnum):
    """Why a robot was stopped; ``OK`` is zero, so that any other value is true."""

    OK = 0
    #: A position or a velocity is infinite or not a number.
    NONFINITE = 1
    #: A spring is longer than ``Limits.stretch`` times the robot's longest spring.
    OVERSTRETCHED = 2
    #: A mass is faster than ``Limits.speed``.
    TOO_FAST = 3
    #: A mass is deeper in the ground than ``Limits.depth``.
    TOO_DEEP = 4
    #: The step is certain to be unstable for the robot's springs; it was never stepped.
    UNSTABLE_STEP = 5
    #: It gained energy from nowhere, more than ``Limits.gain``. Only the ledger knows, so only with
    #: ``energy=True``: the books are looked through at every frame and every 256 steps, and the
    #: robot is frozen, with that time, at the last such look at which they balanced.
    ENERGY = 6
    #: A number of the robot does not exist in the precision of the run; it was never stepped.
    INVALID = 7


@dataclass(frozen=True)
class Limits:
    """What a healthy robot stays within.

    Attributes:
        speed: Largest speed of a mass [m/s].
        stretch: Largest length of a spring, as a multiple of the longest spring of the robot
            (the largest of its initial lengths and of its rest lengths plus amplitudes).
        depth: Largest depth of a mass below the surface of the ground [m].
        gain: Largest energy from nowhere, as a part of the energy that a robot had, fell by, and
            was given by its springs (``Energy.gain``); looked at where energies are asked for.
    """

    speed: float = 1000.0
    stretch: float = 5.0
    depth: float = 1.0
    gain: float = 0.25

    def __post_init__(self) -> None:
        check_number("Limits.speed", self.speed, above=0.0)
        check_number("Limits.stretch", self.stretch, above=1.0)
        check_number("Limits.depth", self.depth, above=0.0)
        check_number("Limits.gain", self.gain, above=0.0)


def stable_dt(
    robots: Robot | Variants | Sequence[Robot],
    scene: Scene | None = None,
    integrator: Integrator = "chin4",
) -> float | np.ndarray:
    """The largest step that is certainly stable [s]: a float for one robot, else shape (N,).

    A bound, not an estimate. Every pose of a robot has its frequencies below
    sqrt(max over springs of (sum of k/m at one end + sum of k/m at the other)), by Gershgorin's
    theorem on the stiffness matrix with each spring at its full stiffness in any direction; the
    ground adds K_G / m of the lightest mass. Collisions add, by the same theorem, the temporary
    springs that are there at once where the busiest corner of a robot meets its like, 48 for two
    cubes, or where fine meshes lie on coarse ones: a count of what fits there, not a proof. The
    step is the largest with which the integrator keeps an oscillator of both stiffnesses bounded,
    and no larger than half a contact oscillation: there the kicks of the springs resonate with the
    bounce. For symplectic Euler a radian of it is the limit; beyond, bouncing masses gain energy.
    It says nothing of accuracy, nor of springs whose rest length turns negative.

    Raises:
        ValueError: The integrator is unknown.
    """
    check_choice("integrator", integrator, ("chin4", "leapfrog", "euler"))
    scene = Scene() if scene is None else scene
    if isinstance(robots, Robot):
        strip = Strip.alike([0], [robots])
    elif isinstance(robots, Variants):
        strip = Strip.variants(robots)
    elif any(robot.elements is not NONE for robot in robots):
        return np.array([stable_dt(robot, scene, integrator) for robot in robots])
    else:
        strip = Strip.ragged(range(len(robots)), robots)
    # An absurd robot may overflow here: no step is small enough for it.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        steps = stable_step(strip, scene, integrator)
    return float(steps[0]) if isinstance(robots, Robot) else steps


def stable_step(strip: Strip, scene: Scene, integrator: str) -> np.ndarray:
    """``stable_dt`` for the robots of a strip, shape (n,)."""
    step = _bounded_step(strip, scene, integrator)
    if scene.collisions is None:
        return step
    touching = _positive(_touching(strip, scene.collisions))
    return np.minimum(step, _LARGEST_HIT_PART * _limit(np.zeros(1), integrator) / touching)


def _bounded_step(strip: Strip, scene: Scene, integrator: str) -> np.ndarray:
    """The largest step that keeps all that vibrates bounded, shape (n,)."""
    springs, rubbed = _largest_frequency(strip), 0.0
    if scene.collisions is not None:
        touching = _touching(strip, scene.collisions)
        springs = np.hypot(springs, touching)
        grip = GRIP_DAMPING if scene.collisions.has_friction else 0.0
        rubbed = 2.0 * max(scene.collisions.damping, grip) * touching
    if scene.water is not None:
        springs = np.hypot(springs, np.sqrt(scene.water.stiffness(scene.gravity)))
    if not scene.stiffest_surface:
        return _step(_limit(np.zeros_like(springs), integrator), springs, rubbed)
    ground = np.sqrt(scene.corner_stiffness * largest(1.0 / strip.fields["masses"], strip.masses))
    both = np.hypot(springs, ground)
    share = np.arctan2(ground, springs)
    return _step(_limit(share, integrator), both, rubbed)


def _step(limit: np.ndarray, frequency: np.ndarray, rate: np.ndarray | float) -> np.ndarray:
    """The step whose phase is at the limit; where velocities also decay at a rate [1/s], below it.

    With the frequency w it solves (w dt)^2 + limit^2 rate dt / 2 = limit^2, which is exact for
    leapfrog, whose limit is 2.
    """
    alone = limit / _positive(frequency)
    slower = 0.25 * rate * alone
    return alone / (np.hypot(1.0, slower) + slower)


def _touching(strip: Strip, collisions: Collisions) -> np.ndarray:
    """A bound of the frequency of the temporary springs of collisions [rad/s], shape (n,).

    By the same theorem as for springs, at the busiest mass.
    """
    pairs = np.array([busiest(body) for body in strip.bodies])
    lightest = largest(1.0 / strip.fields["masses"], strip.masses)
    return np.sqrt(2.0 * pairs * collisions.stiffness * lightest)


def _largest_frequency(strip: Strip) -> np.ndarray:
    """A bound of the largest angular frequency of the springs in any pose [rad/s], shape (n,)."""
    fields, ends = strip.fields, strip.ends
    per_mass = np.zeros(len(fields["masses"]))
    stiffness = stiffest(fields)
    for end in ends:
        per_mass += np.bincount(end, stiffness, minlength=len(per_mass))
    tethers = _tether_stiffness(strip)
    per_mass = (per_mass + tethers) / fields["masses"]
    squares = largest(per_mass[ends[0]] + per_mass[ends[1]], strip.counts)
    if tethers.any():
        squares = np.maximum(squares, largest(per_mass, strip.masses))
    frequency = np.sqrt(squares)
    return frequency + _damping_rate(strip, ends) if "damping" in fields else frequency


def stiffest(fields: dict[str, np.ndarray]) -> np.ndarray:
    """The largest slope that the tension of each spring may have [N/m], shape (total,).

    A cubic spring has it where it is stretched, or squeezed, by half its rest length more than
    its actuation alone does.
    """
    k = fields["stiffness"]
    slope = fields.get("slope", np.ones_like(k))
    if "hinges" in fields:
        order = np.argsort(fields["hinges"][..., 0], axis=-1)
        parts = np.take_along_axis(fields["hinges"][..., 1], order, axis=-1)
        slope = np.maximum(slope, (slope[:, None] + np.cumsum(parts, axis=-1)).max(axis=-1))
    k = k * slope
    if "cubic" in fields:
        far = 0.5 * fields["rest_length"] + largest_change(fields)
        k = k + 3.0 * fields["cubic"] * far**2
    return k * fields["factors"].max(axis=-1) if "factors" in fields else k


def _softest(fields: dict[str, np.ndarray]) -> np.ndarray:
    """The least slope that the tension of each spring may have [N/m], shape (total,)."""
    k = fields["stiffness"]
    if {"slope", "hinges", "breaks", "yields"} & fields.keys():
        return np.zeros_like(k)
    return k * fields["factors"].min(axis=-1) if "factors" in fields else k


def _tether_stiffness(strip: Strip) -> np.ndarray:
    """Stiffness of the tethers of each mass of all robots [N/m]."""
    total = np.zeros(len(strip.fields["masses"]))
    tethers = strip.elements.tethers
    if tethers:
        n = len(strip.ids)
        values = strip.fields["outer"].reshape(n, -1, 5)[:, -len(tethers) :, 3]
        first = np.cumsum(strip.masses) - strip.masses
        at = first[:, None] + np.array([tether.mass for tether in tethers])
        np.add.at(total, at.ravel(), values.ravel())
    return total


def _damping_rate(strip: Strip, ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """A bound of the fastest decay that dashpots cause [1/s], shape (n,)."""
    fields = strip.fields
    per_mass = np.zeros(len(fields["masses"]))
    for end in ends:
        per_mass += np.bincount(end, fields["damping"], minlength=len(per_mass))
    per_mass /= fields["masses"]
    return largest(per_mass[ends[0]] + per_mass[ends[1]], strip.counts)


def certainly_unstable(strip: Strip, dt: np.ndarray, integrator: str) -> np.ndarray:
    """Robots whose springs are sure to blow up with the steps ``dt``, shape (n,) bool.

    At rest the springs reach at least the frequency sqrt(k (1/m_i + 1/m_j)) of every spring, by
    Rayleigh's quotient along it.
    """
    fields = strip.fields
    w = 1.0 / fields["masses"]
    if "bond_table" in fields:  # what is held may be as good as infinitely heavy
        w = np.where((fields["bond_table"][:, :3] == 1.0).all(axis=1), w, 0.0)
    ends = _sum_of_ends(strip, w)
    squares = _softest(fields).reshape(-1, ends.shape[1]) * ends if ends.size else np.zeros(0)
    certain = np.sqrt(largest(squares.ravel(), strip.counts))
    return certain * dt > _limit(np.zeros(1), integrator)


def _sum_of_ends(strip: Strip, values: np.ndarray) -> np.ndarray:
    """What the two masses of each spring have together, from values of all masses.

    Robots of one topology have a row each, (n, S), or (1, S) where all have the same; others are
    one row.
    """
    if not strip.shared:
        start, end = strip.ends
        return (values[start] + values[end])[None]
    start, end = strip.springs.T
    rows = values.reshape(len(strip.ids), -1)
    if (rows == rows[0]).all():  # the controllers of one body
        rows = rows[:1]
    return rows[:, start] + rows[:, end]


def _positive(values: np.ndarray) -> np.ndarray:
    return np.maximum(values, np.finfo(float).tiny)


def _limit(share: np.ndarray, integrator: str) -> np.ndarray:
    """The largest stable phase sqrt(ws^2 + wg^2) dt, where tan(share) = wg / ws.

    From a table of shares, of which only the rows are worked out that somebody needs: the whole
    takes longer than to load the kernels.
    """
    cell = np.clip(np.searchsorted(_SHARES, share, side="right") - 1, 0, len(_SHARES) - 2)
    rows = np.unique(np.concatenate([np.zeros(1, int), cell, cell + 1]))
    limits = np.zeros(len(_SHARES))
    limits[rows] = [_limit_of_row(row, integrator) for row in rows.tolist()]
    return np.where(share <= 0.0, limits[0], np.minimum(limits[cell], limits[cell + 1]))


_SHARES = np.linspace(0.0, np.pi / 2, 257)


@functools.cache
def _limit_of_row(row: int, integrator: str) -> float:
    """Stability of the linear test problem x'' = -(ws^2 + wg^2) x, springs kicking, ground exact.

    The map of one step is a product of kicks and drifts with determinant one: bounded while
    its trace stays within 2 in size.
    """
    phases = np.linspace(0.0, 8.0, 4001)[1:]
    springs, ground = np.cos(_SHARES[row]) * phases, np.sin(_SHARES[row]) * phases
    stable = np.abs(_trace(springs, ground, integrator)) <= 2.0 + 1e-9
    stable &= ground <= _LARGEST_GROUND_PHASE[integrator]
    first_unstable = len(phases) - 1 if stable.all() else int(np.argmin(stable))
    return float(phases[max(first_unstable - 1, 0)])


def _trace(springs: np.ndarray, ground: np.ndarray, integrator: str) -> np.ndarray:
    """Trace of the map of one step, for phases ws dt and wg dt."""

    def kick(strength):  # v -= strength * x, in units of dt
        one, none = np.ones_like(springs), np.zeros_like(springs)
        return np.stack([np.stack([one, none]), np.stack([-strength, one])])

    def drift(part):  # exact flow under the ground for a part of the step
        angle = ground * part
        sinc = part * np.sinc(angle / np.pi)
        return np.stack(
            [np.stack([np.cos(angle), sinc]), np.stack([-ground * np.sin(angle), np.cos(angle)])]
        )

    s = springs**2
    if integrator == "euler":
        steps = [
            kick(s + ground**2),
            np.stack([np.stack([1 + 0 * s, 1 + 0 * s]), np.stack([0 * s, 1 + 0 * s])]),
        ]
    elif integrator == "leapfrog":
        steps = [kick(s), drift(1.0)]
    else:
        steps = [kick(s / 3), drift(0.5), kick(2 / 3 * s * (1 - s / 24)), drift(0.5)]
    product = steps[0]
    for step in steps[1:]:
        product = np.einsum("ij...,jk...->ik...", step, product)
    return product[0, 0] + product[1, 1]
