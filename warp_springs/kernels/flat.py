"""The layout for a body too large for a block, on any device.

On a CPU (``threads``) each thread owns a run of slices, the lanes of a register are the slots of
one, and all steps of a segment run inside one launch a thread: after each pass the threads meet.

On a GPU (``launches``) a thread owns a slot and each pass is a launch; many steps at once are
captured as a graph, which reads from a clock on the device where it is in time.
"""

import functools
from typing import NamedTuple

import warp as wp

from warp_springs.kernels.bundle import STEPS
from warp_springs.kernels.crowd_collisions import COLLISION_JOBS
from warp_springs.kernels.gather import GatherFeatures, gather_structs, passes, run_type

__all__ = ["JOBS", "Launches", "launches", "threads"]

CPU_OPTIONS = {
    "enable_backward": False,
    "optimization_level": 3,
    "cpu_compiler_flags": "-march=native -mprefer-vector-width=512",
}

# Where both keep what a mass is besides its position.
_KEPT = r"""
auto low_at = [=](Slot at) -> Vec {
    return MIXED ? load(state.low_positions.data, at) : Vec{};
};
auto velocity_at = [=](Slot at) -> Sum {
    return load_sum(state.velocities.data, state.low_velocities.data, at);
};
auto keep = [=](Slot at, Vec low, const Sum& v) {
    if (MIXED) store(state.low_positions.data, at, low);
    store_sum(state.velocities.data, state.low_velocities.data, at, v);
};
"""

