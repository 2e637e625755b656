"""The layout for a GPU: a block of threads steps whole robots, all steps in one launch.

A thread owns a mass, its velocity stays in registers; the positions of the block's robots lie in
two buffers in shared memory, and a pass ends with one barrier. Several small robots share a block.

On a CPU the same kernel runs with the threads of a block as cooperative fibers, slowly: that is for
verification.
"""

import functools

import warp as wp

from warp_springs.kernels.buffers import real_type
from warp_springs.kernels.gather import GatherFeatures, gather_structs, passes, run_type
from warp_springs.kernels.steps import STEPS

__all__ = ["BLOCK", "block"]

#: Registers that the threads of a block share.
REGISTERS = 65536
#: Columns of the table of blocks.
BLOCK = ("slice", "slices", "robot", "robots")

_BLOCK = r"""
const int* const mine = blocks.data + 4 * block;
const int first_slot = mine[0] * SLICE, robots_here = mine[3], division_ = 1;
const bool inside = thread < mine[1] * SLICE;
const int slot = first_slot + (inside ? thread : 0), slice = slot / SLICE;
const int robot = model.slices.data[slice * SITE_COLUMNS];
const int robot_slot = model.robots.data[robot * ROBOT_COLUMNS];
const Slot at = {slice, slot % SLICE, robot, slot - first_slot, robot_slot - first_slot,
                 robot_slot};
const Slot outside = among_all(at);
const bool leader = inside && slot == robot_slot;
const bool is_mass = inside && model.homes.data[slot] >= 0;

scalar* const shared = tile.data.ptr;
int side = 0;
auto now = [&]() -> scalar* { return shared + side * (4 * THREADS); };
auto then = [&]() -> scalar* { return shared + (1 - side) * (4 * THREADS); };
auto meet = []() { WP_TILE_SYNC(); };
auto flip = [&]() { meet(); side = 1 - side; };

real weight;
const Vec x_start = own_quad(state.positions.data, outside, weight);
Vec low = MIXED ? load(state.low_positions.data, outside) : Vec{};
Sum velocity = load_sum(state.velocities.data, state.low_velocities.data, outside);
look_up_origin(robot);
if (inside) { keep_quad(now(), at, x_start, weight); keep_quad(then(), at, x_start, weight); }
scalar sine = state.oscillators.data[2 * robot], cosine = state.oscillators.data[2 * robot + 1];
real rest[OBSTACLES ? OBSTACLES : 1] = {};
real power = zero;
bool moving = is_mass && state.states.data[robot] == 0;
meet();

auto find_rates = [&](bool shifted, scalar time, bool start) {
    if (!DASHPOTS) return;
    if (moving) rate_slot(at, now(), then(), low, velocity, shifted, start || EULER);
    meet();
    if (EULER) return;
    if (moving) middle_slot(at, now(), then(), low, sine, cosine, time, shifted);
    meet();
};
#if COLLIDES
const int last_robot = mine[2] + robots_here - 1;
const int first_feature = meeting_row(mine[2])[0];
const int past_feature = meeting_row(last_robot)[0] + meeting_row(last_robot)[7];
auto base_of = [=](int r) -> int { return model.robots.data[r * ROBOT_COLUMNS] - first_slot; };
auto collide = [&](scalar time, bool rubs) {
    int* const flag = state.stale.data + robot;
    if (is_mass) {
        store_sum(state.velocities.data, state.low_velocities.data, outside, velocity);
        raise(flag, has_left(now(), at.base, robot, slot));
    }
    meet();
    for (int r = mine[2]; r <= last_robot; ++r) {
        if (!*(volatile int*)(state.stale.data + r)) continue;
        fit_tree(now(), r, base_of(r), thread, THREADS, meet);
    }
    const bool stale = is_mass && *(volatile int*)flag;
    if (stale) remember(now(), at.base, robot, slot);
    for (int f = first_feature + thread; f < past_feature; f += THREADS)
        if (*(volatile int*)(state.stale.data + feature_row(f)[0])) list_near(f);
    meet();
    if (leader) *flag = 0;
    for (int f = first_feature + thread; f < past_feature; f += THREADS)
        push_feature(f, now(), base_of(feature_row(f)[0]), time, rubs, rubs);
    meet();
};
#else
auto collide = [](scalar, bool) {};
#endif
auto move = [&](bool shifted, scalar time, bool start, bool last) {
    if (LIMITS && moving && !shifted) wear_slot(at, now(), sine, cosine);
    collide(time, true);
    find_rates(shifted, time, start);
    if (moving)
        move_slot(at, now(), then(), low, velocity, rest, sine, cosine, shifted, time, start, last);
    flip();
};
auto kick_and_drift = move;
auto euler = [&]() { move(false, dt, false, true); };
auto gradient_shift = [&]() {
    collide(GRADIENT_KICK, false);
    if (moving) shift_slot(at, now(), then(), low, sine, cosine);
    flip();
};
auto enter_work = [](scalar) {};

auto all_stopped = [=]() -> bool {
    for (int r = mine[2]; r < mine[2] + robots_here; ++r)
        if (state.states.data[r] == 0) return false;
    return true;
};
auto check = [&](long long n) {
    int* const flag = state.flags.data + robot;
    if (moving) raise(flag, trouble(at, now(), low, velocity));
    meet();
    const int found = is_mass ? *(volatile int*)flag : 0;
    if (is_mass) settle(at, !moving || found != 0, now(), then(), low, velocity);
    if (found != 0) moving = false;
    meet();
    if (leader) {
        if (found && state.states.data[robot] == 0) {
            state.states.data[robot] = status_of(found);
            state.state_times.data[robot] = double(n) * run.exact_dt;
        }
        *flag = 0;
        double sums[3] = {};
        if (MIXED && moving) {
            const int masses = model.robots.data[robot * ROBOT_COLUMNS + 1];
            add_positions(now() + 4 * at.base, (masses + SLICE - 1) / SLICE * SLICE, sums);
            lead_origin(robot, sums);
        }
    }
    meet();
#if MIXED
    if (moving) {
        look_up_origin(robot);
        follow(at, now(), low);
    }
    meet();
#endif
};
auto set_oscillators = [&](long long n) {
    oscillator(robot, n, sine, cosine);
    if (inside) set_ends(at, n);
};
auto turn_oscillators = [&]() {
    if (ACTUATED) turn(robot, sine, cosine);
    if (inside) turn_ends(at);
};
auto prepare = []() {};
auto begin = []() {};
auto end = []() {};
"""

