"""A look at a crowd, for every layout that gathers: it changes nothing.

Kernels in turn: the reasons to stop a robot; the positions that are shown, good ones for a stopped
robot; the temporary springs of collisions; what dashpots see, where there are any; what each mass
contributes; sums over runs of slots; sums over robots. The sums are taken in float64, in an order
that depends on the robot alone.
"""

import functools
from typing import NamedTuple

import warp as wp

from warp_springs.kernels.buffers import real_type, structs
from warp_springs.kernels.crowd_collisions import COLLISION_JOBS
from warp_springs.kernels.dialect import PROCESSOR_OPTIONS
from warp_springs.kernels.gather import LOOKS, GatherFeatures, gather_structs, passes, run_type

__all__ = ["Look", "look"]

# `index` counts slices where their slots are lanes, else slots.
_SITE = r"""
const int slice = index / (SLICE / W);
const int robot = model.slices.data[slice * SITE_COLUMNS];
const int root = model.robots.data[robot * ROBOT_COLUMNS];
const Slot at = {slice, index % (SLICE / W), robot, index * W, root, root};
if (!wanted.data[robot]) return;
const scalar* const now = state.positions.data + side * 4 * (long long)slots;
int* const flag = state.flags.data + robots + robot;
look_up_origin(robot);
const bool was_stopped = state.states.data[robot] != 0, stopped = was_stopped || *flag != 0;
"""

_FIND = r"""
if (!was_stopped) raise(flag, trouble(at, now, MIXED ? load(state.low_positions.data, at) : Vec{},
                                load(state.velocities.data, at)));
"""

_SHOW = r"""
real w;
Vec a = own_quad(now, at, w);
if (stopped) a = load(state.good_positions.data, at);
keep_quad(shown.data, at, a, w);
"""

# Trees and lists of neighbours may be made anew: that changes no motion.
_COLLIDE = r"""
const scalar* const where = shown.data;
const scalar time = FIRST_KICK;
const bool rubs = step > 0, keeps = false;
auto takes_part = [=](int robot) -> bool { return wanted.data[robot] != 0; };
"""

# A mass at the instant of the look.
_SEEN = r"""
real w;
const Vec a = own_quad(shown.data, at, w);
const Vec low = MIXED ? load(stopped ? state.good_low_positions.data : state.low_positions.data, at)
                      : Vec{};
const Sum x = sum_of(&a, &low, 0);
const Sum u = load_sum(state.velocities.data, state.low_velocities.data, at);
const scalar sine = state.oscillators.data[2 * ((long long)side * robots + robot)];
const scalar cosine = state.oscillators.data[2 * ((long long)side * robots + robot) + 1];
const real si = zero + sine, co = zero + cosine;
kick_end = instant = double((long long)step) * exact_dt;
kick_begin = instant - exact_dt * (CHIN4 ? 1.0 / 6.0 : 0.5);
const bool kicked = !EULER && step > 0;  // the last part of the kicks is still to come
"""

# What the dashpots see, in that part.
_RATES = r"""
if (kicked) rate_slot(at, shown.data, nullptr, low, u, false, false);
"""
_MIDDLE = r"""
if (kicked) middle_slot(at, shown.data, nullptr, low, sine, cosine, FIRST_KICK, false);
"""

