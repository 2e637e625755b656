"""The flat layout on a GPU: a thread owns a slot, and each pass over the bodies is a launch.

Many steps at once are captured as a graph, which reads from a clock on the device where it is in
time.
"""

import functools
from typing import NamedTuple

import warp as wp

from warp_springs.kernels.crowd_collisions import COLLISION_JOBS
from warp_springs.kernels.gather import GatherFeatures, gather_structs, passes, run_type
from warp_springs.kernels.slot_loads import KEPT

__all__ = ["Launches", "launches"]

#: The passes of a step, in order: name, and the integrators that have it.
_JOBS = {
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
    text = passes(features) + KEPT

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
    for index, (job, integrators) in enumerate(_JOBS.items()):
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
