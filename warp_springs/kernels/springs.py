"""Springs: their pull and energy, what they may have beyond k and L0, how the lanes keep them."""

__all__ = ["KEEPING", "SPRINGS", "WEAR"]

# The law of one spring, for every layout.
SPRINGS = r"""
// A spring of stiffness k and rest length L0 pulls its first mass with k (L - L0) d / L
// = (k - 2 h / L) d, where h = k L0 / 2. TINY keeps 1 / L finite where two masses coincide;
// d = 0 then makes the force zero.
auto squared_length = [=](real x, real y, real z) __attribute__((always_inline)) -> real {
    return x * x + (y * y + (z * z + TINY));
};
auto spring_pull = [=](real length2, real k, real h) __attribute__((always_inline)) -> real {
    return less_over_root(k, h, length2);
};
// The same for a spring of stiffness k and rest length L0 to a point, d away.
auto tether_force = [=](Vec d, real k, real L0) __attribute__((always_inline)) -> Vec {
    return scaled(d, spring_pull(dot(d, d) + TINY, k, k * L0 * scalar(0.5)));
};
// The part of the present kick's time in which what lasts from start to end acts: so its impulse is
// exact.
auto acting_part = [&](double start, double end) -> scalar {
    const double from = start > kick_begin ? start : kick_begin;
    const double to = end < kick_end ? end : kick_end;
    return scalar(to > from ? (to - from) / (kick_end - kick_begin) : 0);
};
auto spring_energy = [=](real length2, real k, real h) __attribute__((always_inline)) -> real {
    real stretch_force = k * square_root(length2) - h * scalar(2);
    return stretch_force * stretch_force / k * scalar(0.5);
};

// Power that a breathing spring puts in: -(tension) L0'(t), with L0' = 2 h' / k.
auto breathing_power = [=](real length2, real k, real h, real h_rate)
        __attribute__((always_inline)) -> real {
    return (h * scalar(2) - k * square_root(length2)) * (h_rate * scalar(2)) / k;
};

// h(t) = k / 2 (a + b sin(wt + c)) = ha + hs sin(wt) + hc cos(wt)
auto breathing = [=](real ha, real hs, real hc, real sine, real cosine)
        __attribute__((always_inline)) -> real {
    return (ha + hs * sine) + hc * cosine;
};
auto breathing_rate = [=](real hs, real hc, real sine, real cosine, real omega)
        __attribute__((always_inline)) -> real {
    return (hs * cosine - hc * sine) * omega;
};

// Springs beyond Hooke. The numbers of one, c, follow each other: those of a plain spring, then
// slope, k3 / k, stretch and part of each hinge, and so on.
const bool SPECIAL = HARMONICS || OWN_OMEGAS || CURVED || DASHPOTS || LIMITS || TIMETABLE;
const int AT_HARMONICS = ACTUATED ? 4 : 2, AT_CURVE = AT_HARMONICS + 2 * HARMONICS;
const int AT_DASHPOT = AT_CURVE + (CURVED ? 2 + 2 * HINGES : 0);
const int AT_LIMITS = AT_DASHPOT + (DASHPOTS ? 1 : 0);
const int K = AT_LIMITS + (LIMITS ? 2 : 0);

// A spring, wherever a layout keeps it; what the features do not ask for is not read.
struct Spring {
    const real* c;
    real* turning;         // OWN_OMEGAS: sin(wt), cos(wt), cos(w dt), sin(w dt)
    const double* omegas;  // OWN_OMEGAS: of each lane [rad/s]
    const real* schedule;  // TIMETABLE: factor, h, at each of its times
    real* worn;            // LIMITS: how far it flowed [m]; 1, or 0 where it is broken
};
// Where a timetable stands at an instant.
struct Table { int row; scalar part, rate; };
// An instant: sine and cosine of the robot's wt, w itself, and where the timetable stands.
struct Instant { real sine, cosine, omega; Table table; };
// A spring at an instant: half of k L0 and its rate, the factor of its stiffness and its rate.
struct Pose { real h, rate, factor, factor_rate; };
// The pull for each metre of length, and what the spring's own changes give and its dashpot takes.
struct Pull { real pull, power, dash_power; };
// What happens to a spring at its limits: who breaks, and the energy that is lost.
struct Damage { mask breaks; real loss; };

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
// `times` holds so many times [s], then the period, 0 for none.
auto table_at = [=](const double* times, int count, double now) -> Table {
    Table found = {0, scalar(0), scalar(0)};
    if (!TIMETABLE) return found;
    const int last = count - 2;
    const double period = times[count];
    const double t = period > 0 ? now - ::floor(now / period) * period : now;
    while (found.row < last && times[found.row + 1] <= t) ++found.row;
    const double wide = times[found.row + 1] - times[found.row];
    const double part = (t - times[found.row]) / wide;
    found.part = scalar(part < 0 ? 0 : part > 1 ? 1 : part);
    found.rate = scalar(part >= 0 && part <= 1 ? 1 / wide : 0);
    return found;
};
auto pose_of = [=](const Spring& spring, const Instant& now)
        __attribute__((always_inline)) -> Pose {
    const real* const c = spring.c;
    real si = now.sine, co = now.cosine, w = now.omega;
    if (OWN_OMEGAS) {
        si = spring.turning[0]; co = spring.turning[1];
        for (int l = 0; LEDGER && l < W; ++l) set_lane(w, l, scalar(spring.omegas[l]));
    }
    Pose pose = {c[1], zero, zero + scalar(1), zero};
    if (ACTUATED) {
        pose.h = breathing(c[1], c[2], c[3], si, co);
        if (LEDGER) pose.rate = breathing_rate(c[2], c[3], si, co, w);
        add_harmonics(pose.h, pose.rate, c + AT_HARMONICS, si, co, w);
    }
    if (TIMETABLE) {
        const real* const here = spring.schedule + 2 * now.table.row;
        pose.factor = here[0] + (here[2] - here[0]) * now.table.part;
        pose.factor_rate = (here[2] - here[0]) * now.table.rate;
        pose.h += here[1] + (here[3] - here[1]) * now.table.part;
        pose.rate += (here[3] - here[1]) * now.table.rate;
    }
    return pose;
};
auto stretch_of = [=](const Spring& spring, real length, real h)
        __attribute__((always_inline)) -> real {
    const real stretch = length - h * scalar(2) / spring.c[0];
    return LIMITS ? stretch - spring.worn[0] : stretch;
};
auto tension_of = [=](const Spring& spring, real stretch, real factor)
        __attribute__((always_inline)) -> real {
    const real g = CURVED ? curve(stretch, spring.c + AT_CURVE) : stretch;
    const real tension = spring.c[0] * factor * g;
    return LIMITS ? tension * spring.worn[1] : tension;
};
auto energy_of = [=](const Spring& spring, real stretch, real factor)
        __attribute__((always_inline)) -> real {
    const real g = CURVED ? curve_energy(stretch, spring.c + AT_CURVE)
                          : stretch * stretch * scalar(0.5);
    const real energy = spring.c[0] * factor * g;
    return LIMITS ? energy * spring.worn[1] : energy;
};
// Of a spring along d, between masses whose velocities differ by u, if they are known.
auto special_pull = [=](Vec d, Vec u, bool damped, const Spring& spring, const Instant& now)
        __attribute__((always_inline)) -> Pull {
    const real length = square_root(squared_length(d.x, d.y, d.z));
    const Pose pose = pose_of(spring, now);
    const real stretch = stretch_of(spring, length, pose.h);
    real tension = tension_of(spring, stretch, pose.factor);
    Pull found = {zero, zero, zero};
    if (LEDGER && (ACTUATED || TIMETABLE))
        found.power -= tension * pose.rate * scalar(2) / spring.c[0];
    if (LEDGER && TIMETABLE)
        found.power += pose.factor_rate * energy_of(spring, stretch, zero + scalar(1));
    if (DASHPOTS && damped) {
        const real rate = dot(u, d) / length;
        const real c = LIMITS ? spring.c[AT_DASHPOT] * spring.worn[1] : spring.c[AT_DASHPOT];
        tension += c * rate;
        if (LEDGER) found.dash_power = c * rate * rate;
    }
    found.pull = tension / length;
    return found;
};
auto special_energy = [=](real length2, const Spring& spring, const Instant& now)
        __attribute__((always_inline)) -> real {
    const Pose pose = pose_of(spring, now);
    return energy_of(spring, stretch_of(spring, square_root(length2), pose.h), pose.factor);
};
// Breaking and yielding, once a step, of the robots that go on.
auto wear_spring = [=](Vec d, const Spring& spring, const Instant& now, mask goes_on)
        __attribute__((always_inline)) -> Damage {
    const real length = square_root(squared_length(d.x, d.y, d.z));
    const Pose pose = pose_of(spring, now);
    const real stretch = stretch_of(spring, length, pose.h);
    const real tension = tension_of(spring, stretch, pose.factor);
    const real size = select(tension < zero, -tension, tension);
    const real breaks = spring.c[AT_LIMITS], yields = spring.c[AT_LIMITS + 1];
    const mask breaking = goes_on & (size >= breaks), yielding = goes_on & (size > yields);
    Damage found = {breaking, zero};
    if (!any(breaking | yielding)) return found;
    const real before = energy_of(spring, stretch, pose.factor);
    const real excess = (size - yields) / (spring.c[0] * pose.factor);
    const real flow = select(yielding, excess, zero);
    spring.worn[0] += select(tension < zero, -flow, flow);
    spring.worn[1] = select(breaking, zero, spring.worn[1]);
    if (LEDGER)
        found.loss = before - energy_of(spring, stretch_of(spring, length, pose.h), pose.factor);
    return found;
};
auto is_whole = [=](const Spring& spring) __attribute__((always_inline)) -> mask {
    return LIMITS ? spring.worn[1] > zero : zero == zero;
};
"""

