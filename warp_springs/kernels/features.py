"""What a kernel is compiled for: the features of a group, and how C++ text sees them."""

from dataclasses import astuple, dataclass, replace

from warp_springs.kernels.buffers import ACCOUNTS, ENERGIES
from warp_springs.kernels.obstacles import RECORD
from warp_springs.kernels.traits import PLAIN, Traits

__all__ = ["CHECK_EVERY", "Features", "feature_flags"]

#: Health is checked, and the oscillators are set anew, every so many steps, counted from the start
#: of the simulation.
CHECK_EVERY = 64


@dataclass(frozen=True)
class Features:
    """What a kernel is compiled for; everything else is left out of it."""

    precision: str
    width: int
    actuated: bool
    ground: bool
    friction: str  # "none", "coulomb", "course"
    damping: bool
    drag: bool
    integrator: str
    wind: bool = False
    water: bool = False
    obstacles: int = 0  # how many, the ground among them
    traits: Traits = PLAIN
    ledger: bool = False  # whether energies are asked for

    @property
    def name(self) -> str:
        """A name for the module, with everything the code depends on."""
        values = [*astuple(replace(self, traits=None)), self.traits.name]
        return "warp_springs_lanes_" + "_".join(str(value).lower() for value in values)


def feature_flags(features: Features) -> str:
    """C++ text: the features as compile-time constants."""
    flags = {
        "ACTUATED": features.actuated,
        "GROUND": features.ground,
        "COULOMB": features.friction == "coulomb",
        "COURSE": features.friction == "course",
        "DAMPING": features.damping,
        "DRAG": features.drag,
        "EULER": features.integrator == "euler",
        "CHIN4": features.integrator == "chin4",
        "LEDGER": features.ledger,
        "WIND": features.wind,
        "WATER": features.water,
    }
    numbers = {
        "OBSTACLES": features.obstacles,
        "RECORD": RECORD,
        "ACCOUNTS": len(ACCOUNTS),
        "ENERGIES": ENERGIES,
    }
    lines = [f"const bool {name} = {str(on).lower()};" for name, on in flags.items()]
    lines += [f"const int {name} = {value};" for name, value in numbers.items()]
    lines += [features.traits.flags]
    lines += ["double kick_begin = 0, kick_end = 0;  // the time that a kick stands for"]
    return "\n".join(lines) + "\n"
