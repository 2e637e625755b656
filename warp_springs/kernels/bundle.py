"""A bundle as the kernels see it: its blocks, the force on a mass, its health, and a look at it.

C++ text for W robots of one topology in the lanes; ``kernels.lanes`` puts it together with the
passes that step them.
"""

from warp_springs.kernels.buffers import BUNDLE
from warp_springs.kernels.collisions import COLLIDING
from warp_springs.kernels.dialect import vector_dialect
from warp_springs.kernels.element_text import OWN_OF, RATES
from warp_springs.kernels.features import CHECK_EVERY, Features, feature_flags
from warp_springs.kernels.law import CONSTANTS, LAW
from warp_springs.kernels.springs import KEEPING, WEAR

__all__ = ["CONTROL", "OBSERVE", "preamble"]


def preamble(features: Features) -> str:
    """What both kernels begin with: the number type, the features, the law, the bundle."""
    lines = [
        f"const int64_t {column}_ = model.bundles.data[bundle * {len(BUNDLE)} + {i}];"
        for i, column in enumerate(BUNDLE)
    ]
    lines += [f"const double* const run = model.constants.data + level_ * {len(CONSTANTS)};"]
    lines += ["const double exact_dt = run[0];"]
    lines += [f"const scalar {name} = scalar(run[{i}]);" for i, name in enumerate(CONSTANTS)]
    lines += [f"const int CHECK_EVERY = {CHECK_EVERY};"]
    lines += ["const double* const obstacles = model.obstacles.data;"]
    lines += ["const double* const heights = model.heights.data;"]
    dialect = vector_dialect(features.precision, features.width) + feature_flags(features)
    collisions = COLLIDING if features.traits.colliding else _APART
    bundle = _BUNDLE.replace(_COLLISIONS, collisions)
    return dialect + "\n".join(lines) + _ORIGIN + LAW + bundle


# Where collisions have their place in the text, and what stands there without them.
_COLLISIONS = "// collisions\n"
_APART = """
real collision_energy = zero;
auto collide = [](const Vec*, scalar, bool, bool) {};
auto enter_collisions = [](scalar) {};
"""


# The origin of the positions of each lane, as the law sees it.
_ORIGIN = r"""
real origins_here[3] = {};
wide far_origins_here[3] = {};
real* const origin = origins_here;
wide* const far_origin = far_origins_here;
double* const origins = state.origins.data + 3 * lane_;
auto look_up_origin = [=]() {
    for (int c = 0; MIXED && c < 3; ++c) {
        for (int l = 0; l < W; ++l) far_origin[c][l] = wide_scalar(origins[c * W + l]);
        origin[c] = narrow(far_origin[c]);
    }
};
look_up_origin();
"""