_LOOK = r"""
const Own own = own_of(at, a, nullptr);
const scalar* const rates = DASHPOTS && kicked ? state.middle_rates.data : nullptr;
Force sum = gather(at, shown.data, a, sine, cosine, rates);
Sum v = u;
Losses losses = {};
Accounts accounts = open_accounts(stopped ? state.good_ledgers.data : state.ledgers.data, at);
touches_of(at, sum, accounts, FIRST_KICK, kicked && !stopped);
if (kicked) synchronise(v, sum.f, in_world(x), w, own, losses);
if (LEDGER && !stopped) {
    enter(accounts.values, losses, u, v, w);
    if ((ACTUATED || TIMETABLE) && kicked) accounts.values[0] += sum.power * FIRST_KICK;
    if (DASHPOTS && kicked) accounts.values[5] += sum.dash_power * FIRST_KICK;
}
if (stopped) v = load_sum(state.good_velocities.data, state.good_low_velocities.data, at);
real springs = zero;
if (LEDGER && SPECIAL)
    each_end(at, [&](const unsigned* j, long long, const Spring& spring) {
        const Vec d = neighbours_of(shown.data + 4 * at.base, j) - a;
        springs += special_energy(squared_length(d.x, d.y, d.z), spring,
                                  instant_of(robot, sine, cosine)) * scalar(0.5);
    });
else if (LEDGER)
    each_spring(at, shown.data, [&](Vec b, real k, real ha, real hs, real hc) {
        const Vec d = b - a;
        springs += spring_energy(squared_length(d.x, d.y, d.z), k,
                                 ACTUATED ? breathing(ha, hs, hc, si, co) : ha) * scalar(0.5);
    });
const real m = (zero + scalar(1)) / w;
const real energies[4] = {kinetic_energy(v, m), gravity_energy(in_world(x), m), springs,
                          contact_energy(in_world(x), own) + touch_energy(at)};
Vec parts_of_x[2] = {}, parts_of_v[2] = {};
keep_sum(parts_of_x, parts_of_x + 1, 0, x);
keep_sum(parts_of_v, parts_of_v + 1, 0, v);
// A component in the world: high and low part, and the origin.
auto shown_number = [=](real high, real low, int lane, double from) -> wide_scalar {
    return wide_scalar(from) + (wide_scalar(lane_of(high, lane)) + wide_scalar(lane_of(low, lane)));
};
for (int l = 0; l < W; ++l) {
    const int slot = slice * SLICE + at.lane + l, home = model.homes.data[slot];
    double* const out = parts.data + LOOKS * (long long)slot;
    if (home < 0) {
        for (int e = 0; e < LOOKS; ++e) out[e] = 0.0;
        continue;
    }
    const long long place = model.robots.data[robot * ROBOT_COLUMNS + 2] + 3 * (long long)home;
    double from[3] = {};
    for (int c = 0; MIXED && c < 3; ++c) from[c] = state.origins.data[3 * robot + c];
    const Vec &p = parts_of_x[0], &p_low = parts_of_x[1];
    const Vec &q = parts_of_v[0], &q_low = parts_of_v[1];
    const wide_scalar at_place[3] = {shown_number(p.x, p_low.x, l, from[0]),
                                     shown_number(p.y, p_low.y, l, from[1]),
                                     shown_number(p.z, p_low.z, l, from[2])};
    const wide_scalar moving[3] = {shown_number(q.x, q_low.x, l, 0.0),
                                   shown_number(q.y, q_low.y, l, 0.0),
                                   shown_number(q.z, q_low.z, l, 0.0)};
    const double mass = 1.0 / double(lane_of(w, l));
    out[0] = mass;
    for (int c = 0; c < 3; ++c) {
        seen.seen_positions.data[place + c] = at_place[c];
        seen.seen_velocities.data[place + c] = moving[c];
        out[1 + c] = mass * double(at_place[c]);
    }
    for (int e = 0; LEDGER && e < 4; ++e) {
        out[4 + e] = double(lane_of(energies[e], l));
    }
    for (int e = 0; LEDGER && e < ACCOUNTS; ++e)
        out[8 + e] = double(lane_of(accounts.values[e], l));
}
"""

_ADD = r"""
const int* const chunk = model.chunks.data + index * CHUNK_COLUMNS;
if (!wanted.data[chunk[0]]) return;
double* const total = sums.data + LOOKS * (long long)index;
const int kinds = LEDGER ? LOOKS : 4;
for (int e = 0; e < kinds; ++e) {
    double sum = 0.0;
    for (int s = 0; s < chunk[2]; ++s) sum += parts.data[LOOKS * (long long)(chunk[1] + s) + e];
    total[e] = sum;
}
"""

