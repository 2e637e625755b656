"""The flat buffers, declared once: packing, allocation and kernels all read these tables."""

import functools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import warp as wp

__all__ = [
    "ACCOUNTS",
    "BUNDLE",
    "ENERGIES",
    "MODEL",
    "REAL",
    "SEEN",
    "STATE",
    "WIDE",
    "Structs",
    "array_struct",
    "dtype_of",
    "real_dtype",
    "real_type",
    "struct_of",
    "structs",
    "wide_dtype",
]

REAL = "real"  # what a run computes with
WIDE = "wide"  # what holds a place in the world: float64 in mixed precision

#: Columns of the table of bundles. Offsets count elements of the flat buffers.
BUNDLE = (
    "state",  # positions, velocities and their copies: [3 M][W]
    "mass",  # inverse masses: [M][W]
    "spring",  # spring coefficients: [S][2 or 4][W]
    "lane",  # one value a lane: [W]
    "row",  # row starts, M + 1 of them, counted from 0
    "partner",  # the higher mass of each spring, S of them
    "pair",  # how two rows at a time share their partners
    "masses",
    "springs",
    "substeps",  # of the contact flow
    "division",  # steps of this bundle in one step of the run
    "level",  # its row of the constants
    "outer_list",  # the mass of each push and tether: P + T
    "outer",  # their values: [P + T][5][W]
    "window",  # when they act: [P + T][2][W]
    "pushes",  # P
    "tethers",  # T
    "skin",  # [M][3][W]
    "bond",  # [M][10][W]
    "spring_list",  # the lower mass of each spring, S of them
    "own_omega",  # [S][W]
    "turning",  # [S][4][W]
    "time",  # T times of the timetable and its period
    "times",  # T
    "schedule",  # [S][T][2][W]
    "worn",  # [S][2][W]
    "broken",  # [S][W]
    "triangle",  # collisions: T triangles [3]
    "edge",  # E edges [2]
    "body",  # the body of each mass, M of them
    "near_row",  # where the neighbours of each mass begin, M + 1
    "near",  # the masses that springs join to each
    "pair_list",  # see kernels.collisions
    "grip_partner",
    "grip",
    "listed",  # [3 M]
    "contact",  # see kernels.contact
    "triangles",  # T
    "edges",  # E
    "capacity",  # pairs
)

#: Accounts of the ledger [J]: what a robot was given and lost since it was opened.
ACCOUNTS = (
    "work",
    "damping_loss",
    "drag_loss",
    "friction_loss",
    "outer_work",
    "dashpot_loss",
    "plastic_loss",
)
#: How many energies a look finds: kinetic, gravity, spring, ground, and the accounts.
ENERGIES = 4 + len(ACCOUNTS)

#: What stays as it was packed.
MODEL = {
    "bundles": np.int64,  # the table of bundles, row by row
    "constants": np.float64,  # a row for each size of step, see kernels.law
    "obstacles": np.float64,  # records of kernels.obstacles
    "heights": np.float64,  # of terrain, m
    "rows": np.int32,
    "partners": np.int32,
    "pairs": np.int32,  # see packing.row_pairs
    "inverse_masses": REAL,  # 1/kg
    "coefficients": REAL,  # k, h, or k, ha, hs, hc of each sorted spring: N/m, N
    "omegas": np.float64,  # rad/s
    "outer_masses": np.int32,
    "outer_values": WIDE,  # force, 0, 0 of a push; point, stiffness, rest length of a tether
    "outer_windows": np.float64,  # start and end, s
    "skins": REAL,  # friction and stiffness, see Own in kernels.own
    "bonds": WIDE,  # constraints, likewise
    "spring_starts": np.int32,
    "spring_omegas": np.float64,  # rad/s, where springs have their own
    "times": np.float64,  # s
    "triangles": np.int32,  # for collisions: corners
    "edges": np.int32,  # ends
    "bodies": np.int32,
    "near_rows": np.int32,
    "nears": np.int32,
    "contacts": REAL,  # kernels.contact.NUMBERS
    "schedules": REAL,  # factor of the stiffness, and h = k / 2 times what is added to L0
    "reaches2": REAL,  # square of the length that stops a robot, m^2
    "quanta": REAL,  # the unit in which the origin of a robot moves, m; in mixed precision
}

#: What stepping changes.
STATE = {
    "positions": REAL,  # m
    "velocities": REAL,  # m/s
    "good_positions": REAL,  # at the last check that found the robot healthy
    "good_velocities": REAL,
    # What a single number does not hold of them, and the origins of the positions, three a lane;
    # empty but in mixed precision.
    "low_positions": REAL,
    "low_velocities": REAL,
    "good_low_positions": REAL,
    "good_low_velocities": REAL,
    "origins": np.float64,  # m
    "oscillators": REAL,  # sin(wt), cos(wt), cos(w dt), sin(w dt): four a lane
    "spring_oscillators": REAL,  # likewise, four a spring and lane
    "worn": REAL,  # how far a spring has flowed, m, and 1, or 0 where it is broken
    "broken_at": np.float64,  # s
    "pair_lists": np.int32,  # pairs that may collide: how many, the sorted features, the pairs
    "grip_partners": np.int32,  # of each feature, with whom its friction holds, see kernels.contact
    "grips": REAL,
    "listed_positions": REAL,  # where the masses were when they were looked up
    "states": np.int32,  # Status
    "state_times": np.float64,  # when it was found, s
    "ledgers": REAL,  # the accounts, and their good copies
}

#: What looking writes.
SEEN = {
    "seen_positions": WIDE,
    "seen_velocities": WIDE,  # synchronised with the positions
    "seen_centers": WIDE,  # centre of mass: three a lane
    "seen_energies": REAL,  # kinetic, gravity, spring, ground, and the ledger: ENERGIES a lane, J
    "seen_states": np.int32,
    "seen_state_times": np.float64,
}


class Structs(NamedTuple):
    """The three tables as Warp structs of arrays, in one precision."""

    model: type
    state: type
    seen: type


def real_dtype(precision: str) -> np.dtype:
    """What a run of a precision computes with."""
    return np.dtype("float64" if precision == "float64" else "float32")


def wide_dtype(precision: str) -> np.dtype:
    """What holds a place in the world."""
    return np.dtype("float32" if precision == "float32" else "float64")


def dtype_of(name: str, precision: str) -> np.dtype:
    """Element type of a buffer."""
    kind = (MODEL | STATE | SEEN)[name]
    if kind is REAL:
        return real_dtype(precision)
    return wide_dtype(precision) if kind is WIDE else np.dtype(kind)


def real_type(precision: str) -> type:
    """The Warp type of a number of the run."""
    return wp.dtype_from_numpy(real_dtype(precision))


@functools.cache
def structs(precision: str) -> Structs:
    """The structs that kernels of a precision take."""

    def struct(name: str, table: dict) -> type:
        return array_struct(name, {key: dtype_of(key, precision) for key in table})

    return Structs(struct("Model", MODEL), struct("State", STATE), struct("Seen", SEEN))


def array_struct(name: str, dtypes: Mapping[str, np.dtype]) -> type:
    """A Warp struct of arrays of the given element types."""
    return struct_of(
        name, {key: wp.array(dtype=wp.dtype_from_numpy(d)) for key, d in dtypes.items()}
    )


def struct_of(name: str, fields: Mapping[str, type]) -> type:
    """A Warp struct with the given fields."""
    return wp.struct(type(name, (), {"__annotations__": dict(fields), "__module__": __name__}))
