"""The layout for a CPU: one thread steps W robots of one topology, a robot in each SIMD lane.

W robots that share a topology form a *bundle*. The innermost index of every array is the lane, so
that each operation of the law is one instruction over W robots, and a bundle runs ALL its steps
before the next one starts: its state stays in the first-level cache.

Springs are sorted into rows by their lower mass. Row i gathers the force on mass i in registers and
subtracts it from the partners, which all come later; so when row i ends mass i has its whole force,
no later row reads its position, and it is moved at once. Two rows go together, since neighbours
share partners.

Robots of different topologies may share a bundle of their union (see ``engine.merging``): where a
lane lacks a mass or a spring, its inverse mass or its stiffness is zero. A lone robot has
its own masses and springs in the lanes (see ``strands`` and ``permuted``).

Every bundle is described by one row of the table ``BUNDLE``: where its blocks start in the flat
buffers, how large they are. So one launch runs bundles of any topologies, and a robot's arithmetic
depends neither on its lane nor on its neighbours.
"""

import functools
from typing import NamedTuple

import warp as wp

from warp_springs.kernels.buffers import real_type, structs
from warp_springs.kernels.bundle import CONTROL, OBSERVE, preamble
from warp_springs.kernels.dialect import PROCESSOR_OPTIONS
from warp_springs.kernels.features import Features
from warp_springs.kernels.steps import STEPS
from warp_springs.kernels.strands import strand_passes, strand_scratch
from warp_springs.kernels.traits import PLAIN

__all__ = ["Features", "Kernels", "kernels", "scratch_size"]


def scratch_size(features: Features, masses: int, springs: int) -> int:
    """Scratch values for bundles of so many masses and springs.

    A force, where the gradient kick of chin4 looks, and the impulse it leaves over for friction,
    for each mass and lane; more where a robot's own springs are the lanes.
    """
    others = (3 if features.traits.outer else 0) + (6 if features.traits.dashpots else 0)
    lanes = (6 + max(1, features.obstacles) + others) * masses * features.width
    strand = strand_scratch(features, masses, springs) if features.width == 1 else 0
    return max(lanes, strand)


class Kernels(NamedTuple):
    """The two kernels of a group: stepping, and looking without touching."""

    advance: wp.Kernel
    observe: wp.Kernel


