"""The robots and the world of a benchmark: the classroom's cubes and lattices on its ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_springs import shapes
from warp_springs.body.fields import FIELDS
from warp_springs.body.variants import Variants
from warp_springs.robot import Robot
from warp_springs.scene import Ground, Scene, damping_rate

__all__ = ["ALL_FEATURES", "BODIES", "DT", "FEATURES", "different", "scene_of", "variants"]

DT, OMEGA = 1e-4, 2.0 * np.pi
#: Voxels along x, y, z of each body: 28, 296 and 2,000 springs.
BODIES = {"cube": (1, 1, 1), "lattice": (4, 2, 2), "block": (8, 4, 4)}

#: What a scene or its robots may have. Friction needs a ground.
FEATURES = ("ground", "friction", "damping", "drag", "actuation")
#: The classroom's scene has all but drag.
ALL_FEATURES = ("ground", "friction", "damping", "actuation")

PER_SPRING = tuple(name for name, field in FIELDS.items() if field.per == "spring")


def scene_of(features: Sequence[str] = ALL_FEATURES) -> Scene:
    """A world with these features: the classroom's ground and friction, 0.9999 kept a step."""
    ground = None
    if "ground" in features:
        coefficients = (
            {}
            if "friction" in features
            else dict.fromkeys(("static_friction", "kinetic_friction"), 0.0)
        )
        ground = Ground(friction="course", **coefficients)
    return Scene(
        ground=ground,
        damping=damping_rate(0.9999, DT) if "damping" in features else 0.0,
        drag=0.05 if "drag" in features else 0.0,
    )


def variants(body: str, robots: int, features: Sequence[str] = ALL_FEATURES) -> Variants:
    """Robots of one body that land in the first milliseconds.

    Every spring has a stiffness of its own, and with ``"actuation"`` an amplitude and a phase.
    Robot i is the same in a population of any size.
    """
    one = shapes.lattice(*BODIES[body]).moved((0.0, 0.0, 0.0005))
    shape = (robots, one.n_springs)

    def drawn(field: int, low: float, high: float) -> np.ndarray:
        return np.random.default_rng([7, field]).uniform(low, high, shape)

    fields = {"stiffness": one.stiffness * drawn(0, 0.8, 1.2)}
    if "actuation" in features:
        fields["amplitude"] = one.rest_length * drawn(1, 0.05, 0.1)
        fields["phase"] = drawn(2, 0.0, 2.0 * np.pi)
        fields["omega"] = np.full(robots, OMEGA)
    return one.variants(**fields)


def different(body: str, robots: int, features: Sequence[str] = ALL_FEATURES) -> list[Robot]:
    """The same robots, but each lacks two springs of its own: none shares its topology."""
    found = []
    for index, robot in enumerate(variants(body, robots, features)):
        count = robot.n_springs
        kept = np.delete(np.arange(count), [index % count, (index // count + index + 1) % count])
        found.append(robot.replace(**{name: getattr(robot, name)[kept] for name in PER_SPRING}))
    return found
