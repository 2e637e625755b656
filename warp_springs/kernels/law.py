"""The physics, each formula once, as C++ that every layout instantiates for its own number type.

A layout puts in front of ``LAW`` a dialect that defines

========================  ======================================================================
``scalar``                the floating-point type
``real``                  what a formula computes with: a vector of lanes, or one ``scalar``
``mask``                  what a comparison of two ``real`` gives
``select(m, a, b)``       ``m ? a : b``, lane by lane
``any(m)``                true if any lane of ``m`` is
``square_root(a)``        IEEE square root
``wide``                  what holds a place in the world, with ``wide_scalar`` and ``wide_mask``:
                          in mixed precision float64, else the same as ``real``
``narrow``, ``widen``     from one to the other
``less_over_root(k, h,    k - 2 h / sqrt(a), the root to the last bit or two, for a >= TINY
a)``
``MIXED``                 a macro, 0 or 1: whether positions and velocities are sums of two numbers,
                          the positions about ``origin[3]``, pointed to, of type ``real``
========================  ======================================================================

and the constants of ``CONSTANTS`` as ``const scalar``, the compile-time ``const bool`` of the
features, and CHECK_EVERY, the steps from one look at the health to the next. What a scene lacks is
a ``false`` there, and the compiler drops its code.

Its parts are ``sums``, ``own``, ``springs``, ``ground``, ``obstacles``, ``accounts``, ``motion``.

Units are SI; ``w`` is the inverse of a mass [1/kg].
"""

from __future__ import annotations

import math

from warp_springs.kernels.accounts import ACCOUNTS
from warp_springs.kernels.ground import GROUND
from warp_springs.kernels.motion import MOTION
from warp_springs.kernels.obstacles import MEETING, TOUCHING
from warp_springs.kernels.own import BINDING, OWN
from warp_springs.kernels.springs import SPRINGS
from warp_springs.kernels.sums import SUMS

__all__ = ["CONSTANTS", "DRIFTS", "EVALUATIONS", "LAW", "constants"]

# Host and kernel read the constants of a run from one array, in this order.
CONSTANTS = (
    "dt",  # step [s]
    "span",  # one drift [s]
    "loss",  # 1 - exp(-damping span / 2): what damping takes over half a drift
    "gravity_x",  # [m/s^2]
    "gravity_y",
    "gravity_z",
    "ground_stiffness",  # K_G [N/m]
    "static_friction",
    "kinetic_friction",
    "drag",  # c of the drag -c |v| v [kg/m]
    "speed_limit",  # beyond it a robot is stopped [m/s]
    "depth_limit",  # [m]
    "wind_x",  # velocity of the air [m/s]
    "wind_y",
    "wind_z",
    "water_level",  # [m]
    "water_layer",  # way over which a mass dives [m]
    "water_lift",  # acceleration of a mass that is wholly immersed [m/s^2]
    "water_drag",  # [kg/m]
)


#: Drifts in a step of each integrator, and times it computes the spring forces.
DRIFTS = {"euler": 1, "leapfrog": 1, "chin4": 2}
EVALUATIONS = {"euler": 1, "leapfrog": 1, "chin4": 3}


def constants(scene, dt: float, integrator: str, limits) -> list[float]:
    """Values of ``CONSTANTS`` for a scene, in float64."""
    ground = scene.ground
    water = scene.water
    span = dt / DRIFTS[integrator]
    return [
        dt,
        span,
        -math.expm1(-0.5 * scene.damping * span),
        *scene.gravity,
        ground.stiffness if ground else 0.0,
        ground.static_friction if ground else 0.0,
        ground.kinetic_friction if ground else 0.0,
        scene.drag,
        limits.speed,
        limits.depth,
        *(scene.wind or (0.0, 0.0, 0.0)),
        water.level if water else 0.0,
        water.layer if water else 1.0,
        -water.density * scene.gravity[2] if water else 0.0,
        water.drag if water else 0.0,
    ]


#: The whole, in the order in which one part builds on another.
LAW = SUMS + OWN + BINDING + SPRINGS + GROUND + TOUCHING + MEETING + ACCOUNTS + MOTION