# What both kernels need: the blocks of one bundle, one row of springs, its health.
_BUNDLE = (
    r"""
const int M = (int)masses_, S = (int)springs_, substeps = (int)substeps_;
Vec* const x = (Vec*)(state.positions.data + state_);
Vec* const v = (Vec*)(state.velocities.data + state_);
Vec* const low_x = (Vec*)(state.low_positions.data + state_);  // in mixed precision
Vec* const low_v = (Vec*)(state.low_velocities.data + state_);
Vec* const good_low_x = (Vec*)(state.good_low_positions.data + state_);
Vec* const good_low_v = (Vec*)(state.good_low_velocities.data + state_);
Vec* const good_x = (Vec*)(state.good_positions.data + state_);
Vec* const good_v = (Vec*)(state.good_velocities.data + state_);
const real* const w = (const real*)(model.inverse_masses.data + mass_);
const real* const p = (const real*)(model.coefficients.data + spring_);
const int* const row = model.rows.data + row_;
const int* const partner = model.partners.data + partner_;
const int* const pairs = model.pairs.data + pair_;
real& sine = *(real*)(state.oscillators.data + 4 * lane_);
real& cosine = *(real*)(state.oscillators.data + 4 * lane_ + W);
const real turn_cosine = *(const real*)(state.oscillators.data + 4 * lane_ + 2 * W);
const real turn_sine = *(const real*)(state.oscillators.data + 4 * lane_ + 3 * W);
real omega = zero;
for (int l = 0; LEDGER && l < W; ++l) omega[l] = scalar(model.omegas.data[lane_ + l]);
const real reach2 = *(const real*)(model.reaches2.data + lane_);
int* const health = state.states.data + lane_;
double* const health_time = state.state_times.data + lane_;
Vec* const F = (Vec*)scratch.data;
Vec* const shifted_x = F + M;
real* const left_over = (real*)(shifted_x + M);  // for each surface a mass may touch

// Accounts of the ledger since it was opened.
real* const ledger = (real*)(state.ledgers.data + 2 * ACCOUNTS * lane_);
real* const good_ledger = ledger + ACCOUNTS;
real power = zero;

"""
    + OWN_OF
    + r"""
"""
    + KEEPING
    + r"""
// Half the stiffness times the rest length, at an instant.
auto half_rest_force = [=](int s, real si, real co) __attribute__((always_inline)) -> real {
    return ACTUATED ? breathing(p[K * s + 1], p[K * s + 2], p[K * s + 3], si, co) : p[K * s + 1];
};
auto stiffness = [=](int s) -> real { return p[K * s]; };
// Who of different robots has a mass, and a spring.
auto has_mass = [=](int i) -> mask { return MERGED ? w[i] > zero : zero == zero; };
auto has_spring = [=](int s) -> mask { return MERGED ? p[K * s] > zero : zero == zero; };
// The force of spring s on its first mass, at a, whose other mass is at b.
auto spring_force = [&](Vec a, Vec b, int s, real si, real co)
        __attribute__((always_inline)) -> Vec {
    const Vec d = b - a;
    if (SPECIAL) return special_force(d, s, si, co);
    const real length2 = squared_length(d.x, d.y, d.z), k = stiffness(s);
    const real h = half_rest_force(s, si, co);
    if (LEDGER && ACTUATED) {
        const real rate = breathing_rate(p[K * s + 2], p[K * s + 3], si, co, omega);
        power += select(has_spring(s), breathing_power(length2, k, h, rate), zero);
    }
    const real pull = spring_pull(length2, k, h);
    return Vec{pull * d.x, pull * d.y, pull * d.z};
};
// The whole force on mass i where the masses are at x; forces on later masses are left in F.
auto row_force = [&](const Vec* x, int i, real si, real co)
        __attribute__((always_inline)) -> Vec {
    const Vec a = x[i];
    Vec f = F[i];
    F[i] = Vec{zero, zero, zero};
    for (int s = row[i]; s < row[i + 1]; ++s) {
        const int j = partner[s];
        const Vec pull = spring_force(a, x[j], s, si, co);
        f = f + pull;
        F[j] = F[j] - pull;
    }
    return f;
};
// The reasons, by lane, why a robot must be stopped now, as values of warp_springs.Status: 1 not
// finite, 2 overstretched, 3 too fast, 4 too deep; 0 none.
auto diagnose = [=]() -> mask {
    real poison = zero;
    mask fast = zero > zero, stretched = fast, deep = fast;
    for (int i = 0; i < M; ++i) {
        const Vec a = x[i], u = v[i];
        const mask here = has_mass(i);
        poison += select(here, poison_of(a, u), zero);
        fast |= here & too_fast(u, a - good_x[i]);
        if (GROUND) deep |= here & (in_world(sum_of(x, low_x, i)).z < -depth_limit);
        if (OBSTACLES)
            deep |= depth_in_obstacles(in_world(sum_of(x, low_x, i))) > zero + depth_limit;
        for (int s = row[i]; s < row[i + 1]; ++s) {
            const Vec b = x[partner[s]];
            const mask far = squared_length(b.x - a.x, b.y - a.y, b.z - a.z) > reach2;
            stretched |= LIMITS ? far & is_whole(spring_of(s)) : far & has_spring(s);
        }
    }
    const mask finite = poison == zero;
    mask reason = deep & 4;
    reason = stretched ? (mask{} + 2) : reason;
    reason = fast ? (mask{} + 3) : reason;
    return finite ? reason : (mask{} + 1);
};
"""
    + RATES
    + r"""
auto stopped_lanes = [=]() -> mask {
    mask stopped;
    for (int l = 0; l < W; ++l) stopped[l] = health[l] != 0 ? -1 : 0;
    return stopped;
};
auto all_stopped = [=]() -> bool { return !any(~stopped_lanes()); };
"""
)