_THREADS = r"""
const int robot = 0, division_ = 1;
const long long buffer = 4 * (long long)slots;
const int first_slice = edges.data[thread], past_slice = edges.data[thread + 1];
const bool leader = thread == 0;
int* const gate = gates.data;
int* const generation = gate + 32;  // on a cache line of its own
int* const health = state.states.data;

// All threads wait for the last one.
typedef void Yield();
auto meet = [=]() {
    if (threads == 1) return;
    const int before = __atomic_load_n(generation, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(gate, 1, __ATOMIC_ACQ_REL) == threads) {
        __atomic_store_n(gate, 0, __ATOMIC_RELAXED);
        __atomic_store_n(generation, before + 1, __ATOMIC_RELEASE);
        return;
    }
    for (int spins = 0; __atomic_load_n(generation, __ATOMIC_ACQUIRE) == before; ++spins) {
    #if defined(__x86_64__)
        __builtin_ia32_pause();
    #endif
        // Somebody else may need this core to get there.
        if (spins > 4000 && give_way != 0) ((Yield*)give_way)();
    }
};

int side = (int)(first_step & 1);  // each step has an odd number of passes
auto now = [&]() -> scalar* { return state.positions.data + side * buffer; };
auto then = [&]() -> scalar* { return state.positions.data + (1 - side) * buffer; };
auto flip = [&]() { meet(); side = 1 - side; };
scalar sine = state.oscillators.data[0], cosine = state.oscillators.data[1];
real power = zero;
look_up_origin(robot);

auto slices = [=](auto work) __attribute__((always_inline)) {
    for (int slice = first_slice; slice < past_slice; ++slice)
        work(Slot{slice, 0, robot, slice * W, 0, 0});
};
auto find_rates = [&](bool shifted, scalar time, bool start) {
    if (!DASHPOTS) return;
    slices([&](Slot at) {
        rate_slot(at, now(), then(), low_at(at), velocity_at(at), shifted, start || EULER);
    });
    meet();
    if (EULER) return;
    slices([&](Slot at) {
        middle_slot(at, now(), then(), low_at(at), sine, cosine, time, shifted);
    });
    meet();
};
#if COLLIDES
const int features = meeting_row(0)[7];
auto collide = [&](scalar time, bool rubs) {
    bool left = false;
    for (int slot = first_slice * W; slot < past_slice * W; ++slot)
        left = left || (model.touch_rows.data[slot] < model.touch_rows.data[slot + 1]
                        && has_left(now(), 0, robot, slot));
    raise(state.stale.data, left);
    meet();
    const int part = (features + threads - 1) / threads;
    const int from = part * thread, to = from + part < features ? from + part : features;
    if (__atomic_load_n(state.stale.data, __ATOMIC_ACQUIRE)) {
        for (int slot = first_slice * W; slot < past_slice * W; ++slot)
            remember(now(), 0, robot, slot);
        fit_tree(now(), robot, 0, thread, threads, meet);
        for (int f = from; f < to; ++f) list_near(f);
        if (leader) *state.stale.data = 0;
    }
    for (int f = from; f < to; ++f) push_feature(f, now(), 0, time, rubs, rubs);
    meet();
};
#else
auto collide = [](scalar, bool) {};
#endif
auto move = [&](bool shifted, scalar time, bool start, bool last) __attribute__((always_inline)) {
    if (LIMITS && !shifted) slices([&](Slot at) { wear_slot(at, now(), sine, cosine); });
    collide(time, true);
    find_rates(shifted, time, start);
    slices([&](Slot at) __attribute__((always_inline)) {
        Vec low = low_at(at);
        Sum v = velocity_at(at);
        real* const rest = in_slice(state.rests.data, at, OBSTACLES ? OBSTACLES : 1);
        move_slot(at, now(), then(), low, v, rest, sine, cosine, shifted, time, start, last);
        keep(at, low, v);
    });
    flip();
};
auto kick_and_drift = [&](bool shifted, scalar time, bool start, bool last) {
    move(shifted, time, start, last);
};
auto euler = [&]() { move(false, dt, false, true); };
auto gradient_shift = [&]() {
    collide(GRADIENT_KICK, false);
    slices([&](Slot at) __attribute__((always_inline)) {
        shift_slot(at, now(), then(), low_at(at), sine, cosine);
    });
    flip();
};
auto enter_work = [](scalar) {};

auto all_stopped = [=]() -> bool { return *health != 0; };
auto check = [&](long long n) {
    int bits = 0;
    slices([&](Slot at) { bits |= trouble(at, now(), low_at(at), velocity_at(at)); });
    raise(state.flags.data, bits);
    meet();
    const int found = __atomic_load_n(state.flags.data, __ATOMIC_ACQUIRE);
    const bool stop = found != 0 || *health != 0;
    slices([&](Slot at) {
        Vec low = low_at(at);
        Sum v = velocity_at(at);
        settle(at, stop, now(), then(), low, v);
        keep(at, low, v);
    });
    meet();
    if (leader) {
        if (found && *health == 0) {
            *health = status_of(found);
            state.state_times.data[0] = double(n) * run.exact_dt;
        }
        *state.flags.data = 0;
        double sums[3] = {};
        if (MIXED && !stop) {
            add_positions(now(), slots, sums);
            lead_origin(robot, sums);
        }
    }
    meet();
#if MIXED
    if (stop) return;
    look_up_origin(robot);
    slices([&](Slot at) {
        Vec low = low_at(at);
        follow(at, now(), low);
        store(state.low_positions.data, at, low);
    });
    meet();
#endif
};
auto set_oscillators = [&](long long n) {
    oscillator(robot, n, sine, cosine);
    if (OWN_OMEGAS) slices([&](Slot at) { set_ends(at, n); });
};
auto turn_oscillators = [&]() {
    if (!ACTUATED) return;
    turn(robot, sine, cosine);
    if (OWN_OMEGAS) slices([&](Slot at) { turn_ends(at); });
};
auto prepare = []() {};
auto begin = []() {};
auto end = []() {};
"""

_THREADS_END = r"""
meet();  // all have read the oscillators
if (leader)
    for (int s = 0; s < 2; ++s) {
        state.oscillators.data[2 * s] = sine;
        state.oscillators.data[2 * s + 1] = cosine;
    }
"""


@functools.cache
def threads(features: GatherFeatures) -> wp.Kernel:
    """The kernel that one of several threads launches to step one body on a CPU."""
    Model, State = gather_structs(features.precision, features.traits.colliding)
    Run = run_type(features.precision)
    module = wp.get_module(features.name)
    wp.set_module_options(CPU_OPTIONS, module)

    @wp.func_native(passes(features) + _KEPT + _THREADS + STEPS + _THREADS_END)
    def advance_body(
        model: Model,
        state: State,
        run: Run,
        slots: int,
        edges: wp.array(dtype=wp.int32),
        gates: wp.array(dtype=wp.int32),
        give_way: wp.uint64,
        threads: int,
        thread: int,
        first_step: wp.int64,
        last_step: wp.int64,
    ): ...

    @wp.kernel(module=module)
    def advance(
        model: Model,
        state: State,
        run: Run,
        slots: int,
        edges: wp.array(dtype=wp.int32),
        gates: wp.array(dtype=wp.int32),
        give_way: wp.uint64,
        threads: int,
        thread: int,
        first_step: wp.int64,
        last_step: wp.int64,
    ):
        advance_body(
            model,
            state,
            run,
            slots,
            edges,
            gates,
            give_way,
            threads,
            thread,
            first_step,
            last_step,
        )

    return advance


