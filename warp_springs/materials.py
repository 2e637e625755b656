"""Materials of springs, and the table of friction coefficients of pairs of surfaces.

    body = ws.shapes.lattice(4, 1, 1)
    body = body.made_of(ws.materials.TISSUE)
    body = body.made_of(ws.materials.MUSCLE, where=lambda middles: middles[:, 2] < 0.05)

A material is what a spring is made of: its stiffness, whether it breathes, its density and its
colour. `Robot.made_of` applies one to all springs or to some, `Robot.weighed` makes the masses
follow from the densities, and views colour springs by it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from warp_springs.checks import check_number
from warp_springs.geometry import FloatArray

if TYPE_CHECKING:
    from warp_springs.robot import Robot

__all__ = [
    "BONE",
    "BUILT_IN",
    "FRICTION",
    "MUSCLE",
    "MUSCLE2",
    "NYLON",
    "TISSUE",
    "Friction",
    "Material",
]

COURSE_OMEGA = 2.0 * math.pi
"""Angular frequency [rad/s] of a robot whose first muscle does not find one."""


def linear_rgb(color: str, name: str = "color") -> tuple[float, float, float]:
    """Linear RGB in 0 ... 1 of an sRGB colour ``"#rrggbb"``, which a ValueError refuses by name."""
    if not isinstance(color, str) or not re.fullmatch("#[0-9a-fA-F]{6}", color):
        raise ValueError(f"{name}: got {color!r}, expected '#rrggbb'")
    shares = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return tuple(s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares)


@dataclass(frozen=True)
class Material:
    """What springs are made of.

    Give either ``stiffness``, the same for springs of any length, or ``modulus`` and ``section``
    for bars: a bar of length L then has the stiffness E A / L.

    Attributes:
        name: What it is called, not empty.
        stiffness: k [N/m], or ``None`` for bars.
        modulus: Young's modulus E [Pa], or ``None``.
        section: Cross-section A [m^2], or ``None``. With a density it also weighs the bars.
        density: [kg/m^3], or ``None`` where it does not matter.
        strain: Amplitude of the rest length as a share of it: 0 for what does not breathe.
        phase: Phase of the breathing [rad]: 0 expands first, pi contracts first.
        color: sRGB as ``"#rrggbb"``.
    """

    name: str
    stiffness: float | None = None
    modulus: float | None = None
    section: float | None = None
    density: float | None = None
    strain: float = 0.0
    phase: float = 0.0
    color: str = "#b9bcc0"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"Material.name: got {self.name!r}, expected a name")
        for field in ("stiffness", "modulus", "section", "density"):
            if getattr(self, field) is not None:
                check_number(f"{self.name}.{field}", getattr(self, field), above=0.0)
        for field in ("strain", "phase"):
            check_number(f"{self.name}.{field}", getattr(self, field), above=-math.inf)
        if (self.stiffness is None) == (self.modulus is None):
            raise ValueError(
                f"{self.name}: give either stiffness [N/m], or modulus [Pa] and section [m^2]"
            )
        if self.modulus is not None and self.section is None:
            raise ValueError(f"{self.name}: a modulus needs a section [m^2]: k = E A / L")
        linear_rgb(self.color, f"{self.name}.color")

    def stiffness_of(self, lengths: ArrayLike) -> FloatArray:
        """Stiffness [N/m] of springs of some lengths [m], same shape: k, or E A / L.

        Raises:
            ValueError: A bar has no length.
        """
        lengths = np.asarray(lengths, np.float64)
        if self.stiffness is not None:
            return np.full(lengths.shape, self.stiffness)
        if lengths.size and not lengths.min() > 0.0:
            raise ValueError(f"{self.name}: a bar of length 0 m has no stiffness E A / L")
        return self.modulus * self.section / lengths

    @property
    def rgb(self) -> tuple[float, float, float]:
        """The colour as linear RGB in 0 ... 1, as renderers want it."""
        return linear_rgb(self.color)


TISSUE = Material("tissue", stiffness=1_000.0, density=1_060.0, color="#e8b49c")
"""Soft support."""
BONE = Material("bone", stiffness=20_000.0, density=1_900.0, color="#f2ead3")
"""Hard support."""
MUSCLE = Material("muscle", stiffness=5_000.0, density=1_060.0, strain=0.25, color="#c8323c")
"""Expands by a quarter of its length, then contracts."""
MUSCLE2 = Material(
    "muscle2", stiffness=5_000.0, density=1_060.0, strain=0.25, phase=math.pi, color="#3b6fc4"
)
"""Contracts by a quarter of its length, then expands."""
NYLON = Material(
    "nylon", modulus=2.7e9, section=math.pi / 4.0 * 1e-6, density=1_140.0, color="#dfe3e8"
)
"""Bars of polyamide 6.6, 1 mm thick; for another thickness ``dataclasses.replace`` the section."""

BUILT_IN: Mapping[str, Material] = {m.name: m for m in (BONE, TISSUE, MUSCLE, MUSCLE2, NYLON)}
"""The materials above by name."""

Region = ArrayLike | Callable[[FloatArray], ArrayLike]
"""Springs of a robot: a mask, indices, a box, or a function of their middles."""


def apply(robot: Robot, material: Material, where: Region | None) -> Robot:
    """The robot with some springs made of a material: see `Robot.made_of`."""
    if not isinstance(material, Material):
        raise TypeError(f"material: got {material!r}, expected a Material")
    chosen = slice(None) if where is None else _chosen(robot, where)
    table = robot.materials
    if material not in table:
        table = (*table, material)
    changes = {
        "stiffness": material.stiffness_of(robot.rest_length[chosen]),
        "amplitude": material.strain * robot.rest_length[chosen],
        "phase": material.phase,
        "material": table.index(material),
    }
    fields = {}
    for name, values in changes.items():
        fields[name] = getattr(robot, name).copy()
        fields[name][chosen] = values
    if material.strain and robot.omega == 0.0:
        fields["omega"] = COURSE_OMEGA
    return robot.replace(materials=table, **fields)


def weigh(robot: Robot) -> Robot:
    """The robot with the masses that its materials give it: see `Robot.weighed`."""
    if robot.n_springs == 0 or (robot.material < 0).any():
        raise ValueError("weighed: every spring needs a material; see Robot.made_of")
    used = [robot.materials[i] for i in np.unique(robot.material)]
    if without := [m.name for m in used if m.density is None]:
        raise ValueError(f"weighed: {without[0]} has no density [kg/m^3]")
    density = _per_spring(robot, "density")
    if all(m.section is not None for m in used):
        weight = density * _per_spring(robot, "section") * robot.rest_length
    elif any(m.section is not None for m in used):
        raise ValueError("weighed: some materials have a section, others have none")
    elif not robot.volume > 0.0:
        raise ValueError(
            "weighed: the materials have no section [m^2] and the faces enclose no volume"
        )
    else:
        weight = density * (robot.volume / robot.n_springs)
    ends = robot.springs.ravel()
    masses = np.bincount(ends, np.repeat(0.5 * weight, 2), minlength=robot.n_masses)
    if not masses.min() > 0.0:
        raise ValueError(f"weighed: mass {int(masses.argmin())} has no spring with a length")
    return robot.replace(masses=masses)


def _per_spring(robot: Robot, name: str) -> FloatArray:
    """A property of the material of each spring, (S,); NaN where it has none."""
    values = [getattr(m, name) for m in robot.materials]
    return np.array([np.nan if v is None else v for v in values])[robot.material]


def _chosen(robot: Robot, where: Region) -> np.ndarray:
    """The springs that a region selects, as a mask (S,) or as indices."""
    middles = robot.positions[robot.springs].mean(axis=1)
    chosen = np.asarray(where(middles) if callable(where) else where)
    if chosen.shape == (2, 3) and chosen.dtype.kind == "f":
        return ((middles >= chosen[0]) & (middles <= chosen[1])).all(axis=1)
    if chosen.size == 0:
        return np.zeros(0, np.intp)
    good = chosen.dtype == np.bool_ and chosen.shape == (robot.n_springs,)
    if chosen.dtype.kind in "iu" and chosen.ndim == 1:
        good = -robot.n_springs <= chosen.min() and chosen.max() < robot.n_springs
    if not good:
        raise ValueError(
            f"where: an array of {chosen.dtype}, shape {chosen.shape} given; expected a mask "
            f"({robot.n_springs},), indices below {robot.n_springs}, the two corners of a box "
            "(2, 3) as real numbers, or a function of the middles (S, 3) that returns one of them"
        )
    return chosen


class Friction(NamedTuple):
    """Coefficients of friction of two surfaces."""

    static: float
    """mu_s, below which they stick."""
    kinetic: float
    """mu_k, with which they slide."""


class FrictionTable(Mapping):
    """Coefficients by pairs of surfaces, in either order, capitals or not.

    ``FRICTION["rubber", "concrete"]`` is ``Friction(static=1.0, kinetic=0.8)``.
    """

    def __init__(self, rows: Mapping[tuple[str, str], Friction]) -> None:
        self._rows = dict(rows)
        self._known = {_pair(key): value for key, value in self._rows.items()}

    def __getitem__(self, surfaces: tuple[str, str]) -> Friction:
        try:
            return self._known[_pair(surfaces)]
        except (KeyError, TypeError, ValueError, AttributeError):
            known = "; ".join(f"{a} on {b}" for a, b in self._rows)
            raise KeyError(f"no friction of {surfaces!r}; known pairs: {known}") from None

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)


def _pair(surfaces: tuple[str, str]) -> frozenset[str]:
    first, second = surfaces
    return frozenset((first.lower(), second.lower()))


FRICTION = FrictionTable(
    {
        ("steel", "steel"): Friction(0.74, 0.57),
        ("aluminium", "steel"): Friction(0.61, 0.47),
        ("copper", "steel"): Friction(0.53, 0.36),
        ("rubber", "concrete"): Friction(1.0, 0.8),
        ("wood", "wood"): Friction(0.375, 0.2),  # static 0.25 to 0.50: the middle
        ("glass", "glass"): Friction(0.94, 0.4),
        ("waxed wood", "wet snow"): Friction(0.14, 0.10),
        ("waxed wood", "dry snow"): Friction(0.01, 0.04),  # kinetic above static, as printed
        ("lubricated metal", "lubricated metal"): Friction(0.15, 0.06),
        ("ice", "ice"): Friction(0.10, 0.03),
        ("Teflon", "Teflon"): Friction(0.04, 0.04),
        ("synovial joint", "synovial joint"): Friction(0.01, 0.003),
    }
)
"""Coefficients of twelve pairs of surfaces: static and kinetic."""
