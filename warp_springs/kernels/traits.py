"""Which elements of their own the robots of a group have: what else their kernel must do."""

from __future__ import annotations

from dataclasses import dataclass, fields

__all__ = ["MERGED", "PLAIN", "Traits"]


@dataclass(frozen=True)
class Traits:
    """Elements of the robots of a group; see ``warp_springs.body.elements``.

    Attributes:
        outer: Pushes or tethers.
        skin: Friction or stiffness of contact of single masses.
        bound: Constraints.
        harmonics: How many beyond the first.
        own_omegas: An angular frequency of each spring.
        curved: A cubic term, or hinges.
        hinges: How many of a spring.
        dashpots: Damping of springs.
        limits: Breaking or yielding.
        timetable: Stiffness and rest length in time.
        colliding: Collisions; bundles are then of one robot, or of one world.
        merged: Not an element, but bundles of robots of different topologies: a lane may lack a
            mass, which then has no inverse mass, or a spring, which has no stiffness.
    """

    outer: bool = False
    skin: bool = False
    bound: bool = False
    harmonics: int = 0
    own_omegas: bool = False
    curved: bool = False
    hinges: int = 0
    dashpots: bool = False
    limits: bool = False
    timetable: bool = False
    colliding: bool = False
    merged: bool = False

    @property
    def special(self) -> bool:
        """Whether springs have more to them than k and L0."""
        some = (self.harmonics, self.own_omegas, self.curved, self.dashpots)
        return any((*some, self.limits, self.timetable))

    def columns(self, actuated: bool) -> int:
        """Coefficients of a spring, see ``kernels.springs``."""
        curve = 2 + 2 * self.hinges if self.curved else 0
        plain = 4 if actuated else 2
        return plain + 2 * self.harmonics + curve + int(self.dashpots) + 2 * int(self.limits)

    @property
    def name(self) -> str:
        """What is present, in short: part of the name of a module."""
        present = [(field.name, getattr(self, field.name)) for field in fields(self)]
        return "_".join(f"{name}{int(value)}" for name, value in present if value) or "plain"

    @property
    def flags(self) -> str:
        """C++ constants, one for each trait, in capitals."""
        lines = []
        for field in fields(self):
            value = getattr(self, field.name)
            kind = "bool" if isinstance(value, bool) else "int"
            lines.append(f"const {kind} {field.name.upper()} = {str(value).lower()};")
        return "\n".join(lines)


PLAIN, MERGED = Traits(), Traits(merged=True)