_PASSES = r"""
// The forces on masses i and i + 1 in one sweep: a partner of both is read and written once. The
// sums are those of two rows, one after the other, to the bit.
auto pair_force = [&](const Vec* x, int i, const int*& pair, real si, real co, Vec& fa, Vec& fb)
        __attribute__((always_inline)) {
    const Vec a = x[i], b = x[i + 1];
    fa = F[i]; fb = F[i + 1];
    F[i] = F[i + 1] = Vec{zero, zero, zero};
    int s = row[i], t = row[i + 1];
    const int end = t;
    for (; s < end && partner[s] == i + 1; ++s) {
        const Vec pull = spring_force(a, b, s, si, co);
        fa = fa + pull; fb = fb - pull;
    }
    for (int runs = *pair++; runs > 0; --runs, pair += 3) {
        for (int n = pair[0]; n > 0; --n, ++s) {
            const int j = partner[s];
            const Vec pull = spring_force(a, x[j], s, si, co);
            fa = fa + pull; F[j] = F[j] - pull;
        }
        for (int n = pair[1]; n > 0; --n, ++s, ++t) {
            const int j = partner[s];
            const Vec c = x[j];
            const Vec pull = spring_force(a, c, s, si, co), other = spring_force(b, c, t, si, co);
            fa = fa + pull; fb = fb + other;
            F[j] = (F[j] - pull) - other;
        }
        for (int n = pair[2]; n > 0; --n, ++t) {
            const int j = partner[t];
            const Vec pull = spring_force(b, x[j], t, si, co);
            fb = fb + pull; F[j] = F[j] - pull;
        }
    }
};
// Forces where the masses are at `where`, and what is to be done with each: move(i, force). The
// ledger adds up row by row, so that it is the same in a bundle of any width.
auto sweep = [&](const Vec* where, auto move) __attribute__((always_inline)) {
    const real si = sine, co = cosine;
    const int* pair = pairs;
    int i = 0;
    for (; W > 1 && !LEDGER && !MERGED && i + 1 < M; i += 2) {
        Vec fa, fb;
        pair_force(where, i, pair, si, co, fa, fb);
        move(i, fa);
        move(i + 1, fb);
    }
    for (; i < M; ++i) move(i, row_force(where, i, si, co));
};

// Work of the breathing springs: their power at the instant of a kick, for the kick's time.
auto enter_work = [&](scalar time) __attribute__((always_inline)) {
    if (ACTUATED || TIMETABLE) { ledger[0] += power * time; power = zero; }
    if (DASHPOTS) { ledger[5] += dash_power * time; dash_power = zero; }
};

// One kick by the springs, as they pull at x or where the gradient kick looks, and its drift.
auto kick_and_drift = [&](bool shifted, scalar time, bool start, bool last)
        __attribute__((always_inline)) {
    const Vec* const where = shifted ? shifted_x : x;
    if (OUTER) gather_outer(where);
    if (DASHPOTS) find_rates(where, time, start, sweep);
    if (COLLIDING) { collide(where, time, true, true); enter_collisions(time); }
    sweep(where, [&](int i, Vec f) __attribute__((always_inline)) {
        Sum a = sum_of(x, low_x, i), u = sum_of(v, low_v, i);
        real rest = CHIN4 && GROUND && last ? left_over[i] : zero;
        const Place at = shifted ? from_here(where[i], a) : in_world(a);
        move_mass(a, u, f, at, w[i], substeps, rest, time, start, last, ledger, own_of(i));
        if (CHIN4 && GROUND && !last) left_over[i] = rest;
        keep_sum(x, low_x, i, a);
        keep_sum(v, low_v, i, u);
    });
    if (LEDGER && DASHPOTS && shifted) { ledger[5] += dash_power * time; dash_power = zero; }
};
auto gradient_shift = [&]() __attribute__((always_inline)) {
    if (OUTER) gather_outer(x);
    if (DASHPOTS) rate_v = nullptr;
    if (COLLIDING) collide(x, GRADIENT_KICK, false, true);
    sweep(x, [&](int i, Vec f) __attribute__((always_inline)) {
        shifted_x[i] = shifted_position(sum_of(x, low_x, i), f, w[i], own_of(i));
    });
};
auto euler = [&]() __attribute__((always_inline)) {
    if (OUTER) gather_outer(x);
    if (DASHPOTS) find_rates(x, dt, true, sweep);
    if (COLLIDING) { collide(x, dt, true, true); enter_collisions(dt); }
    sweep(x, [&](int i, Vec f) __attribute__((always_inline)) {
        Sum a = sum_of(x, low_x, i), u = sum_of(v, low_v, i);
        move_mass_euler(a, u, f, w[i], ledger, own_of(i));
        keep_sum(x, low_x, i, a);
        keep_sum(v, low_v, i, u);
    });
};

auto prepare = [&]() { for (int i = 0; i < M; ++i) F[i] = Vec{zero, zero, zero}; };
auto begin = []() {};
auto end = []() {};
"""

_NO_LEDGER = "auto enter_work = [](scalar) {};"

# What else happens in a step.
_CLOCK = r"""
auto begin_step = [&](double now) { consult_timetable(now); wear(now); };
auto middle_of_step = [&](double now) { consult_timetable(now); };
"""


@functools.cache
def kernels(features: Features) -> Kernels:
    """Kernels specialised on features; the first use of a specialisation compiles it (seconds)."""
    real = real_type(features.precision)
    Model, State, Seen = structs(features.precision)
    common = preamble(features)
    # A named module of its own: compiling one specialisation leaves the others alone.
    module = wp.get_module(features.name)
    wp.set_module_options(PROCESSOR_OPTIONS, module)

    # The ledger adds up in the order of the lanes; it is rarely asked for.
    strand = features.width == 1 and not features.ledger and features.traits == PLAIN
    passes = strand_passes(features.precision) + _NO_LEDGER if strand else _PASSES

    @wp.func_native(common + CONTROL + passes + _CLOCK + STEPS)
    def advance_bundle(
        model: Model,
        state: State,
        scratch: wp.array(dtype=real),
        bundle: int,
        first_step: wp.int64,
        last_step: wp.int64,
    ): ...

    @wp.func_native(common + OBSERVE)
    def observe_bundle(
        model: Model,
        state: State,
        scratch: wp.array(dtype=real),
        bundle: int,
        step: wp.int64,
        seen: Seen,
    ): ...

    @wp.kernel(module=module)
    def advance(
        model: Model,
        state: State,
        scratch: wp.array(dtype=real),
        first_bundle: int,
        first_step: wp.int64,
        last_step: wp.int64,
    ):
        advance_bundle(model, state, scratch, first_bundle + wp.tid(), first_step, last_step)

    @wp.kernel(module=module)
    def observe(
        model: Model,
        state: State,
        scratch: wp.array(dtype=real),
        which: wp.array(dtype=wp.int32),
        step: wp.int64,
        # outputs
        seen: Seen,
    ):
        observe_bundle(model, state, scratch, which[wp.tid()], step, seen)

    return Kernels(advance, observe)