#: The passes of a step, in order: name, and the integrators that have it.
JOBS = {
    "kick": ("euler", "leapfrog", "chin4"),
    "shift": ("chin4",),
    "last_kick": ("chin4",),
}

_LAUNCHES = r"""
const long long n = clock.data[0] + offset;
const long long buffer = 4 * (long long)slots;
const int slice = slot / SLICE;
const int robot = model.slices.data[slice * SITE_COLUMNS];
const int root = model.robots.data[robot * ROBOT_COLUMNS];
const Slot at = {slice, slot % SLICE, robot, slot, root, root};
const bool leader = slot == at.base, stopped = state.states.data[robot] != 0;
look_up_origin(robot);
"""

#: Checks that only mixed precision needs.
MIXED_ONLY = ("measure", "follow")

# What the passes of a step and those before them have in common.
_WITHIN = r"""
const int side = (int)((n + PASS) & 1);
scalar* const now = state.positions.data + side * buffer;
scalar* const then = state.positions.data + (1 - side) * buffer;
const scalar* const wave = state.oscillators.data + 2 * ((long long)side * robots + robot);
const scalar sine = wave[0], cosine = wave[1];
const bool moving = !stopped && model.homes.data[slot] >= 0;
const double begin = double(n) * exact_dt, part = exact_dt * (CHIN4 ? 1.0 / 6.0 : 0.5);
kick_begin = PASS ? begin + part : EULER || n == 0 ? begin : begin - part;
kick_end = EULER ? begin + exact_dt : PASS ? begin + exact_dt - part : begin + part;
begin_step(PASS ? begin + 0.5 * exact_dt : begin);
const bool shifted = PASS == 2, start = PASS == 0 && n == 0, last = !CHIN4 || PASS == 2;
const scalar time = EULER ? dt : PASS == 2 ? GRADIENT_KICK
    : start ? FIRST_KICK : FIRST_KICK * scalar(2);
"""

_PASS = r"""
scalar* const next = state.oscillators.data + 2 * ((long long)(1 - side) * robots + robot);
if (leader && ACTUATED) {
    scalar si = sine, co = cosine;
    if (PASS != 1) turn(robot, si, co);
    next[0] = si; next[1] = co;
}
if (moving) {
    Vec low = low_at(at);
    if (PASS == 1) shift_slot(at, now, then, low, sine, cosine);
    else {
        if (PASS == 0 && !DASHPOTS) wear_slot(at, now, sine, cosine);
        Sum v = velocity_at(at);
        real* const rest = state.rests.data + (OBSTACLES ? OBSTACLES : 1) * (long long)slot;
        move_slot(at, now, then, low, v, rest, sine, cosine, shifted, time, start, last);
        keep(at, low, v);
    }
}
if (PASS != 1) turn_ends(at);
"""

# Before a kick, where there are dashpots.
_RATES = r"""
if (!moving) return;
if (PASS == 0) wear_slot(at, now, sine, cosine);
rate_slot(at, now, then, low_at(at), velocity_at(at), shifted, start || EULER);
"""

_MIDDLE = r"""
if (!moving) return;
middle_slot(at, now, then, low_at(at), sine, cosine, time, shifted);
"""

# The temporary springs before a pass.
_COLLIDE = r"""
const long long n = clock.data[0] + offset;
const scalar* const where = state.positions.data + ((n + PASS) & 1) * (4 * (long long)slots);
const scalar time = EULER ? dt : PASS ? GRADIENT_KICK
    : n == 0 ? FIRST_KICK : FIRST_KICK * scalar(2);
const bool rubs = PASS != 1, keeps = rubs;
const int index = slot;
auto takes_part = [=](int robot) -> bool { return state.states.data[robot] == 0; };
"""

_FIND = r"""
if (stopped) return;
const scalar* const now = state.positions.data + (n & 1) * buffer;
raise(state.flags.data + robot, trouble(at, now, low_at(at), velocity_at(at)));
"""

_SETTLE = r"""
const int side = (int)(n & 1);
scalar* const now = state.positions.data + side * buffer;
Vec low = low_at(at);
Sum v = velocity_at(at);
settle(at, stopped || state.flags.data[robot] != 0, now,
       state.positions.data + (1 - side) * buffer, low, v);
keep(at, low, v);
set_ends(at, n);
"""

