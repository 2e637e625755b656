"""Springs with more to them than k and L0: the law of one, and how the lanes keep them."""

__all__ = ["KEEPING", "SPRINGS", "WEAR"]

# The law of one spring; `c` are its numbers: slope, k3 / k, and stretch and part of each hinge.
SPRINGS = r"""
auto positive = [=](real a) __attribute__((always_inline)) -> real {
    return select(a > zero, a, zero);
};
// Tension over k at a stretch s, and the energy over k: the tension's integral.
auto curve = [=](real s, const real* c) __attribute__((always_inline)) -> real {
    real g = s * (c[0] + c[1] * s * s);
    for (int j = 0; j < HINGES; ++j)
        g += c[3 + 2 * j] * (positive(s - c[2 + 2 * j]) - positive(-c[2 + 2 * j]));
    return g;
};
auto curve_energy = [=](real s, const real* c) __attribute__((always_inline)) -> real {
    real g = s * s * (c[0] * scalar(0.5) + c[1] * s * s * scalar(0.25));
    for (int j = 0; j < HINGES; ++j) {
        const real at = c[2 + 2 * j], beyond = positive(s - at), before = positive(-at);
        g += c[3 + 2 * j] * ((beyond * beyond - before * before) * scalar(0.5) - before * s);
    }
    return g;
};
// Adds harmonics 2, 3, ... to h and to its rate; c holds hs, hc of each.
auto add_harmonics = [=](real& h, real& rate, const real* c, real si, real co, real omega)
        __attribute__((always_inline)) {
    real s = si, k = co;
    for (int n = 0; n < HARMONICS; ++n) {
        const real next = s * co + k * si;
        k = k * co - s * si;
        s = next;
        h += c[2 * n] * s + c[2 * n + 1] * k;
        if (LEDGER) rate += (c[2 * n] * k - c[2 * n + 1] * s) * (omega * scalar(n + 2));
    }
};
"""