CONTROL = (
    WEAR
    + r"""
#if MIXED
// The origin follows a robot whose centre has left it by more than a quantum, in whole quanta.
auto follow = [&]() {
    Vec center = {};
    real count = zero;
    for (int i = 0; i < M; ++i) {
        const mask here = has_mass(i);
        center = center + Vec{select(here, x[i].x, zero), select(here, x[i].y, zero),
                              select(here, x[i].z, zero)};
        count += select(here, zero + scalar(1), zero);
    }
    const real quantum = *(const real*)(model.quanta.data + lane_);
    const mask goes_on = ~stopped_lanes();
    auto way = [=](real sum) -> real {
        const real middle = sum / count;
        const mask away = __builtin_elementwise_abs(middle) > quantum;
        return select(away & goes_on, __builtin_elementwise_rint(middle / quantum) * quantum, zero);
    };
    const real shift[3] = {way(center.x), way(center.y), way(center.z)};
    if (!any((shift[0] != zero) | (shift[1] != zero) | (shift[2] != zero))) return;
    for (int i = 0; i < M; ++i) {
        move_origin(x[i].x, low_x[i].x, shift[0]);
        move_origin(x[i].y, low_x[i].y, shift[1]);
        move_origin(x[i].z, low_x[i].z, shift[2]);
        good_x[i] = x[i]; good_low_x[i] = low_x[i];
    }
    for (int c = 0; c < 3; ++c)
        for (int l = 0; l < W; ++l) origins[c * W + l] += double(shift[c][l]);
    look_up_origin();
};
#else
auto follow = []() {};
#endif
// Stops the robots that went wrong since the last check where they were last good.
auto check = [&](long long n) {
    mask stopped = stopped_lanes();
    const mask reason = diagnose() & ~stopped;
    if (any(reason != 0)) {
        for (int l = 0; l < W; ++l)
            if (reason[l] != 0) {
                health[l] = (int)reason[l];
                health_time[l] = double(n) * exact_dt;
            }
        stopped = stopped_lanes();
    }
    mask kept = stopped;  // and a mass that is nobody's
    auto restore = [&](real& now, real& good) __attribute__((always_inline)) {
        now = good = select(kept, good, now);
    };
    auto restore_vec = [&](Vec& now, Vec& good) __attribute__((always_inline)) {
        restore(now.x, good.x); restore(now.y, good.y); restore(now.z, good.z);
    };
    for (int i = 0; i < M; ++i) {
        kept = stopped | ~has_mass(i);
        restore_vec(x[i], good_x[i]);
        restore_vec(v[i], good_v[i]);
        if (MIXED) {
            restore_vec(low_x[i], good_low_x[i]);
            restore_vec(low_v[i], good_low_v[i]);
        }
    }
    kept = stopped;
    for (int e = 0; LEDGER && e < ACCOUNTS; ++e) restore(ledger[e], good_ledger[e]);
    follow();
};
auto set_oscillators = [&](long long n) {
    for (int l = 0; l < W; ++l) {
        const double angle = model.omegas.data[lane_ + l] * (double(n) * exact_dt);
        sine[l] = scalar(::sin(angle)); cosine[l] = scalar(::cos(angle));
    }
    for (int s = 0; OWN_OMEGAS && s < S; ++s)
        for (int l = 0; l < W; ++l) {
            const double angle = spring_omegas[W * s + l] * (double(n) * exact_dt);
            set_lane(turning[4 * s], l, scalar(::sin(angle)));
            set_lane(turning[4 * s + 1], l, scalar(::cos(angle)));
        }
};
auto turn_oscillators = [&]() __attribute__((always_inline)) {
    if (!ACTUATED) return;
    const real si = sine, co = cosine;
    sine = si * turn_cosine + co * turn_sine;
    cosine = co * turn_cosine - si * turn_sine;
    for (int s = 0; OWN_OMEGAS && s < S; ++s) {
        real* const o = turning + 4 * s;
        const real own_sine = o[0], own_cosine = o[1];
        o[0] = own_sine * o[2] + own_cosine * o[3];
        o[1] = own_cosine * o[2] - own_sine * o[3];
    }
};
"""
)

