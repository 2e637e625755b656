"""Every mass gathers its own springs: the passes that the flat and the block layout share.

C++ text over one *crowd*: robots that take the same step, their masses side by side in *slots*.
Each spring is computed from both of its ends, so that every mass sums its force alone, in an order
that depends on its robot only: no atomics, no scatter, the same bits in any company and with any
number of threads.

``SLICE`` slots with consecutive numbers, all of one robot, form a *slice*; a robot's last slice is
padded. The springs of a slice lie as ``[length][slot]``, so that neighbouring threads of a GPU, or
the lanes of a register, read neighbouring words. Where a mass has fewer springs than the best
connected of its slice, springs from the mass to itself fill up, which do not pull.

Positions are quads (x, y, z, inverse mass), in two buffers: a pass reads one and writes the other.
Padding has the inverse mass 0.

What a layout must add to ``passes``: ``slices``, which slices are its own; ``velocity`` and
``keep_velocity``, ``rest`` and ``keep_rest``, where it keeps them; ``now`` and ``then``, the two
buffers; ``flip``, the end of a pass for all.
"""

import functools
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_springs.kernels.buffers import (
    ENERGIES,
    REAL,
    WIDE,
    array_struct,
    real_dtype,
    real_type,
    struct_of,
    wide_dtype,
)
from warp_springs.kernels.crowd_collisions import CROWD_COLLIDING, NO_CROWD_COLLIDING
from warp_springs.kernels.dialect import (
    native_width,
    scalar_dialect,
    vector_dialect,
)
from warp_springs.kernels.features import CHECK_EVERY, Features, feature_flags
from warp_springs.kernels.law import CONSTANTS, LAW
from warp_springs.kernels.slot_loads import ENDS, SCALAR_LOADS, SLOT, vector_loads
from warp_springs.kernels.slot_passes import SLOT_PASSES

__all__ = [
    "CHUNK",
    "COLLISION_MODEL",
    "COLLISION_STATE",
    "LOOKS",
    "MODEL",
    "ROBOT",
    "SITE",
    "SLICE",
    "STATE",
    "GatherFeatures",
    "gather_structs",
    "lane_order",
    "passes",
    "run_type",
    "slice_width",
]

#: Slots of a slice on a GPU: 8 words of 4 bytes fill a sector, the least that memory delivers.
SLICE = 8

#: Columns of the table of robots.
ROBOT = (
    "first",  # first slot
    "masses",
    "place",  # where its positions start in what is seen, in the user's order
    "lane",  # its place where what is seen has one value a robot
    "chunk",  # first chunk, see kernels.look
    "chunks",
    "time",  # first of its timetable's times
    "times",
    "moments",  # for how many times all schedules have room
)
#: Columns of the table of slices.
SITE = (
    "robot",
    "list",  # first row of its list of neighbours
    "row",  # first row of its coefficients
    "length",  # rows
)
#: Columns of the table of chunks: runs of slots whose sums are taken together.
CHUNK = ("robot", "first", "count")

#: Values that are summed over the masses of a robot: mass, its moments, the energies, the ledger.
LOOKS = 4 + ENERGIES

#: What stays as it was packed; see ``kernels.buffers`` for the notation.
MODEL = {
    "robots": np.int32,
    "slices": np.int32,
    "chunks": np.int32,
    "neighbours": np.int32,  # four times the slot, counted from the robot's first
    "coefficients": REAL,  # k, h, or k, ha, hs, hc: N/m, N; then as kernels.springs says
    "spring_omegas": np.float64,  # of each end, rad/s, where springs have their own
    "times": np.float64,  # of each robot's timetable, and its period, s
    "schedules": REAL,  # of each end: factor of the stiffness, and what is added to h
    "homes": np.int32,  # the user's number of a slot's mass, -1 for padding
    "omegas": np.float64,  # rad/s
    "turns": REAL,  # cos(w dt), sin(w dt) of half a step of chin4, or of a step
    "reaches2": REAL,  # square of the length that stops a robot, m^2
    "obstacles": np.float64,  # see kernels.buffers
    "heights": np.float64,
    "outer_sites": np.int32,  # first row and rows of the pushes and tethers of each slice
    "outer_values": WIDE,  # [row][6][slot], the last: whether it is a tether
    "outer_windows": np.float64,  # [row][2][slot], s
    "skins": REAL,  # [slice][3][slot]
    "bonds": WIDE,  # [slice][10][slot]
    "quanta": REAL,  # in which the origin of a robot moves, m; in mixed precision
}
#: What stepping changes.
STATE = {
    "positions": REAL,  # two buffers of quads
    "velocities": REAL,  # [slice][3][slot], m/s
    "good_positions": REAL,  # at the last check that found the robot healthy
    "good_velocities": REAL,
    # In mixed precision: what a single number does not hold of them, the origins of the positions
    # and how they move.
    "low_positions": REAL,
    "low_velocities": REAL,
    "good_low_positions": REAL,
    "good_low_velocities": REAL,
    "origins": np.float64,  # m
    "shifts": REAL,  # m
    "rests": REAL,  # impulse left over for friction by each surface, within a step of chin4
    "ledgers": REAL,  # [slice][ACCOUNTS][slot], J
    "good_ledgers": REAL,
    "oscillators": REAL,  # two buffers of sin(wt), cos(wt) for each robot
    "spring_oscillators": REAL,  # sin(wt), cos(wt), cos(w dt), sin(w dt) of each end
    "worn": REAL,  # of each end: how far the spring has flowed, m, and 1, or 0 where it is broken
    "broken_at": np.float64,  # of each end, s
    "rates": REAL,  # quads: what the dashpots see of the velocities as a kick begins, m/s
    "middle_rates": REAL,  # and in the middle of it
    "states": np.int32,  # Status
    "state_times": np.float64,  # s
    "flags": np.int32,  # reasons to stop a robot, found by the check; and by a look
}
#: What collisions add to both, see kernels.crowd_collisions. Kernels without them do without: with
#: all arrays the parameters of a kernel are too large for the compiler to keep off the stack.
COLLISION_MODEL = {
    "features": np.int32,
    "meetings": np.int32,
    "leaf_features": np.int32,  # the leaves of the trees, -1 for padding
    "near_rows": np.int32,
    "nears": np.int32,
    "contacts": REAL,  # see kernels.contact
    "touch_rows": np.int32,  # where the features of the mass in each slot begin
    "touches": np.int32,  # three times the feature, plus its corner
}
COLLISION_STATE = {
    "boxes": REAL,  # [node][6]
    "partners": np.int32,  # [feature][ROOM]
    "partner_counts": np.int32,
    "fitted_positions": REAL,  # quads, where the trees were fitted
    "stale": np.int32,  # whether the tree of each robot must be fitted anew
    "grip_partners": np.int32,  # see kernels.contact
    "grips": REAL,
    "touched": np.int32,  # whether each feature touches another
    "feature_forces": REAL,  # forces on its masses [3][3], energy, power of its two losses
}


