"""A look at a crowd, for every layout that gathers: it changes nothing.

Five kernels in turn: the reasons to stop a robot; the positions that are shown, good ones for a
stopped robot; what each mass contributes; sums over runs of slots; sums over robots. The sums are
taken in float64, in an order that depends on the robot alone.
"""

import functools
from typing import NamedTuple

import warp as wp

from warp_springs.kernels.buffers import real_type, structs
from warp_springs.kernels.flat import CPU_OPTIONS
from warp_springs.kernels.gather import LOOKS, GatherFeatures, gather_structs, passes, run_type

__all__ = ["Look", "look"]

# `index` counts slices where their slots are lanes, else slots.
_SITE = r"""
const int slice = index / (SLICE / W);
const int robot = model.slices.data[slice * SITE_COLUMNS];
const Slot at = {slice, index % (SLICE / W), robot, index * W,
                 model.robots.data[robot * ROBOT_COLUMNS]};
if (!wanted.data[robot]) return;
const scalar* const now = state.positions.data + side * 4 * (long long)slots;
int* const flag = state.flags.data + robots + robot;
const bool was_stopped = state.states.data[robot] != 0, stopped = was_stopped || *flag != 0;
"""

_FIND = r"""
if (!was_stopped) raise(flag, trouble(at, now, load(state.velocities.data, at)));
"""

_SHOW = r"""
real w;
Vec a = own_quad(now, at, w);
if (stopped) a = load(state.good_positions.data, at);
keep_quad(shown.data, at, a, w);
"""

_LOOK = r"""
real w;
const Vec a = own_quad(shown.data, at, w), u = load(state.velocities.data, at);
const scalar sine = state.oscillators.data[2 * ((long long)side * robots + robot)];
const scalar cosine = state.oscillators.data[2 * ((long long)side * robots + robot) + 1];
const real si = zero + sine, co = zero + cosine;
const Force sum = gather(at, shown.data, a, sine, cosine);
Vec v = u;
Losses losses = {};
Accounts accounts = open_accounts(stopped ? state.good_ledgers.data : state.ledgers.data, at);
if (!EULER && step > 0) synchronise(v, sum.f, w, a.z, losses);
if (LEDGER && !stopped) {
    enter(accounts.values, losses, u, v, w);
    if (ACTUATED && !EULER && step > 0) accounts.values[0] += sum.power * FIRST_KICK;
}
if (stopped) v = load(state.good_velocities.data, at);
real springs = zero;
if (LEDGER)
    each_spring(at, shown.data, [&](Vec b, real k, real ha, real hs, real hc) {
        const Vec d = b - a;
        springs += spring_energy(squared_length(d.x, d.y, d.z), k,
                                 ACTUATED ? breathing(ha, hs, hc, si, co) : ha) * scalar(0.5);
    });
const real m = (zero + scalar(1)) / w;
const real energies[4] = {kinetic_energy(v, m), gravity_energy(a, m), springs,
                          GROUND ? ground_energy(a.z) : zero};
for (int l = 0; l < W; ++l) {
    const int slot = slice * SLICE + at.lane + l, home = model.homes.data[slot];
    double* const out = parts.data + LOOKS * (long long)slot;
    if (home < 0) {
        for (int e = 0; e < LOOKS; ++e) out[e] = 0.0;
        continue;
    }
    const long long place = model.robots.data[robot * ROBOT_COLUMNS + 1] + 3 * (long long)home;
    const Vec* const both[2] = {&a, &v};
    scalar* const seen_in[2] = {seen.seen_positions.data, seen.seen_velocities.data};
    for (int q = 0; q < 2; ++q) {
        seen_in[q][place] = lane_of(both[q]->x, l);
        seen_in[q][place + 1] = lane_of(both[q]->y, l);
        seen_in[q][place + 2] = lane_of(both[q]->z, l);
    }
    const double mass = 1.0 / double(lane_of(w, l));
    out[0] = mass;
    out[1] = mass * double(lane_of(a.x, l));
    out[2] = mass * double(lane_of(a.y, l));
    out[3] = mass * double(lane_of(a.z, l));
    for (int e = 0; LEDGER && e < 4; ++e) {
        out[4 + e] = double(lane_of(energies[e], l));
        out[8 + e] = double(lane_of(accounts.values[e], l));
    }
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
const int lane = about[2];
int* const flag = state.flags.data + robots + robot;
double total[LOOKS] = {};
for (int e = 0; e < (LEDGER ? LOOKS : 4); ++e)
    for (int c = about[3]; c < about[3] + about[4]; ++c)
        total[e] += sums.data[LOOKS * (long long)c + e];
for (int axis = 0; axis < 3; ++axis)
    seen.seen_centers.data[3 * lane + axis] = scalar(total[1 + axis] / total[0]);
for (int e = 0; LEDGER && e < 8; ++e)
    seen.seen_energies.data[8 * lane + e] = scalar(total[4 + e]);
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
    Model, State = gather_structs(features.precision)
    Run, Seen = run_type(features.precision), structs(features.precision).seen
    real = real_type(features.precision)
    module = wp.get_module(features.name + "_look")
    options = CPU_OPTIONS if features.vector else {"enable_backward": False}
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
                wp.tid(),
            )

        return launch

    return Look(
        [
            kernel("find", _SITE + _FIND),
            kernel("show", _SITE + _SHOW),
            kernel("look", _SITE + _LOOK),
            kernel("add", _ADD),
            kernel("report", _REPORT),
        ],
        ["sites", "sites", "sites", "chunks", "robots"],
    )
