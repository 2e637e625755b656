"""Which elements of their own the robots of a group have: what else their kernel must do."""

from __future__ import annotations

from dataclasses import dataclass, fields

__all__ = ["PLAIN", "Traits"]


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


PLAIN = Traits()