@dataclass(frozen=True)
class GatherFeatures(Features):
    """What a kernel of a crowd is compiled for; ``width`` is the number of slots of a slice.

    Attributes:
        layout: ``"threads"``, ``"launches"`` or ``"block"``, see the modules of these names.
    """

    layout: str = "launches"

    @property
    def vector(self) -> bool:
        """Whether the slots of a slice are the lanes of a register, not threads."""
        return self.layout == "threads"

    @property
    def name(self) -> str:
        """A name for the module, with everything the code depends on."""
        return super().name.replace("_lanes_", "_gather_")

    @property
    def together(self) -> int:
        """Springs whose coefficients fill 16 bytes, which a GPU loads at once."""
        small = real_dtype(self.precision).itemsize == 4
        plain = not self.actuated and not self.traits.special
        return 2 if small and not self.vector and plain else 1


def slice_width(layout: str, precision: str) -> int:
    """Slots of a slice."""
    return max(4, native_width(precision)) if layout == "threads" else SLICE


def lane_order(features: GatherFeatures) -> list[int]:
    """The lane of each slot of a slice: how quads in memory order come out transposed."""
    if not features.vector:
        return list(range(features.width))
    rows = features.width // 4
    return [4 * (slot % rows) + slot // rows for slot in range(features.width)]


@functools.cache
def run_type(precision: str) -> type:
    """The struct of the constants of a crowd's steps."""
    real = real_type(precision)
    fields = dict.fromkeys(CONSTANTS, real) | {"exact_dt": wp.float64, "substeps": wp.int32}
    return struct_of("Run", fields)


def passes(features: GatherFeatures) -> str:
    """C++ text: the number type, the law, a slice's springs, its passes and its health."""
    flags = feature_flags(features)
    sizes = {"SLICE": features.width, "TOGETHER": features.together, "CHECK_EVERY": CHECK_EVERY}
    sizes |= {f"{name.upper()}_COLUMNS": len(table) for name, table in _TABLES.items()}
    lines = [f"const int {name} = {value};" for name, value in sizes.items()]
    lines += [f"const scalar {name} = run.{name};" for name in CONSTANTS]
    lines += ["const double exact_dt = run.exact_dt;"]
    lines += ["double instant = 0;  // at which timetables are read [s]"]
    lines += ["auto begin_step = [&](double now) { instant = now; };"]
    lines += ["auto middle_of_step = begin_step;"]
    lines += ["const double* const obstacles = model.obstacles.data;"]
    lines += ["const double* const heights = model.heights.data;"]
    if features.vector:
        dialect = vector_dialect(features.precision, features.width)
        loads = vector_loads(features.width)
    else:
        dialect, loads = scalar_dialect(features.precision), SCALAR_LOADS
    colliding = CROWD_COLLIDING if features.traits.colliding else NO_CROWD_COLLIDING
    slots = SLOT_PASSES.replace(_COLLISIONS, colliding)
    collides = f"#define COLLIDES {int(features.traits.colliding)}\n"
    return (
        collides + dialect + flags + "\n".join(lines) + _ORIGIN + LAW + SLOT + loads + ENDS + slots
    )


# Where collisions have their place in the text.
_COLLISIONS = "// collisions\n"


_TABLES = {"robot": ROBOT, "site": SITE, "chunk": CHUNK}


# The origin of the robot's positions, as the law sees it.
_ORIGIN = r"""
real origins_here[3] = {};
wide far_origins_here[3] = {};
real* const origin = origins_here;
wide* const far_origin = far_origins_here;
auto look_up_origin = [=](int robot) {
    for (int c = 0; MIXED && c < 3; ++c) {
        far_origin[c] = wide_zero + wide_scalar(state.origins.data[3 * robot + c]);
        origin[c] = narrow(far_origin[c]);
    }
};
"""


@functools.cache
def gather_structs(precision: str, colliding: bool) -> tuple[type, type]:
    """The structs of what stays and of what stepping changes."""

    def struct(name: str, table: dict) -> type:
        known = {REAL: real_dtype(precision), WIDE: wide_dtype(precision)}
        kinds = {key: np.dtype(known.get(kind, kind)) for key, kind in table.items()}
        return array_struct(name, kinds)

    if not colliding:
        return struct("Crowd", MODEL), struct("CrowdState", STATE)
    return (
        struct("CollidingCrowd", MODEL | COLLISION_MODEL),
        struct("CollidingCrowdState", STATE | COLLISION_STATE),
    )