_BLOCK_END = r"""
if (inside) {
    const Vec x_end = own_quad(now(), at, weight);
    keep_quad(state.positions.data, outside, x_end, weight);
    if (MIXED) store(state.low_positions.data, outside, low);
    store_sum(state.velocities.data, state.low_velocities.data, outside, velocity);
}
if (leader) {
    state.oscillators.data[2 * robot] = sine;
    state.oscillators.data[2 * robot + 1] = cosine;
}
"""


@functools.cache
def block(features: GatherFeatures, size: int) -> wp.Kernel:
    """The kernel that steps crowds in blocks of ``size`` threads."""
    Model, State = gather_structs(features.precision, features.traits.colliding)
    Run = run_type(features.precision)
    real = real_type(features.precision)
    module = wp.get_module(f"{features.name}_{size}")
    wp.set_module_options({"enable_backward": False}, module)
    threads = f"const int THREADS = {size};\n"

    @wp.func_native(passes(features) + threads + _BLOCK + STEPS + _BLOCK_END)
    def advance_block(
        model: Model,
        state: State,
        run: Run,
        blocks: wp.array(dtype=wp.int32),
        tile: wp.tile[real, 8 * size],
        block: int,
        thread: int,
        first_step: wp.int64,
        last_step: wp.int64,
    ): ...

    # All registers that so many threads may have: the compiler would rather spill some.
    registers = min(255, REGISTERS // size // 8 * 8)

    @wp.kernel(module=module, cuda_max_registers=registers, grid_stride=False)
    def advance(
        model: Model,
        state: State,
        run: Run,
        blocks: wp.array(dtype=wp.int32),
        first_step: wp.int64,
        last_step: wp.int64,
    ):
        b, t = wp.tid()
        tile = wp.tile_zeros(shape=wp.static(8 * size), dtype=real, storage="shared")
        advance_block(model, state, run, blocks, tile, b, t, first_step, last_step)

    return advance