_REPORT = r"""
const int robot = index;
if (!wanted.data[robot]) return;
const int* const about = model.robots.data + robot * ROBOT_COLUMNS;
const int lane = about[3];
int* const flag = state.flags.data + robots + robot;
double total[LOOKS] = {};
for (int e = 0; e < (LEDGER ? LOOKS : 4); ++e)
    for (int c = about[4]; c < about[4] + about[5]; ++c)
        total[e] += sums.data[LOOKS * (long long)c + e];
for (int axis = 0; axis < 3; ++axis)
    seen.seen_centers.data[3 * lane + axis] = wide_scalar(total[1 + axis] / total[0]);
for (int e = 0; LEDGER && e < ENERGIES; ++e)
    seen.seen_energies.data[ENERGIES * lane + e] = scalar(total[4 + e]);
const int health = state.states.data[robot];
seen.seen_states.data[lane] = health ? health : status_of(*flag);
seen.seen_state_times.data[lane] =
    health ? state.state_times.data[robot] : double((long long)step) * run.exact_dt;
*flag = 0;
"""


class Look(NamedTuple):
    """The kernels of a look, in order, and what each is launched over."""

    kernels: list[wp.Kernel]
    over: list[str]


@functools.cache
def look(features: GatherFeatures) -> Look:
    """The kernels that look at crowds of these features."""
    Model, State = gather_structs(features.precision, features.traits.colliding)
    Run, Seen = run_type(features.precision), structs(features.precision).seen
    real = real_type(features.precision)
    module = wp.get_module(features.name + "_look")
    options = PROCESSOR_OPTIONS if features.vector else {"enable_backward": False}
    wp.set_module_options(options, module)
    text = passes(features) + f"const int LOOKS = {LOOKS};\n"

    def kernel(name: str, snippet: str) -> wp.Kernel:
        @wp.func_native(text + snippet)
        def work(
            model: Model,
            state: State,
            run: Run,
            slots: int,
            robots: int,
            side: int,
            step: wp.int64,
            wanted: wp.array(dtype=wp.int32),
            shown: wp.array(dtype=real),
            parts: wp.array(dtype=wp.float64),
            sums: wp.array(dtype=wp.float64),
            seen: Seen,
            team: int,
            index: int,
        ): ...

        @wp.kernel(module=module, name=name)
        def launch(
            model: Model,
            state: State,
            run: Run,
            slots: int,
            robots: int,
            side: int,
            step: wp.int64,
            wanted: wp.array(dtype=wp.int32),
            team: int,
            # outputs
            shown: wp.array(dtype=real),
            parts: wp.array(dtype=wp.float64),
            sums: wp.array(dtype=wp.float64),
            seen: Seen,
        ):
            work(
                model,
                state,
                run,
                slots,
                robots,
                side,
                step,
                wanted,
                shown,
                parts,
                sums,
                seen,
                team,
                wp.tid(),
            )

        return launch

    jobs = {"find": ("sites", _SITE + _FIND), "show": ("sites", _SITE + _SHOW)}
    if features.traits.colliding:
        jobs |= {name: (over, _COLLIDE + job) for name, (over, job) in COLLISION_JOBS.items()}
    if features.traits.dashpots and features.integrator != "euler":
        for name, snippet in {"rates": _RATES, "middle": _MIDDLE}.items():
            jobs[name] = ("sites", _SITE + _SEEN + snippet)
    jobs |= {
        "look": ("sites", _SITE + _SEEN + _LOOK),
        "add": ("chunks", _ADD),
        "report": ("robots", _REPORT),
    }
    kernels = [kernel(name, snippet) for name, (_, snippet) in jobs.items()]
    return Look(kernels, [over for over, _ in jobs.values()])
