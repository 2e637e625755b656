"""The world a robot lives in. What is ``None`` or zero costs nothing: it is not compiled in."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass
from typing import Literal

from warp_springs.checks import check_choice, check_number
from warp_springs.materials import FRICTION

__all__ = ["Ground", "Scene", "damping_rate"]


def damping_rate(per_step: float, dt: float) -> float:
    """Damping rate [1/s] that multiplies velocities by ``per_step`` every ``dt`` seconds.

    Classrooms damp by a factor a step (0.9999 at dt = 1e-4, say), which makes the result depend on
    the step; ``v *= exp(-rate * dt)`` with ``rate = -ln(per_step) / dt`` does not.

    Raises:
        ValueError: ``per_step`` is not in (0, 1] or ``dt`` is not positive.
    """
    if not 0.0 < per_step <= 1.0:
        raise ValueError(f"per_step: got {per_step!r}, expected a factor in (0, 1]")
    check_number("dt", dt, above=0.0)
    return -math.log(per_step) / dt


@dataclass(frozen=True)
class Ground:
    """The plane z = 0, an elastic floor with friction.

    Attributes:
        stiffness: K_G [N/m]; a mass at height z < 0 is pushed up by -K_G z.
        static_friction: Coefficient mu_s below which a mass sticks.
        kinetic_friction: Coefficient mu_k with which a mass slides.
        friction: ``"coulomb"`` (impulses against velocity: exact stick, exact sliding distance) or
            ``"course"`` (the classroom's rule, horizontal force against normal force: below
            mu_s F_n the horizontal force is zeroed and the mass stops, above it the force is
            reduced by mu_k F_n).

    Both coefficients zero: no friction is computed. Where they are left out they are those of
    ``material``, two surfaces of ``ws.materials.FRICTION``: rubber on concrete by default.

    Raises:
        ValueError: A number is out of range, or both ``material`` and a coefficient are given.
        KeyError: The table does not hold the two surfaces.
    """

    stiffness: float = 1e5
    static_friction: float = None  # type: ignore[assignment]  # a number once it is made
    kinetic_friction: float = None  # type: ignore[assignment]
    friction: Literal["coulomb", "course"] = "coulomb"
    material: InitVar[tuple[str, str] | None] = None

    def __post_init__(self, material: tuple[str, str] | None) -> None:
        pair = FRICTION[material or ("rubber", "concrete")]
        for name, value in pair._asdict().items():
            given = getattr(self, f"{name}_friction")
            if given is None:
                object.__setattr__(self, f"{name}_friction", value)
            elif material is not None:
                raise ValueError(
                    f"Ground.{name}_friction: got {given!r} and material={material!r}; the "
                    "material decides both coefficients, so give one or the other"
                )
        check_number("Ground.stiffness", self.stiffness, above=0.0)
        check_number("Ground.static_friction", self.static_friction, at_least=0.0)
        check_number("Ground.kinetic_friction", self.kinetic_friction, at_least=0.0)
        check_choice("Ground.friction", self.friction, ("coulomb", "course"))

    @property
    def has_friction(self) -> bool:
        """Whether any coefficient is above zero."""
        return self.static_friction > 0.0 or self.kinetic_friction > 0.0


@dataclass(frozen=True)
class Scene:
    """Gravity, ground, damping and drag, the same for every robot of a batch.

    Attributes:
        gravity: Acceleration [m/s^2], shape (3,); tilt it for a slope.
        ground: The floor at z = 0, or ``None`` for free space.
        damping: Rate [1/s]; velocities decay as exp(-damping t). See ``damping_rate``.
        drag: c [kg/m] of the quadratic drag -c |v| v on every mass.
    """

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    ground: Ground | None = Ground()
    damping: float = 0.0
    drag: float = 0.0

    def __post_init__(self) -> None:
        try:
            gravity = tuple(float(g) for g in self.gravity)
        except (TypeError, ValueError):
            gravity = ()
        if len(gravity) != 3 or not all(map(math.isfinite, gravity)):
            raise ValueError(
                f"Scene.gravity: got {self.gravity!r}, expected three finite numbers [m/s^2]"
            )
        object.__setattr__(self, "gravity", gravity)
        if self.ground is not None and not isinstance(self.ground, Ground):
            raise TypeError(f"Scene.ground: got {self.ground!r}, expected a Ground or None")
        check_number("Scene.damping", self.damping, at_least=0.0)
        check_number("Scene.drag", self.drag, at_least=0.0)
