"""The world a robot lives in. What is ``None`` or zero costs nothing: it is not compiled in."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass
from typing import Literal

from warp_springs.body.fields import require_vector
from warp_springs.checks import check_choice, check_number
from warp_springs.materials import FRICTION
from warp_springs.surfaces import Box, HeightField, Plane, Sphere

__all__ = ["Collisions", "Ground", "Scene", "Water", "damping_rate"]

OBSTACLES = (Plane, Sphere, Box, HeightField)


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
class Water:
    """Water below a level: buoyancy against gravity, and a drag of its own.

    Attributes:
        level: Height of its surface [m].
        density: Density of the water as a multiple of that of the robots: below 1 they sink,
            above 1 they float. A mass m that is wholly immersed is lifted by density m g.
        drag: c [kg/m] of the quadratic drag -c |v| v on every mass, besides the scene's own.
        layer: Way [m] over which a mass that dives goes from dry to wholly immersed, half of it
            below the level.
    """

    level: float = 0.0
    density: float = 1.0
    drag: float = 0.0
    layer: float = 0.02

    def __post_init__(self) -> None:
        check_number("Water.level", self.level, at_least=-math.inf)
        check_number("Water.density", self.density, at_least=0.0)
        check_number("Water.drag", self.drag, at_least=0.0)
        check_number("Water.layer", self.layer, above=0.0)

    def stiffness(self, gravity: tuple[float, float, float]) -> float:
        """Of the buoyancy at the surface, for each kg of a mass [1/s^2]."""
        return abs(self.density * gravity[2]) / self.layer


@dataclass(frozen=True)
class Collisions:
    """Masses against triangles and edges against edges, of one body and of bodies in one world.

    Where two come closer than ``thickness`` a temporary spring pushes them apart; it vanishes
    when they part. Features that share a mass, or that a spring joins, do not collide.
    Friction is a second such spring, along the surface, between the two points that met first: what
    sticks stays where it is, what slides does so under mu_k.

    Attributes:
        thickness: Distance [m] that surfaces keep; 0: 4 % of the median length of the springs.
        stiffness: Of the temporary springs [N/m].
        static_friction: Coefficient mu_s below which two surfaces do not slide.
        kinetic_friction: Coefficient mu_k with which they slide.
        damping: Of the temporary springs, as a part of critical damping; of all that push at once
            where corners meet, together.
        within: Whether a body also collides with itself.
    """

    thickness: float = 0.0
    stiffness: float = 1e5
    static_friction: float = 1.0
    kinetic_friction: float = 0.8
    damping: float = 0.1
    within: bool = True

    def __post_init__(self) -> None:
        check_number("Collisions.thickness", self.thickness, at_least=0.0)
        check_number("Collisions.stiffness", self.stiffness, above=0.0)
        check_number("Collisions.static_friction", self.static_friction, at_least=0.0)
        check_number("Collisions.kinetic_friction", self.kinetic_friction, at_least=0.0)
        check_number("Collisions.damping", self.damping, at_least=0.0)

    @property
    def has_friction(self) -> bool:
        """Whether any coefficient is above zero."""
        return self.static_friction > 0.0 or self.kinetic_friction > 0.0


@dataclass(frozen=True)
class Scene:
    """Gravity, ground, obstacles, wind, water, damping and drag, the same for all robots.

    Attributes:
        gravity: Acceleration [m/s^2], shape (3,); tilt it for a slope.
        ground: The floor at z = 0, or ``None`` for free space.
        damping: Rate [1/s]; velocities decay as exp(-damping t). See ``damping_rate``.
        drag: c [kg/m] of the quadratic drag -c |v| v on every mass.
        wind: Velocity [m/s] of the air, shape (3,), or ``None``: the drag is then relative to it.
        water: A ``Water``, or ``None``.
        obstacles: ``ws.Plane``, ``ws.Sphere``, ``ws.Box`` and ``ws.HeightField`` objects.
        collisions: ``Collisions``, or ``None``: bodies then pass through each other.
    """

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    ground: Ground | None = Ground()
    damping: float = 0.0
    drag: float = 0.0
    wind: tuple[float, float, float] | None = None
    water: Water | None = None
    obstacles: tuple[Plane | Sphere | Box | HeightField, ...] = ()
    collisions: Collisions | None = None

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
        self._check_surroundings()

    @property
    def stiffest_surface(self) -> float:
        """Stiffness of the stiffest of the ground and the obstacles [N/m]; 0 without any."""
        return max(self._surface_stiffness, default=0.0)

    @property
    def _surface_stiffness(self) -> list[float]:
        ground = () if self.ground is None else (self.ground,)
        return [surface.stiffness for surface in (*ground, *self.obstacles)]

    @property
    def corner_stiffness(self) -> float:
        """Of the stiffest corner that surfaces may form: the three stiffest together [N/m]."""
        return sum(sorted(self._surface_stiffness)[-3:])

    def _check_surroundings(self) -> None:
        if self.wind is not None:
            wind = require_vector("Scene.wind", self.wind)
            object.__setattr__(self, "wind", tuple(wind.tolist()))
            if self.drag == 0.0:
                raise ValueError("Scene.wind: a wind without drag has no force; give drag too")
        for name, kind in (("water", Water), ("collisions", Collisions)):
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                raise TypeError(f"Scene.{name}: got {value!r}, expected a {kind.__name__} or None")
        given = (self.obstacles,) if isinstance(self.obstacles, OBSTACLES) else self.obstacles
        object.__setattr__(self, "obstacles", tuple(given))
        if self.obstacles and self.ground is not None and self.ground.friction == "course":
            raise ValueError(
                "Ground.friction: the classroom's rule is for a flat ground alone; with obstacles "
                "use 'coulomb'"
            )
        for index, obstacle in enumerate(self.obstacles):
            if not isinstance(obstacle, OBSTACLES):
                raise TypeError(
                    f"Scene.obstacles[{index}]: got {type(obstacle).__name__}, expected a Plane, "
                    "Sphere, Box or HeightField"
                )