# A spring of a bundle: its numbers follow those of a plain one in the coefficients.
KEEPING = r"""
const bool SPECIAL = HARMONICS || OWN_OMEGAS || CURVED || DASHPOTS || LIMITS || TIMETABLE;
const int AT_HARMONICS = ACTUATED ? 4 : 2, AT_CURVE = AT_HARMONICS + 2 * HARMONICS;
const int AT_DASHPOT = AT_CURVE + (CURVED ? 2 + 2 * HINGES : 0);
const int AT_LIMITS = AT_DASHPOT + (DASHPOTS ? 1 : 0);
const int K = AT_LIMITS + (LIMITS ? 2 : 0);

const int* const spring_start = model.spring_starts.data + spring_list_;
const double* const spring_omegas = model.spring_omegas.data + own_omega_;
real* const turning = (real*)(state.spring_oscillators.data + turning_);  // as oscillators
const double* const times = model.times.data + time_;  // T times, then the period
const real* const schedule = (const real*)(model.schedules.data + schedule_);  // factor, h: [T]
real* const worn = (real*)(state.worn.data + worn_);  // how much a spring flowed; 1, or 0 broken
double* const broken_at = state.broken_at.data + broken_;

// Where the timetable stands at an instant [s].
int table_row = 0;
scalar table_part = 0, table_rate = 0;
auto consult_timetable = [&](double now) {
    if (!TIMETABLE) return;
    const int last = (int)times_ - 2;
    const double period = times[times_];
    const double t = period > 0 ? now - ::floor(now / period) * period : now;
    table_row = 0;
    while (table_row < last && times[table_row + 1] <= t) ++table_row;
    const double wide = times[table_row + 1] - times[table_row];
    const double part = (t - times[table_row]) / wide;
    const bool inside = part >= 0 && part <= 1;
    table_part = scalar(part < 0 ? 0 : part > 1 ? 1 : part);
    table_rate = scalar(inside ? 1 / wide : 0);
};
// A spring at an instant: half of k L0 and its rate, the factor of its stiffness and its rate.
struct Pose { real h, rate, factor, factor_rate; };
auto pose_of = [&](int s, real si, real co) __attribute__((always_inline)) -> Pose {
    const real* const c = p + K * s;
    real w = omega;
    if (OWN_OMEGAS) {
        si = turning[4 * s]; co = turning[4 * s + 1];
        for (int l = 0; LEDGER && l < W; ++l) set_lane(w, l, scalar(spring_omegas[W * s + l]));
    }
    Pose now = {c[1], zero, zero + scalar(1), zero};
    if (ACTUATED) {
        now.h = breathing(c[1], c[2], c[3], si, co);
        if (LEDGER) now.rate = breathing_rate(c[2], c[3], si, co, w);
        add_harmonics(now.h, now.rate, c + AT_HARMONICS, si, co, w);
    }
    if (TIMETABLE) {
        const real* const here = schedule + 2 * ((int)times_ * s + table_row);
        now.factor = here[0] + (here[2] - here[0]) * table_part;
        now.factor_rate = (here[2] - here[0]) * table_rate;
        now.h += here[1] + (here[3] - here[1]) * table_part;
        now.rate += (here[3] - here[1]) * table_rate;
    }
    return now;
};
auto stretch_of = [=](int s, real length, real h) __attribute__((always_inline)) -> real {
    const real stretch = length - h * scalar(2) / p[K * s];
    return LIMITS ? stretch - worn[2 * s] : stretch;
};
auto tension_of = [=](int s, real stretch, real factor) __attribute__((always_inline)) -> real {
    const real g = CURVED ? curve(stretch, p + K * s + AT_CURVE) : stretch;
    const real tension = p[K * s] * factor * g;
    return LIMITS ? tension * worn[2 * s + 1] : tension;
};
auto energy_of = [=](int s, real stretch, real factor) __attribute__((always_inline)) -> real {
    const real g = CURVED ? curve_energy(stretch, p + K * s + AT_CURVE)
                          : stretch * stretch * scalar(0.5);
    const real energy = p[K * s] * factor * g;
    return LIMITS ? energy * worn[2 * s + 1] : energy;
};
// Velocities that the dashpots see; none: they rest.
const Vec* rate_v = nullptr;
real dash_power = zero;
auto special_force = [&](Vec d, int s, real si, real co) __attribute__((always_inline)) -> Vec {
    const real length = square_root(squared_length(d.x, d.y, d.z));
    const Pose now = pose_of(s, si, co);
    const real stretch = stretch_of(s, length, now.h);
    real tension = tension_of(s, stretch, now.factor);
    if (LEDGER && (ACTUATED || TIMETABLE))
        power -= tension * now.rate * scalar(2) / p[K * s];
    if (LEDGER && TIMETABLE)
        power += now.factor_rate * energy_of(s, stretch, zero + scalar(1));
    if (DASHPOTS && rate_v) {
        const real rate = dot(rate_v[partner[s]] - rate_v[spring_start[s]], d) / length;
        const real c = LIMITS ? p[K * s + AT_DASHPOT] * worn[2 * s + 1] : p[K * s + AT_DASHPOT];
        tension += c * rate;
        if (LEDGER) dash_power += c * rate * rate;
    }
    return scaled(d, tension / length);
};
auto special_energy = [&](real length2, int s) __attribute__((always_inline)) -> real {
    const Pose now = pose_of(s, sine, cosine);
    return energy_of(s, stretch_of(s, square_root(length2), now.h), now.factor);
};
"""

# Breaking and yielding, once a step.
WEAR = r"""
auto wear = [&](double now) {
    if (!LIMITS) return;
    const mask goes_on = ~stopped_lanes();
    for (int i = 0; i < M; ++i)
        for (int s = row[i]; s < row[i + 1]; ++s) {
            const Vec d = x[partner[s]] - x[i];
            const real length = square_root(squared_length(d.x, d.y, d.z));
            const Pose at = pose_of(s, sine, cosine);
            const real stretch = stretch_of(s, length, at.h);
            const real tension = tension_of(s, stretch, at.factor);
            const real size = select(tension < zero, -tension, tension);
            const real breaks = p[K * s + AT_LIMITS], yields = p[K * s + AT_LIMITS + 1];
            const mask gives = goes_on & ((size >= breaks) | (size > yields));
            if (!any(gives)) continue;
            const real before = energy_of(s, stretch, at.factor);
            const real excess = (size - yields) / (p[K * s] * at.factor);
            const real flow = select(goes_on & (size > yields), excess, zero);
            worn[2 * s] += select(tension < zero, -flow, flow);
            const mask breaking = goes_on & (size >= breaks);
            worn[2 * s + 1] = select(breaking, zero, worn[2 * s + 1]);
            for (int l = 0; l < W; ++l)
                if (lane_of(select(breaking, zero + scalar(1), zero), l) > scalar(0))
                    broken_at[W * s + l] = now;
            if (LEDGER)
                ledger[6] += before - energy_of(s, stretch_of(s, length, at.h), at.factor);
        }
};
"""
