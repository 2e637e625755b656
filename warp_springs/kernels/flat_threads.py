"""The flat layout on a CPU: several threads step one body that is too large for a cache.

Each thread owns a run of slices, the lanes of a register are the slots of one, and all steps of a
segment run inside one launch a thread: after each pass the threads meet.
"""

import functools

import warp as wp

from warp_springs.kernels.dialect import PROCESSOR_OPTIONS
from warp_springs.kernels.gather import GatherFeatures, gather_structs, passes, run_type
from warp_springs.kernels.slot_loads import KEPT
from warp_springs.kernels.steps import STEPS

__all__ = ["threads"]

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
    wp.set_module_options(PROCESSOR_OPTIONS, module)

    @wp.func_native(passes(features) + KEPT + _THREADS + STEPS + _THREADS_END)
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
