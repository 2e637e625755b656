"""What is done to the masses of a crowd: C++ text for a slot, or for as many as there are lanes.

The forces on a mass, what it has of its own, its health, its moves, and its origin in mixed
precision; see ``kernels.gather``.
"""

__all__ = ["SLOT_PASSES"]

SLOT_PASSES = r"""
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
auto instant_of = [&](int robot, scalar sine, scalar cosine)
        __attribute__((always_inline)) -> Instant {
    const int* const about = model.robots.data + robot * ROBOT_COLUMNS;
    const scalar omega = LEDGER ? scalar(model.omegas.data[robot]) : scalar(0);
    Instant now = {zero + sine, zero + cosine, zero + omega, Table{}};
    if (TIMETABLE) now.table = table_at(model.times.data + about[6], about[7], instant);
    return now;
};
// Half of the power of each spring belongs to either end. `rates`: what the dashpots see of the
// velocities, or null.
struct Force { Vec f; real power, dash_power; };
auto gather_special = [&](Slot at, const scalar* where, Vec a, scalar sine, scalar cosine,
                          const scalar* rates) __attribute__((always_inline)) -> Force {
    const Instant now = instant_of(at.robot, sine, cosine);
    const bool damped = DASHPOTS && rates != nullptr;
    real w;
    const Vec own_rate = damped ? own_quad(rates, among_all(at), w) : Vec{};
    Force sum = {};
    each_end(at, [&](const unsigned* j, long long, const Spring& spring)
            __attribute__((always_inline)) {
        const Vec d = neighbours_of(where + 4 * at.base, j) - a;
        const Vec u = damped ? neighbours_of(rates + 4 * at.root, j) - own_rate : Vec{};
        const Pull found = special_pull(d, u, damped, spring, now);
        sum.f = sum.f + scaled(d, found.pull);
        if (LEDGER) sum.power += found.power * scalar(0.5);
        if (LEDGER) sum.dash_power += found.dash_power * scalar(0.5);
    });
    return sum;
};
auto gather = [&](Slot at, const scalar* where, Vec a, scalar sine, scalar cosine,
                  const scalar* rates) __attribute__((always_inline)) -> Force {
    if (SPECIAL) return gather_special(at, where, a, sine, cosine, rates);
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
// collisions
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
        const Slot here = {row, at.lane, 0, 0, 0, 0};
        const wide* const o = wide_in_slice(model.outer_values.data, here, 6);
        const Far given = {o[0], o[STRIDE], o[2 * STRIDE]};  // a force, or the point of a tether
        const Vec pull = tether_force(way_from(x, given), narrow(o[3 * STRIDE]),
                                      narrow(o[4 * STRIDE]));
        sum = sum + scaled(pick(narrow(o[5 * STRIDE] > wide_zero), pull, near_of(given)), part);
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
        const wide* const b = wide_in_slice(model.bonds.data, at, 10);
        own.diagonal = Far{b[0], b[STRIDE], b[2 * STRIDE]};
        own.corner = Far{b[3 * STRIDE], b[4 * STRIDE], b[5 * STRIDE]};
        own.centre = Far{b[6 * STRIDE], b[7 * STRIDE], b[8 * STRIDE]};
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
    auto is_far = [=](Vec b) __attribute__((always_inline)) -> mask {
        const Vec d = b - a;
        return squared_length(d.x, d.y, d.z) > reach2;
    };
    if (SPECIAL)
        each_end(at, [&](const unsigned* j, long long, const Spring& spring)
                __attribute__((always_inline)) {
            stretched |= is_far(neighbours_of(where + 4 * at.base, j)) & is_whole(spring);
        });
    else
        each_spring(at, where, [&](Vec b, real, real, real, real) __attribute__((always_inline)) {
            stretched |= is_far(b);
        });
    const Place place = in_world(sum_of(&a, &low, 0));
    bool deep = GROUND && any(place.z < -depth_limit);
    if (OBSTACLES) deep = any((w > zero) & (depth_in_obstacles(place) > zero + depth_limit));
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
auto wave_at = [=](double omega, long long n, scalar& sine, scalar& cosine) {
    double turns = omega * (double(n) * run.exact_dt) * 0.15915494309189535;
    turns -= ::floor(turns);
#if defined(__CUDA_ARCH__)
    sine = scalar(::sinpi(2.0 * turns)); cosine = scalar(::cospi(2.0 * turns));
#else
    sine = scalar(::sin(6.283185307179586 * turns));
    cosine = scalar(::cos(6.283185307179586 * turns));
#endif
};
auto oscillator = [=](int robot, long long n, scalar& sine, scalar& cosine) {
    wave_at(model.omegas.data[robot], n, sine, cosine);
};
// The oscillators of springs with a frequency of their own, at each end.
auto set_ends = [=](Slot at, long long n) {
    if (!ACTUATED || !OWN_OMEGAS) return;
    each_end(at, [=](const unsigned*, long long, const Spring& spring) {
        for (int l = 0; l < W; ++l) {
            scalar sine, cosine;
            wave_at(spring.omegas[l], n, sine, cosine);
            set_lane(spring.turning[0], l, sine);
            set_lane(spring.turning[1], l, cosine);
        }
    });
};
auto turn_ends = [=](Slot at) {
    if (!ACTUATED || !OWN_OMEGAS) return;
    each_end(at, [=](const unsigned*, long long, const Spring& spring) {
        real* const o = spring.turning;
        const real sine = o[0], cosine = o[1];
        o[0] = sine * o[2] + cosine * o[3];
        o[1] = cosine * o[2] - sine * o[3];
    });
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
// Breaking and yielding, once a step, before its kicks.
auto wear_slot = [&](Slot at, const scalar* where, scalar sine, scalar cosine) {
    if (!LIMITS) return;
    real w, loss = zero;
    const Vec a = own_quad(where, at, w);
    const Instant now = instant_of(at.robot, sine, cosine);
    each_end(at, [&](const unsigned* j, long long end, const Spring& spring) {
        const Vec d = neighbours_of(where + 4 * at.base, j) - a;
        const Damage found = wear_spring(d, spring, now, w > zero);
        loss += found.loss * scalar(0.5);
        if (!any(found.breaks)) return;
        for (int l = 0; l < W; ++l)
            if (lane_of(select(found.breaks, zero + scalar(1), zero), l) > scalar(0))
                state.broken_at.data[end + l] = instant;
    });
    if (!LEDGER) return;
    Accounts accounts = open_accounts(state.ledgers.data, at);
    accounts.values[6] += loss;
    close_accounts(state.ledgers.data, at, accounts);
};
// What the dashpots see: velocities as a kick begins, then, by the midpoint rule, in its middle, as
// forces at the former make them, those of collisions too. Between the two all must have met. For
// `now`, `then` and `shifted` see move_slot.
auto rate_slot = [&](Slot at, const scalar* now, const scalar* then, Vec low, Sum v, bool shifted,
                     bool start) {
    real w;
    const Vec here = own_quad(now, at, w), high = shifted ? own_quad(then, at, w) : here;
    Losses losses = {};
    if (!start) {
        const Place place = in_world(sum_of(&high, &low, 0));
        lose_before(v, place, w, own_of(at, here, nullptr), losses);
    }
    keep_quad(state.rates.data, among_all(at), v, w);
};
auto middle_slot = [&](Slot at, const scalar* now, const scalar* then, Vec low, scalar sine,
                       scalar cosine, scalar time, bool shifted) {
    real w;
    const Vec here = own_quad(now, at, w), high = shifted ? own_quad(then, at, w) : here;
    Force sum = gather(at, now, here, sine, cosine, state.rates.data);
    Accounts none = {};
    touches_of(at, sum, none, scalar(0), false);
    const Place place = in_world(sum_of(&high, &low, 0));
    const Vec a = kick_acceleration(sum.f, place, w, own_of(at, here, nullptr));
    const Vec rate = own_quad(state.rates.data, among_all(at), w);
    keep_quad(state.middle_rates.data, among_all(at), rate + scaled(a, zero + time * scalar(0.5)),
              w);
};
// One kick by the springs and its drift, from the positions `now` into the buffer `then`, which
// holds the positions if the springs pull where the gradient kick looks.
// `rest` is what each surface leaves over for friction, from one drift of a step to the next.
auto move_slot = [&](Slot at, const scalar* now, scalar* then, Vec& low, Sum& v, real* rest,
                     scalar sine, scalar cosine, bool shifted, scalar time, bool start, bool last)
        __attribute__((always_inline)) {
    real w;
    const Vec here = own_quad(now, at, w);
    const scalar* const rates = EULER ? state.rates.data : state.middle_rates.data;
    Force sum = gather(at, now, here, sine, cosine, DASHPOTS ? rates : nullptr);
    const Vec high = shifted ? own_quad(then, at, w) : here;
    Sum a = sum_of(&high, &low, 0);
    const Sum x_before = a, v_before = v;
    Accounts accounts = open_accounts(state.ledgers.data, at);
    if (LEDGER && (ACTUATED || TIMETABLE) && !shifted) accounts.values[0] += sum.power * time;
    if (LEDGER && DASHPOTS) accounts.values[5] += sum.dash_power * time;
    touches_of(at, sum, accounts, time, true);
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
    Force sum = gather(at, now, here, sine, cosine, nullptr);
    Accounts none = {};
    touches_of(at, sum, none, scalar(0), false);
    if (LEDGER && (ACTUATED || TIMETABLE)) {
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