# A spring of a bundle: its numbers follow those of a plain one in the coefficients.
KEEPING = r"""
const int* const spring_start = model.spring_starts.data + spring_list_;
const double* const spring_omegas = model.spring_omegas.data + own_omega_;
real* const turning = (real*)(state.spring_oscillators.data + turning_);
const double* const times = model.times.data + time_;
const real* const schedule = (const real*)(model.schedules.data + schedule_);
real* const worn = (real*)(state.worn.data + worn_);
double* const broken_at = state.broken_at.data + broken_;

Table table = {};
auto consult_timetable = [&](double now) { table = table_at(times, (int)times_, now); };
auto spring_of = [=](int s) __attribute__((always_inline)) -> Spring {
    return Spring{p + K * s, turning + 4 * s, spring_omegas + W * s,
                  schedule + 2 * (int)times_ * s, worn + 2 * s};
};
// Velocities that the dashpots see; none: they rest.
const Vec* rate_v = nullptr;
real dash_power = zero;
auto special_force = [&](Vec d, int s, real si, real co) __attribute__((always_inline)) -> Vec {
    const bool damped = DASHPOTS && rate_v;
    const Vec u = damped ? rate_v[partner[s]] - rate_v[spring_start[s]] : Vec{};
    const Pull found = special_pull(d, u, damped, spring_of(s), Instant{si, co, omega, table});
    if (LEDGER) { power += found.power; dash_power += found.dash_power; }
    return scaled(d, found.pull);
};
"""

WEAR = r"""
auto wear = [&](double now) {
    if (!LIMITS) return;
    const mask goes_on = ~stopped_lanes();
    const Instant instant = {sine, cosine, omega, table};
    for (int i = 0; i < M; ++i)
        for (int s = row[i]; s < row[i + 1]; ++s) {
            const Damage found = wear_spring(x[partner[s]] - x[i], spring_of(s), instant, goes_on);
            if (LEDGER) ledger[6] += found.loss;
            if (!any(found.breaks)) continue;
            for (int l = 0; l < W; ++l)
                if (lane_of(select(found.breaks, zero + scalar(1), zero), l) > scalar(0))
                    broken_at[W * s + l] = now;
        }
};
"""