OBSERVE = r"""
wide* const seen_x = (wide*)(seen.seen_positions.data + state_);
wide* const seen_v = (wide*)(seen.seen_velocities.data + state_);
wide* const com = (wide*)(seen.seen_centers.data + 3 * lane_);
real* const energy = (real*)(seen.seen_energies.data + ENERGIES * lane_);

const mask before = stopped_lanes();
const mask reason = diagnose() & ~before;
const mask stopped = before | (reason != 0);
const double now = double((long long)step * division_) * exact_dt;
for (int l = 0; l < W; ++l) {
    seen.seen_states.data[lane_ + l] = health[l] != 0 ? health[l] : (int)reason[l];
    seen.seen_state_times.data[lane_ + l] = health[l] != 0 ? health_time[l] : now;
}
auto choose_part = [=](Vec good, Vec now) -> Vec {
    return Vec{select(stopped, good.x, now.x), select(stopped, good.y, now.y),
               select(stopped, good.z, now.z)};
};
#if MIXED
auto choose = [=](const Sum& good, const Sum& now) -> Sum {
    return Sum{choose_part(good, now), choose_part(good.low, now.low)};
};
auto show = [=](wide* out, const Sum& a, const double* from) {
    wide at[3] = {};
    for (int c = 0; from && c < 3; ++c) __builtin_memcpy(&at[c], from + c * W, sizeof(wide));
    out[0] = at[0] + (widen(a.x) + widen(a.low.x));
    out[1] = at[1] + (widen(a.y) + widen(a.low.y));
    out[2] = at[2] + (widen(a.z) + widen(a.low.z));
};
#else
auto choose = choose_part;
auto show = [=](wide* out, Vec a, const double*) { out[0] = a.x; out[1] = a.y; out[2] = a.z; };
#endif

real kinetic = zero, gravity = zero, springs = zero, ground = zero;
wide total_mass = {}, center[3] = {};
Vec* const seen_here = shifted_x;
real accounts[ACCOUNTS];
for (int e = 0; LEDGER && e < ACCOUNTS; ++e) accounts[e] = ledger[e];
for (int i = 0; i < M; ++i) F[i] = Vec{zero, zero, zero};
kick_end = now;
kick_begin = now - exact_dt * (CHIN4 ? 1.0 / 6.0 : 0.5);
if (OUTER) gather_outer(x);
consult_timetable(now);
if (DASHPOTS && step > 0) {
    auto rows = [&](const Vec* at, auto move) {
        for (int i = 0; i < M; ++i) move(i, row_force(at, i, sine, cosine));
    };
    find_rates(x, FIRST_KICK, EULER, rows);
}
if (COLLIDING) {
    collide(x, FIRST_KICK, step > 0, false);
    if (step > 0 && !EULER) enter_collisions(FIRST_KICK);
    ground += collision_energy;
}
for (int i = 0; i < M; ++i) {
    const Vec f = row_force(x, i, sine, cosine);
    const Sum here = sum_of(x, low_x, i);
    Sum u = sum_of(v, low_v, i);
    Losses losses = {};
    if (!EULER && step > 0) synchronise(u, f, in_world(here), w[i], own_of(i), losses);
    enter(ledger, losses, v[i], u, w[i]);
    const Sum a = choose(sum_of(good_x, good_low_x, i), here);
    u = choose(sum_of(good_v, good_low_v, i), u);
    seen_here[i] = a;
    show(seen_x + 3 * i, a, origins);
    show(seen_v + 3 * i, u, nullptr);
    const real m = select(has_mass(i), (zero + scalar(1)) / w[i], zero);
    total_mass += widen(m);
    for (int c = 0; c < 3; ++c) center[c] += widen(m) * seen_x[3 * i + c];
    kinetic += kinetic_energy(u, m);
    gravity += gravity_energy(in_world(a), m);
    ground += contact_energy(in_world(a), own_of(i));
}
for (int c = 0; c < 3; ++c) com[c] = center[c] / total_mass;
if (LEDGER) {
    if ((ACTUATED || TIMETABLE) && !EULER && step > 0) ledger[0] += power * FIRST_KICK;
    if (DASHPOTS && !EULER && step > 0) ledger[5] += dash_power * FIRST_KICK;
    for (int i = 0; i < M; ++i) {
        const Vec a = seen_here[i];
        for (int s = row[i]; s < row[i + 1]; ++s) {
            const Vec b = seen_here[partner[s]];
            const real length2 = squared_length(b.x - a.x, b.y - a.y, b.z - a.z);
            const real stored = SPECIAL
                ? special_energy(length2, spring_of(s), Instant{sine, cosine, omega, table})
                : spring_energy(length2, stiffness(s), half_rest_force(s, sine, cosine));
            springs += select(has_spring(s), stored, zero);
        }
    }
    energy[0] = kinetic; energy[1] = gravity; energy[2] = springs; energy[3] = ground;
    for (int e = 0; e < ACCOUNTS; ++e) {
        energy[4 + e] = select(stopped, good_ledger[e], ledger[e]);
        ledger[e] = accounts[e];  // looking changes nothing
    }
}
"""
