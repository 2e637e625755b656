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
    array_struct,
    real_dtype,
    real_type,
    struct_of,
)
from warp_springs.kernels.bundle import CHECK_EVERY, Features, feature_flags
from warp_springs.kernels.dialect import (
    native_width,
    quad_operations,
    scalar_dialect,
    vector_dialect,
)
from warp_springs.kernels.law import CONSTANTS, LAW

__all__ = [
    "CHUNK",
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
    "coefficients": REAL,  # k, h, or k, ha, hs, hc: N/m, N
    "homes": np.int32,  # the user's number of a slot's mass, -1 for padding
    "omegas": np.float64,  # rad/s
    "turns": REAL,  # cos(w dt), sin(w dt) of half a step of chin4, or of a step
    "reaches2": REAL,  # square of the length that stops a robot, m^2
    "obstacles": np.float64,  # see kernels.buffers
    "heights": np.float64,
    "outer_sites": np.int32,  # first row and rows of the pushes and tethers of each slice
    "outer_values": REAL,  # [row][6][slot], the last: whether it is a tether
    "outer_windows": np.float64,  # [row][2][slot], s
    "skins": REAL,  # [slice][3][slot]
    "bonds": REAL,  # [slice][10][slot]
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
    "states": np.int32,  # Status
    "state_times": np.float64,  # s
    "flags": np.int32,  # reasons to stop a robot, found by the check; and by a look
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
        return 2 if small and not self.vector and not self.actuated else 1


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
    lines += ["auto begin_step = [](double) {}; auto middle_of_step = begin_step;"]
    lines += ["const double* const obstacles = model.obstacles.data;"]
    lines += ["const double* const heights = model.heights.data;"]
    if features.vector:
        dialect = vector_dialect(features.precision, features.width)
        loads = quad_operations(features.width) + _vector_loads(features.width)
    else:
        dialect, loads = scalar_dialect(features.precision), _SCALAR_LOADS
    return dialect + flags + "\n".join(lines) + _ORIGIN + LAW + _SLOT + loads + _PASSES


_TABLES = {"robot": ROBOT, "site": SITE, "chunk": CHUNK}


# The origin of the robot's positions, as the law sees it.
_ORIGIN = r"""
real origins_here[3] = {};
real* const origin = origins_here;
auto look_up_origin = [=](int robot) {
    for (int c = 0; MIXED && c < 3; ++c)
        origin[c] = zero + scalar(state.origins.data[3 * robot + c]);
};
"""

# Where a thread works: one slot of a slice, or, where the slots are lanes, all of them (lane 0).
# `own` is its place in the buffers of positions, and `base` that of its robot's first slot.
_SLOT = r"""
struct Slot { int slice, lane, robot, own, base; };
"""


def _vector_loads(width: int) -> str:
    """How the lanes of a register load: vectors as they lie, quads by transposition."""
    rows = width // 4

    def joined(quads: list[str]) -> str:
        if len(quads) == 1:
            return quads[0]
        half = len(quads) // 2
        order = ", ".join(map(str, range(4 * len(quads))))
        return f"__builtin_shufflevector({joined(quads[:half])}, {joined(quads[half:])}, {order})"

    quads = [f"*(const quad*)(where + j[{slot}])" for slot in range(width)]
    gathered = "\n".join(
        f"real {name} = {joined(quads[v * rows : (v + 1) * rows])};"
        for v, name in enumerate("abcd")
    )
    return (
        f"""
typedef scalar quad __attribute__((vector_size(4 * sizeof(scalar))));
auto neighbours_of = [=](const scalar* where, const unsigned* j) __attribute__((always_inline))
        -> Vec {{
    {gathered}
    transpose(a, b, c, d);
    return Vec{{a, b, c}};
}};
"""
        + _VECTOR_LOADS
    )


_VECTOR_LOADS = r"""
auto own_quad = [=](const scalar* where, Slot at, real& w) __attribute__((always_inline)) -> Vec {
    const real* const q = (const real*)(where + 4 * at.own);
    real a = q[0], b = q[1], c = q[2];
    w = q[3];
    transpose(a, b, c, w);
    return Vec{a, b, c};
};
auto keep_quad = [=](scalar* where, Slot at, Vec x, real w) __attribute__((always_inline)) {
    real* const q = (real*)(where + 4 * at.own);
    transpose(x.x, x.y, x.z, w);
    q[0] = x.x; q[1] = x.y; q[2] = x.z; q[3] = w;
};
auto in_slice = [=](scalar* values, Slot at, int rows) __attribute__((always_inline)) -> real* {
    return (real*)(values + (long long)at.slice * rows * W);
};
const int STRIDE = 1;  // from one row of a slice to the next, in numbers
auto each_spring = [=](Slot at, const scalar* where, auto work) __attribute__((always_inline)) {
    const int* const site = model.slices.data + (long long)at.slice * SITE_COLUMNS;
    const int columns = ACTUATED ? 4 : 2, length = site[3];
    const unsigned* j = (const unsigned*)model.neighbours.data + (long long)site[1] * W;
    const real* c = (const real*)model.coefficients.data + (long long)site[2] * columns;
    for (int e = 0; e < length; ++e, j += W, c += columns)
        work(neighbours_of(where + 4 * at.base, j), c[0], c[1], ACTUATED ? c[2] : zero,
             ACTUATED ? c[3] : zero);
};
"""

_SCALAR_LOADS = r"""
// A GPU moves 16 bytes at once where it knows them aligned; shared memory on a CPU is not.
#if defined(__CUDA_ARCH__)
const int QUAD_ALIGNMENT = 16;
#else
const int QUAD_ALIGNMENT = sizeof(scalar);
#endif
struct alignas(QUAD_ALIGNMENT) Quad { scalar x, y, z, w; };
struct alignas(2 * sizeof(scalar)) Pair { scalar x, y; };
struct alignas(8) Two { int x, y; };
struct alignas(16) Four { int x, y, z, w; };

auto own_quad = [=](const scalar* where, Slot at, real& w) -> Vec {
    const Quad q = *(const Quad*)(where + 4 * at.own);
    w = q.w;
    return Vec{q.x, q.y, q.z};
};
auto keep_quad = [=](scalar* where, Slot at, Vec x, real w) {
    *(Quad*)(where + 4 * at.own) = Quad{x.x, x.y, x.z, w};
};
auto in_slice = [=](scalar* values, Slot at, int rows) -> real* {
    return values + (long long)at.slice * rows * SLICE + at.lane;
};
const int STRIDE = SLICE;
auto each_spring = [=](Slot at, const scalar* where, auto work) {
    const Four site = *(const Four*)(model.slices.data + (long long)at.slice * SITE_COLUMNS);
    const int length = site.w, columns = ACTUATED ? 4 : 2;
    const int* j = model.neighbours.data + (long long)site.y * SLICE + at.lane * TOGETHER;
    const scalar* c = model.coefficients.data
        + ((long long)site.z * SLICE + at.lane * TOGETHER) * columns;
    auto there = [=](int neighbour) -> Vec {
        const Quad q = *(const Quad*)(where + 4 * at.base + neighbour);
        return Vec{q.x, q.y, q.z};
    };
    for (int e = 0; e < length; e += TOGETHER) {
        if (ACTUATED) {
            const Quad q = *(const Quad*)c;
            work(there(*j), q.x, q.y, q.z, q.w);
        } else if (TOGETHER == 2) {
            const Two pair = *(const Two*)j;
            const Quad q = *(const Quad*)c;
            work(there(pair.x), q.x, q.y, zero, zero);
            work(there(pair.y), q.z, q.w, zero, zero);
        } else {
            const Pair q = *(const Pair*)c;
            work(there(*j), q.x, q.y, zero, zero);
        }
        j += SLICE * TOGETHER;
        c += SLICE * TOGETHER * columns;
    }
};
"""

_PASSES = r"""
auto load = [=](scalar* values, Slot at) __attribute__((always_inline)) -> Vec {
    const real* const p = in_slice(values, at, 3);
    return Vec{p[0], p[STRIDE], p[2 * STRIDE]};
};
auto store = [=](scalar* values, Slot at, Vec a) __attribute__((always_inline)) {
    real* const p = in_slice(values, at, 3);
    p[0] = a.x; p[STRIDE] = a.y; p[2 * STRIDE] = a.z;
};
auto load_sum = [=](scalar* values, scalar* lows, Slot at) __attribute__((always_inline)) -> Sum {
    const Vec a = load(values, at), low = MIXED ? load(lows, at) : Vec{};
    return sum_of(&a, &low, 0);
};
auto store_sum = [=](scalar* values, scalar* lows, Slot at, const Sum& sum)
        __attribute__((always_inline)) {
    Vec a, low = {};
    keep_sum(&a, &low, 0, sum);
    store(values, at, a);
    if (MIXED) store(lows, at, low);
};
// Half of the power of each breathing spring belongs to either end.
struct Force { Vec f; real power; };
auto gather = [=](Slot at, const scalar* where, Vec a, scalar sine, scalar cosine)
        __attribute__((always_inline)) -> Force {
    const real si = zero + sine, co = zero + cosine;
    const real omega = zero + (LEDGER ? scalar(model.omegas.data[at.robot]) : scalar(0));
    Force sum = {};
    each_spring(at, where, [&](Vec b, real k, real ha, real hs, real hc)
            __attribute__((always_inline)) {
        const Vec d = b - a;
        const real length2 = squared_length(d.x, d.y, d.z);
        const real h = ACTUATED ? breathing(ha, hs, hc, si, co) : ha;
        if (LEDGER && ACTUATED)
            sum.power += breathing_power(length2, k, h, breathing_rate(hs, hc, si, co, omega))
                * scalar(0.5);
        const real pull = spring_pull(length2, k, h);
        sum.f.x += pull * d.x; sum.f.y += pull * d.y; sum.f.z += pull * d.z;
    });
    return sum;
};
auto choose = [=](mask m, Vec a, Vec b) __attribute__((always_inline)) -> Vec {
    return Vec{select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
};
#if MIXED
auto choose_sum = [=](mask m, const Sum& a, const Sum& b) __attribute__((always_inline)) -> Sum {
    return Sum{choose(m, a, b), choose(m, a.low, b.low)};
};
#else
auto choose_sum = choose;
#endif

// Energies that a mass exchanged, kept by mass.
struct Accounts { real values[ACCOUNTS]; };
auto open_accounts = [=](scalar* kept, Slot at) __attribute__((always_inline)) -> Accounts {
    Accounts accounts = {};
    for (int e = 0; LEDGER && e < ACCOUNTS; ++e)
        accounts.values[e] = in_slice(kept, at, ACCOUNTS)[e * STRIDE];
    return accounts;
};
auto close_accounts = [=](scalar* kept, Slot at, Accounts accounts)
        __attribute__((always_inline)) {
    for (int e = 0; LEDGER && e < ACCOUNTS; ++e)
        in_slice(kept, at, ACCOUNTS)[e * STRIDE] = accounts.values[e];
};

// Force of the pushes on a mass at x, and of its tethers, each for the part of the present kick's
// time in which it acts.
auto outer_force = [&](Slot at, Vec x) __attribute__((always_inline)) -> Vec {
    Vec sum = {zero, zero, zero};
    const int* const site = model.outer_sites.data + 2 * at.slice;
    for (int row = site[0]; row < site[0] + site[1]; ++row) {
        const double* const window =
            model.outer_windows.data + 2 * (long long)row * SLICE + at.lane;
        real part = zero;
        for (int l = 0; l < W; ++l)
            set_lane(part, l, acting_part(window[l], window[SLICE + l]));
        if (!any(part > zero)) continue;
        const real* const o = in_slice(model.outer_values.data, Slot{row, at.lane, 0, 0, 0}, 6);
        const Vec f = {o[0], o[STRIDE], o[2 * STRIDE]};
        const Vec pull = tether_force(f - x, o[3 * STRIDE], o[4 * STRIDE]);
        sum = sum + scaled(pick(o[5 * STRIDE] > zero, pull, f), part);
    }
    return sum;
};
// What the mass of a slot has of its own; x is where its forces are taken.
auto own_of = [&](Slot at, Vec x, real* left_over) __attribute__((always_inline)) -> Own {
    Own own = {};
    own.left_over = left_over;
    if (OUTER) own.outer = outer_force(at, x);
    if (SKIN) own.skin = load(model.skins.data, at);
    if (BOUND) {
        const real* const b = in_slice(model.bonds.data, at, 10);
        own.diagonal = Vec{b[0], b[STRIDE], b[2 * STRIDE]};
        own.corner = Vec{b[3 * STRIDE], b[4 * STRIDE], b[5 * STRIDE]};
        own.centre = Vec{b[6 * STRIDE], b[7 * STRIDE], b[8 * STRIDE]};
        own.radius = b[9 * STRIDE];
    }
    return own;
};

// The reasons, as bits, why the robot of a slot must be stopped.
auto trouble = [=](Slot at, const scalar* where, Vec low, Vec v)
        __attribute__((always_inline)) -> int {
    real w;
    const Vec a = own_quad(where, at, w);
    const real reach2 = zero + model.reaches2.data[at.robot];
    const mask fast = too_fast(v, a - load(state.good_positions.data, at));
    mask stretched = zero > zero;
    each_spring(at, where, [&](Vec b, real, real, real, real) __attribute__((always_inline)) {
        const Vec d = b - a;
        stretched |= squared_length(d.x, d.y, d.z) > reach2;
    });
    bool deep = GROUND && any(in_world(sum_of(&a, &low, 0)).z < -depth_limit);
    if (OBSTACLES) deep = any((w > zero) & (depth_in_obstacles(a) > zero + depth_limit));
    return (deep ? 1 : 0) | (any(stretched) ? 2 : 0) | (any(fast) ? 4 : 0)
        | (any(poison_of(a, v) != zero) ? 8 : 0);
};
auto status_of = [](int reasons) -> int {
    return reasons & 8 ? 1 : reasons & 4 ? 3 : reasons & 2 ? 2 : reasons ? 4 : 0;
};
auto raise = [](int* flag, int bits) {
    if (!bits) return;
#if defined(__CUDA_ARCH__)
    atomicOr(flag, bits);
#else
    __atomic_fetch_or(flag, bits, __ATOMIC_SEQ_CST);
#endif
};
// sin and cos of wt, from the turns that it makes: no argument is too large.
auto oscillator = [=](int robot, long long n, scalar& sine, scalar& cosine) {
    double turns = model.omegas.data[robot] * (double(n) * run.exact_dt) * 0.15915494309189535;
    turns -= ::floor(turns);
#if defined(__CUDA_ARCH__)
    sine = scalar(::sinpi(2.0 * turns)); cosine = scalar(::cospi(2.0 * turns));
#else
    sine = scalar(::sin(6.283185307179586 * turns));
    cosine = scalar(::cos(6.283185307179586 * turns));
#endif
};
auto turn = [=](int robot, scalar& sine, scalar& cosine) {
    const scalar c = model.turns.data[2 * robot], s = model.turns.data[2 * robot + 1];
    const scalar si = sine, co = cosine;
    sine = si * c + co * s;
    cosine = co * c - si * s;
};

// Keeps the state of a healthy robot as good, and brings a stopped one back to where it was.
auto settle = [=](Slot at, bool stop, scalar* one, scalar* other, Vec& low, Sum& v)
        __attribute__((always_inline)) {
    real w;
    const Vec a = own_quad(one, at, w);
    Accounts now = open_accounts(state.ledgers.data, at);
    if (!stop) {
        store(state.good_positions.data, at, a);
        if (MIXED) store(state.good_low_positions.data, at, low);
        store_sum(state.good_velocities.data, state.good_low_velocities.data, at, v);
        close_accounts(state.good_ledgers.data, at, now);
        return;
    }
    const Vec good = load(state.good_positions.data, at);
    keep_quad(one, at, good, w);
    keep_quad(other, at, good, w);
    if (MIXED) low = load(state.good_low_positions.data, at);
    v = load_sum(state.good_velocities.data, state.good_low_velocities.data, at);
    close_accounts(state.ledgers.data, at, open_accounts(state.good_ledgers.data, at));
};
// One kick by the springs and its drift, from the positions `now` into the buffer `then`, which
// holds the positions if the springs pull where the gradient kick looks.
// `rest` is what each surface leaves over for friction, from one drift of a step to the next.
auto move_slot = [&](Slot at, const scalar* now, scalar* then, Vec& low, Sum& v, real* rest,
                     scalar sine, scalar cosine, bool shifted, scalar time, bool start, bool last)
        __attribute__((always_inline)) {
    real w;
    const Vec here = own_quad(now, at, w);
    const Force sum = gather(at, now, here, sine, cosine);
    const Vec high = shifted ? own_quad(then, at, w) : here;
    Sum a = sum_of(&high, &low, 0);
    const Sum x_before = a, v_before = v;
    Accounts accounts = open_accounts(state.ledgers.data, at);
    if (LEDGER && ACTUATED && !shifted) accounts.values[0] += sum.power * time;
    const Own own = own_of(at, here, rest);
    if (EULER) move_mass_euler(a, v, sum.f, w, accounts.values, own);
    else {
        real left = GROUND && CHIN4 && last ? *rest : zero;
        move_mass(a, v, sum.f, shifted ? from_here(here, a) : in_world(a), w, run.substeps, left,
                  time, start, last, accounts.values, own);
        if (GROUND && CHIN4 && !last) *rest = left;
    }
    close_accounts(state.ledgers.data, at, accounts);
    const mask is_mass = w > zero;
    v = choose_sum(is_mass, v, v_before);
    Vec x;
    keep_sum(&x, &low, 0, choose_sum(is_mass, a, x_before));
    keep_quad(then, at, x, w);
};
auto shift_slot = [&](Slot at, const scalar* now, scalar* then, Vec low, scalar sine, scalar cosine)
        __attribute__((always_inline)) {
    real w;
    const Vec here = own_quad(now, at, w);
    const Force sum = gather(at, now, here, sine, cosine);
    if (LEDGER && ACTUATED) {
        Accounts accounts = open_accounts(state.ledgers.data, at);
        accounts.values[0] += sum.power * GRADIENT_KICK;
        close_accounts(state.ledgers.data, at, accounts);
    }
    const Own own = own_of(at, here, nullptr);
    const Vec a = shifted_position(sum_of(&here, &low, 0), sum.f, w, own);
    keep_quad(then, at, choose(w > zero, a, here), w);
};

// In mixed precision the origin follows a robot whose centre has left it by more than a quantum, in
// whole quanta. Sums of positions first; padding is at zero.
auto add_positions = [=](const scalar* quads, int slots, double* sums) {
    for (int i = 0; i < slots; ++i)
        for (int c = 0; c < 3; ++c) sums[c] += double(quads[4 * i + c]);
};
auto lead_origin = [=](int robot, const double* sums) {
    const double quantum = double(model.quanta.data[robot]);
    for (int c = 0; c < 3; ++c) {
        const double middle = sums[c] / double(model.robots.data[robot * ROBOT_COLUMNS + 1]);
        const bool away = middle > quantum || middle < -quantum;
        const double shift = away ? ::rint(middle / quantum) * quantum : 0.0;
        state.shifts.data[3 * robot + c] = scalar(shift);
        state.origins.data[3 * robot + c] += shift;
    }
};
#if MIXED
auto follow = [=](Slot at, scalar* where, Vec& low) __attribute__((always_inline)) {
    const scalar* const shift = state.shifts.data + 3 * at.robot;
    if (shift[0] == scalar(0) && shift[1] == scalar(0) && shift[2] == scalar(0)) return;
    real w;
    Vec a = own_quad(where, at, w);
    const mask is_mass = w > zero;
    move_origin(a.x, low.x, select(is_mass, zero + shift[0], zero));
    move_origin(a.y, low.y, select(is_mass, zero + shift[1], zero));
    move_origin(a.z, low.z, select(is_mass, zero + shift[2], zero));
    keep_quad(where, at, a, w);
    store(state.good_positions.data, at, a);
    store(state.good_low_positions.data, at, low);
};
#endif
"""


@functools.cache
def gather_structs(precision: str) -> tuple[type, type]:
    """The structs of what stays and of what stepping changes."""

    def struct(name: str, table: dict) -> type:
        real = real_dtype(precision)
        kinds = {key: real if kind is REAL else np.dtype(kind) for key, kind in table.items()}
        return array_struct(name, kinds)

    return struct("Crowd", MODEL), struct("CrowdState", STATE)