_WIND = r"""
const long long n = clock.data[0] + offset;
const int robot = slot, found = state.flags.data[robot];
state.flags.data[robot] = 0;
if (found && state.states.data[robot] == 0) {
    state.states.data[robot] = status_of(found);
    state.state_times.data[robot] = double(n) * run.exact_dt;
}
if (MIXED && state.states.data[robot] == 0) {
    const int* const about = model.robots.data + robot * ROBOT_COLUMNS;
    double total[3] = {};
    for (int c = about[4]; c < about[4] + about[5]; ++c)
        for (int axis = 0; axis < 3; ++axis) total[axis] += sums.data[3 * c + axis];
    lead_origin(robot, total);
}
if (ACTUATED) {
    scalar* const wave = state.oscillators.data + 2 * ((n & 1) * robots + robot);
    oscillator(robot, n, wave[0], wave[1]);
}
"""


# In mixed precision: sums of positions by chunks, and the shift to a moved origin.
_MEASURE = r"""
const long long n = clock.data[0] + offset;
const int* const chunk = model.chunks.data + slot * CHUNK_COLUMNS;
double* const total = sums.data + 3 * (long long)slot;
total[0] = total[1] = total[2] = 0.0;
add_positions(state.positions.data + 4 * ((n & 1) * (long long)slots + chunk[1]), chunk[2], total);
"""

_FOLLOW = r"""
#if MIXED
if (stopped || model.homes.data[slot] < 0) return;
Vec low = low_at(at);
follow(at, state.positions.data + (n & 1) * buffer, low);
store(state.low_positions.data, at, low);
#endif
"""


class Launches(NamedTuple):
    """Kernels of one set of features.

    Attributes:
        steps: The passes of a step, in order, and what each is launched over.
        check: The same for what is done every ``CHECK_EVERY`` steps.
        tick: Moves the clock on.
    """

    steps: list[tuple[wp.Kernel, str]]
    check: list[tuple[wp.Kernel, str]]
    tick: wp.Kernel


@functools.cache
def launches(features: GatherFeatures) -> Launches:
    """The kernels that step crowds a pass a launch."""
    Model, State = gather_structs(features.precision, features.traits.colliding)
    Run = run_type(features.precision)
    module = wp.get_module(features.name)
    wp.set_module_options({"enable_backward": False}, module)
    text = passes(features) + _KEPT

    def kernel(name: str, snippet: str) -> wp.Kernel:
        @wp.func_native(text + snippet)
        def work(
            model: Model,
            state: State,
            run: Run,
            slots: int,
            robots: int,
            clock: wp.array(dtype=wp.int64),
            sums: wp.array(dtype=wp.float64),
            team: int,
            offset: int,
            slot: int,
        ): ...

        @wp.kernel(module=module, name=name)
        def launch(
            model: Model,
            state: State,
            run: Run,
            slots: int,
            robots: int,
            clock: wp.array(dtype=wp.int64),
            sums: wp.array(dtype=wp.float64),
            team: int,
            offset: int,
        ):
            work(model, state, run, slots, robots, clock, sums, team, offset, wp.tid())

        return launch

    @wp.kernel(module=module)
    def tick(clock: wp.array(dtype=wp.int64), steps: int):
        clock[0] = clock[0] + wp.int64(steps)

    damped = {"rates": _RATES} if features.traits.dashpots else {}
    if damped and features.integrator != "euler":
        damped["middle"] = _MIDDLE
    steps = []
    for index, (job, integrators) in enumerate(JOBS.items()):
        if features.integrator not in integrators:
            continue
        number = f"const int PASS = {index};\n"
        within = number + _LAUNCHES + _WITHIN
        if features.traits.colliding:
            for name, (over, snippet) in COLLISION_JOBS.items():
                steps.append((kernel(f"{name}_{job}", number + _COLLIDE + snippet), over))
        if job != "shift":
            steps += [
                (kernel(f"{job}_{name}", within + snippet), "slots")
                for name, snippet in damped.items()
            ]
        steps.append((kernel(job, within + _PASS), "slots"))
    check = [
        (kernel("find", _LAUNCHES + _FIND), "slots"),
        (kernel("settle", _LAUNCHES + _SETTLE), "slots"),
        (kernel("measure", _MEASURE), "chunks"),
        (kernel("wind", _WIND), "robots"),
        (kernel("follow", _LAUNCHES + _FOLLOW), "slots"),
    ]
    if features.precision != "mixed":
        check = [(kernel, over) for kernel, over in check if kernel.key not in MIXED_ONLY]
    return Launches(steps, check, tick)
