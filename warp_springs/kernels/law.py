"""The physics, each formula once, as C++ that every layout instantiates for its own number type.

A layout puts in front of ``LAW`` a dialect that defines

========================  ======================================================================
``scalar``                the floating-point type
``real``                  what a formula computes with: a vector of lanes, or one ``scalar``
``mask``                  what a comparison of two ``real`` gives
``select(m, a, b)``       ``m ? a : b``, lane by lane
``any(m)``                true if any lane of ``m`` is
``square_root(a)``        IEEE square root
``less_over_root(k, h,    k - 2 h / sqrt(a), the root to the last bit or two, for a >= TINY
a)``
``MIXED``                 a macro, 0 or 1: whether positions and velocities are sums of two numbers,
                          the positions about ``origin[3]``, pointed to, of type ``real``
========================  ======================================================================

and the constants of ``CONSTANTS`` as ``const scalar``, the compile-time ``const bool`` of the
features, and CHECK_EVERY, the steps from one look at the health to the next. What a scene lacks is
a ``false`` there, and the compiler drops its code.

Units are SI; ``w`` is the inverse of a mass [1/kg].
"""

from __future__ import annotations

import math

from warp_springs.kernels.obstacles import MEETING, TOUCHING
from warp_springs.kernels.own import BINDING, OWN
from warp_springs.kernels.springs import SPRINGS

__all__ = ["CONSTANTS", "DRIFTS", "EVALUATIONS", "LAW", "constants"]

# Host and kernel read the constants of a run from one array, in this order.
CONSTANTS = (
    "dt",  # step [s]
    "span",  # one drift [s]
    "loss",  # 1 - exp(-damping span / 2): what damping takes over half a drift
    "gravity_x",  # [m/s^2]
    "gravity_y",
    "gravity_z",
    "ground_stiffness",  # K_G [N/m]
    "static_friction",
    "kinetic_friction",
    "drag",  # c of the drag -c |v| v [kg/m]
    "speed_limit",  # beyond it a robot is stopped [m/s]
    "depth_limit",  # [m]
    "wind_x",  # velocity of the air [m/s]
    "wind_y",
    "wind_z",
    "water_level",  # [m]
    "water_layer",  # way over which a mass dives [m]
    "water_lift",  # acceleration of a mass that is wholly immersed [m/s^2]
    "water_drag",  # [kg/m]
)


#: Drifts in a step of each integrator, and times it computes the spring forces.
DRIFTS = {"euler": 1, "leapfrog": 1, "chin4": 2}
EVALUATIONS = {"euler": 1, "leapfrog": 1, "chin4": 3}


def constants(scene, dt: float, integrator: str, limits) -> list[float]:
    """Values of ``CONSTANTS`` for a scene, in float64."""
    ground = scene.ground
    water = scene.water
    span = dt / DRIFTS[integrator]
    return [
        dt,
        span,
        -math.expm1(-0.5 * scene.damping * span),
        *scene.gravity,
        ground.stiffness if ground else 0.0,
        ground.static_friction if ground else 0.0,
        ground.kinetic_friction if ground else 0.0,
        scene.drag,
        limits.speed,
        limits.depth,
        *(scene.wind or (0.0, 0.0, 0.0)),
        water.level if water else 0.0,
        water.layer if water else 1.0,
        -water.density * scene.gravity[2] if water else 0.0,
        water.drag if water else 0.0,
    ]


LAW = (
    r"""
struct Vec {
    real x, y, z;
    Vec operator+(const Vec& b) const { return Vec{x + b.x, y + b.y, z + b.z}; }
    Vec operator-(const Vec& b) const { return Vec{x - b.x, y - b.y, z - b.z}; }
};

// A position or a velocity that grows by many small steps. In mixed precision `low` holds what a
// single number does not, so that nothing is lost (Fast2Sum: exact where the step is no larger than
// the sum).
#if MIXED
struct Sum : Vec { Vec low; };
auto grow = [](real& a, real& low, real by) __attribute__((always_inline)) {
    const real change = by + low, sum = a + change;
    low = change - (sum - a);
    a = sum;
};
auto sum_of = [](const Vec* a, const Vec* low, int i) __attribute__((always_inline)) -> Sum {
    return Sum{a[i], low[i]};
};
auto keep_sum = [](Vec* a, Vec* low, int i, const Sum& sum) __attribute__((always_inline)) {
    a[i] = sum; low[i] = sum.low;
};
// The origin moves: what a shifted position cannot hold goes to its low part.
auto move_origin = [](real& a, real& low, real by) __attribute__((always_inline)) {
    const real sum = a - by, part = sum - a;
    const real rest = low + ((a - (sum - part)) - (by + part));
    a = sum + rest;
    low = rest - (a - sum);
};
// Where a mass is in the world; its height is exact near the ground.
auto in_world = [=](const Sum& x) __attribute__((always_inline)) -> Vec {
    return Vec{x.x + origin[0], x.y + origin[1], (x.z + origin[2]) + x.low.z};
};
// Where a place near x is that is counted from the same origin.
auto from_here = [=](Vec place, const Sum& x) __attribute__((always_inline)) -> Vec {
    return (place - x) + in_world(x);
};
#else
typedef Vec Sum;
auto sum_of = [](const Vec* a, const Vec*, int i) __attribute__((always_inline)) -> Sum {
    return a[i];
};
auto keep_sum = [](Vec* a, Vec*, int i, const Sum& sum) __attribute__((always_inline)) {
    a[i] = sum;
};
auto in_world = [](const Sum& x) __attribute__((always_inline)) -> Vec { return x; };
auto from_here = [](Vec place, const Sum&) __attribute__((always_inline)) -> Vec { return place; };
#endif
// Adds to the horizontal components, or to the vertical one, a rate times a time.
auto add_level = [=](Sum& sum, Vec rate, scalar time) __attribute__((always_inline)) {
#if MIXED
    grow(sum.x, sum.low.x, rate.x * time);
    grow(sum.y, sum.low.y, rate.y * time);
#else
    sum.x += rate.x * time; sum.y += rate.y * time;
#endif
};
auto add_upright = [=](Sum& sum, real rate, scalar time) __attribute__((always_inline)) {
#if MIXED
    grow(sum.z, sum.low.z, rate * time);
#else
    sum.z += rate * time;
#endif
};
auto add = [=](Sum& sum, Vec rate, scalar time) __attribute__((always_inline)) {
    add_level(sum, rate, time);
    add_upright(sum, rate.z, time);
};
// A velocity that was stopped leaves nothing over.
auto settle_rest = [=](Sum& v) __attribute__((always_inline)) {
#if MIXED
    v.low.x = select(v.x == zero, zero, v.low.x);
    v.low.y = select(v.y == zero, zero, v.low.y);
#endif
};

// What damping, drag and friction took from a velocity between two drifts.
struct Losses { Vec damping, drag, friction, outer; mask stuck; };
"""
    + OWN
    + BINDING
    + r"""

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

"""
    + SPRINGS
    + r"""
// Exact flow of du/dt = -c |u| u / m over h, of the velocity u = `against` to what v moves in: |u|
// falls to |u| / (1 + c |u| h / m). A speed whose square overflows must not come out as rest: it
// turns into NaN, which the health check sees.
auto drag_flow = [=](Sum& v, Vec against, real w, real ch) __attribute__((always_inline)) {
    real speed2 = against.x * against.x + against.y * against.y + against.z * against.z;
    real slowing = square_root(speed2) * w * ch;
    real part = slowing / (slowing + scalar(1)) + speed2 * scalar(0);
    add(v, scaled(against, part), scalar(-1));
};

// Force of an elastic surface of stiffness k on a mass at height z over it.
auto surface_force = [=](real z, real k) __attribute__((always_inline)) -> real {
    return select(z < zero, z * -k, zero);
};
// Upward force of the ground on a mass at height z.
auto ground_force = [=](real z, const Own& own) __attribute__((always_inline)) -> real {
    return surface_force(z, contact_stiffness(own, ground_stiffness));
};

// Coulomb's law for one step: a normal impulse `hold` (per unit of mass) stops a tangential
// velocity up to mu_s hold, and an impulse j shortens a larger one by mu_k j along its direction.
// What is left of it, as a factor:
auto coulomb = [=](real speed, real hold, real j, real mu_s, real mu_k)
        __attribute__((always_inline)) -> real {
    real left = scalar(1) - mu_k * j / select(speed > zero, speed, zero + scalar(1));
    left = select(left > zero, left, zero);
    return select((hold > zero) & (speed <= mu_s * hold), zero, left);
};

// The classroom's rule: the horizontal FORCE f against the normal force n. Below mu_s n both the
// force and the velocity vanish, above it the force is reduced by mu_k n.
auto course_friction = [=](real& fx, real& fy, real& ux, real& uy, real n, const Own& own)
        __attribute__((always_inline)) {
    mask touching = n > zero;
    if (!any(touching)) return;
    real f = square_root(fx * fx + fy * fy);
    mask stuck = touching & (f < static_friction_of(own, static_friction) * n);
    real left = scalar(1) - kinetic_friction_of(own, kinetic_friction) * n
        / select(f > zero, f, zero + scalar(1));
    left = select(left > zero, left, zero);
    real factor = select(stuck, zero, select(touching, left, zero + scalar(1)));
    fx *= factor; fy *= factor;
    ux = select(stuck, zero, ux); uy = select(stuck, zero, uy);
};

// Height z over a surface of stiffness k and velocity u along its normal, under gravity g along it
// and the surface's force, over one drift by `substeps` velocity-Verlet steps; returns the impulse
// of the surface per unit of mass. The kicks that meet between two steps are one: each step waits
// for the one before, so a step has few operations.
auto contact_flow = [=](real& z, real& u, real k, real w, real g, int substeps)
        __attribute__((always_inline)) -> real {
    const scalar h = span / scalar(substeps), half = scalar(0.5);
    const real fall = g * h, strength = w * (k * h);
    real push = surface_force(z, strength), impulse = push * half;
    u += (push + fall) * half;
    for (int s = 0; s < substeps; ++s) {
        z += u * h;
        push = surface_force(z, strength);
        u = (u + fall) + push;
        impulse += push;
    }
    u -= (push + fall) * half;
    return impulse - push * half;
};
// The part of an impulse that may hold a mass in this drift; see touch_down.
auto share_hold = [=](real& hold, real impulse, real& left_over, bool last)
        __attribute__((always_inline)) {
    hold = last ? impulse + left_over : impulse * (scalar(2) / scalar(3));
    left_over = impulse - hold;
    hold = select(impulse > zero, hold, zero);
};
"""
    + TOUCHING
    + r"""

// Kicks and drifts. The springs kick; a drift of `span` seconds moves by the velocity, and gravity
// and the ground's normal force belong to it. Damping and drag act for half a span on either side
// of a kick (Strang splitting). The last kick of a step and the first of the next meet, so the
// state kept is the position at t_n and the velocity just before both: the very first kick of a
// simulation, and the one that synchronises a velocity that is looked at, are the last or first
// part alone, with the damping of their own side only.
//
// leapfrog   kick dt, drift dt                                           second order
// chin4      kick dt/3, drift dt/2, gradient kick 2 dt/3, drift dt/2     fourth order
//
// chin4 is algorithm 4A of S. A. Chin, Phys. Lett. A 226 (1997) 344. The gradient kick takes the
// forces at x + a dt^2/24, a the acceleration that the kick would give at x.
const scalar FIRST_KICK = CHIN4 ? dt / scalar(6) : dt * scalar(0.5);  // half of the joined kick
const scalar GRADIENT_KICK = dt * scalar(2) / scalar(3);
const scalar GRADIENT_SHIFT = dt * dt / scalar(24);

auto kick_acceleration = [=](Vec f, Vec at, real w, const Own& own)
        __attribute__((always_inline)) -> Vec {
    Vec a = {f.x * w + gravity_x, f.y * w + gravity_y, GROUND ? f.z * w : f.z * w + gravity_z};
    if (OUTER || WATER) a = a + outer_acceleration(at.z, w, own);
    if (BOUND && GROUND)  // what flies on a great circle takes all forces here
        a.z += select(is_round(own), ground_force(at.z, own) * w + gravity_z, zero);
    return BOUND ? tangent(a, at, own) : a;
};
auto damp = [=](Sum& v, scalar part, Losses& losses) __attribute__((always_inline)) {
    if (!DAMPING) return;
    const Vec before = v;
    add(v, before, -part);
    if (LEDGER) losses.damping = losses.damping + (before - v);
};
// Drag against the air, which the wind moves, and against the water, which is still.
auto slow_in_air = [=](Sum& v, real w, scalar time) __attribute__((always_inline)) {
    const Vec wind = {zero + wind_x, zero + wind_y, zero + wind_z};
    if (DRAG) drag_flow(v, WIND ? v - wind : Vec(v), w, zero + drag * time);
};
auto slow_in_water = [=](Sum& v, real z, real w, scalar time) __attribute__((always_inline)) {
    if (WATER) drag_flow(v, v, w, immersed(z) * (water_drag * time));
};
auto slow_down = [=](Sum& v, Vec x, real w, scalar time, bool water_first, const Own& own,
                     Losses& losses) __attribute__((always_inline)) {
    if (!DRAG && !WATER) return;
    const Vec before = v;
    if (water_first) slow_in_water(v, x.z, w, time);
    slow_in_air(v, w, time);
    if (!water_first) slow_in_water(v, x.z, w, time);
    if (BOUND && WIND) restrain(v, tangent(v, x, own));
    if (LEDGER) losses.drag = losses.drag + (before - v);
};
auto rub = [=](Sum& v, real hold, real impulse, const Own& own, Losses& losses, scalar kinetic)
        __attribute__((always_inline)) {
    if (!COULOMB || !any(hold > zero)) return;
    const Vec before = v;
    const real factor = coulomb(square_root(v.x * v.x + v.y * v.y), hold, impulse,
                                static_friction_of(own, static_friction),
                                kinetic_friction_of(own, kinetic));
    v.x *= factor; v.y *= factor;
    settle_rest(v);
    if (LEDGER) losses.friction = losses.friction + (before - v);
};
// The classroom's friction belongs to the kick, since it works on the force. The force f was taken
// at `at`, which is x but for the gradient kick.
auto kick = [=](Sum& v, Vec f, Vec at, Vec x, real w, scalar time, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    Vec a = kick_acceleration(f, at, w, own);
    if (BOUND) a = tangent(a, x, own);
    Sum free = v;
    if (GROUND && COURSE) {
        if (LEDGER) add(free, a, time);
        course_friction(a.x, a.y, v.x, v.y, ground_force(x.z, own) * w, own);
        settle_rest(v);
    }
    add(v, a, time);
    if (LEDGER && OUTER) losses.outer = losses.outer - scaled(own.outer, w * time);
    if (GROUND && COURSE && LEDGER) losses.friction = losses.friction + (free - v);
};
auto lose_before = [=](Sum& v, Vec x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    damp(v, loss, losses);
    slow_down(v, x, w, span * scalar(0.5), false, own, losses);
};
auto lose_after = [=](Sum& v, Vec x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    slow_down(v, x, w, span * scalar(0.5), true, own, losses);
    damp(v, loss, losses);
};
"""
    + MEETING
    + r"""

// A mass in free flight follows its parabola; where the parabola's ends are not both above the
// ground, the contact flow takes over. Friction acts once a drift, between the kick and the drift,
// so that a mass that sticks does not move at all. What slides is slowed by the drift's own
// impulse. What sticks is held in proportion to the kick before the drift: the first drift of a
// chin4 step, after a third of the step's kicks, leaves a third of its hold to the second.
auto touch_down = [=](Sum& x, Sum& v, real w, int substeps, real& left_over, bool last,
                      const Own& own, Losses& losses) __attribute__((always_inline)) {
    const real height = in_world(x).z, u = v.z;
    const real mean = u + gravity_z * span * scalar(0.5), z = height + mean * span;
    add_upright(v, zero + gravity_z, span);
    const mask touching = (height < zero) | (z < zero);
    if (any(touching)) {
        real z_contact = height, u_contact = u;
        real impulse = contact_flow(z_contact, u_contact, contact_stiffness(own, ground_stiffness),
                                    w, zero + gravity_z, substeps);
        v.z = select(touching, u_contact, v.z);
#if MIXED
        v.low.z = select(touching, zero, v.low.z);
        grow(x.z, x.low.z, select(touching, z_contact - height, mean * span));
#else
        x.z = select(touching, z_contact, z);
#endif
        impulse = select(touching, impulse, zero);
        real hold = impulse;
        if (CHIN4) share_hold(hold, impulse, left_over, last);
        rub(v, hold, impulse, own, losses, kinetic_friction);
    } else {
        if (CHIN4) left_over = zero;
        add_upright(x, mean, span);
    }
};
// Friction slows a sliding mass evenly during the drift, which therefore moves it with the mean of
// the velocities before and after: second order.
auto drift = [=](Sum& x, Sum& v, real w, int substeps, real& left_over, bool last,
                 const Own& own, Losses& losses) __attribute__((always_inline)) {
    const Vec x0 = x, v0 = v;
    Vec mean = v;
    if (GROUND) touch_down(x, v, w, substeps, left_over, last, own, losses);
    else add_upright(x, v.z, span);
    if (COULOMB) {
        const mask slides = (v.x != zero) | (v.y != zero);
        mean.x = select(slides, (mean.x + v.x) * scalar(0.5), zero);
        mean.y = select(slides, (mean.y + v.y) * scalar(0.5), zero);
    }
    add_level(x, mean, span);
    if (OBSTACLES) meet_obstacles(x, v, x0, w, substeps, last, own, losses);
    if (BOUND) bind(x, v, x0, v0, own);
};

// The velocity at t_n, from the state before its kicks: what the last part of them adds. The state
// has had its friction up to t_n; here friction only holds what sticks, so that it is reported at
// rest.
auto synchronise = [=](Sum& v, Vec f, Vec x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    lose_before(v, x, w, own, losses);
    kick(v, f, x, x, w, FIRST_KICK, own, losses);
    if (GROUND)
        rub(v, ground_force(x.z, own) * w * FIRST_KICK, zero, own, losses, scalar(0));
    if (OBSTACLES) hold_by_obstacles(x, v, w, FIRST_KICK, own, losses);
    if (BOUND) restrain(v, tangent(v, x, own));
};

// Work of a loss that changed the velocity of a mass by -lost while it went from `before` to
// `after`: impulse times mean velocity. All impulses so weighed add up to the change of kinetic
// energy exactly, and a mass that sticks loses nothing.
auto loss_work = [=](Vec lost, Vec before, Vec after, real w)
        __attribute__((always_inline)) -> real {
    return (lost.x * (before.x + after.x) + lost.y * (before.y + after.y)
            + lost.z * (before.z + after.z)) * scalar(0.5) / w;
};

// Symplectic Euler, the classroom's method: all forces at t_n, then velocity, then position.
auto euler_step = [=](Sum& x, Sum& v, Vec f, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    const Vec here = in_world(x);
    const real push = GROUND ? ground_force(here.z, own) * w : zero;
    Vec a = {f.x * w + gravity_x, f.y * w + gravity_y, f.z * w + gravity_z + push};
    if (OUTER || WATER) a = a + outer_acceleration(here.z, w, own);
    if (LEDGER && OUTER) losses.outer = losses.outer - scaled(own.outer, w * dt);
    Sum free = v;
    if (GROUND && COURSE) {
        if (LEDGER) add(free, a, dt);
        course_friction(a.x, a.y, v.x, v.y, push, own);
        settle_rest(v);
    }
    add(v, a, dt);
    if (GROUND && COURSE && LEDGER) losses.friction = losses.friction + (free - v);
    if (GROUND) rub(v, push * dt, push * dt, own, losses, kinetic_friction);
    if (OBSTACLES) push_by_obstacles(here, v, w, own, losses);
    if (BOUND) restrain(v, tangent(v, here, own));
    damp(v, loss * (scalar(2) - loss), losses);
    slow_down(v, here, w, dt, false, own, losses);
    const Vec x0 = x, v0 = v;
    add(x, v, dt);
    if (BOUND) bind(x, v, x0, v0, own);
};

// The accounts of the ledger [J], in the order of ``buffers.ACCOUNTS``: work of the breathing
// springs, what damping, drag and friction took from a mass of inverse w, work from outside.
auto enter = [=](real* ledger, const Losses& losses, Vec before, Vec after, real w)
        __attribute__((always_inline)) {
    if (!LEDGER) return;
    if (DAMPING) ledger[1] += loss_work(losses.damping, before, after, w);
    if (DRAG || WATER) ledger[2] += loss_work(losses.drag, before, after, w);
    if (GROUND || OBSTACLES) ledger[3] += loss_work(losses.friction, before, after, w);
    if (OUTER) ledger[4] -= loss_work(losses.outer, before, after, w);
};
// A mass that slides is kicked, then rubbed; one that sticks is both at once, and friction takes
// back what the kick gave.
auto enter_step = [=](real* ledger, const Losses& losses, const Losses& rubbed, Vec before,
                      Vec kicked, Vec after, real w) __attribute__((always_inline)) {
    if (!LEDGER) return;
    if (OBSTACLES) {
        enter(ledger, losses, before, pick(rubbed.stuck, before, kicked), w);
        enter(ledger, rubbed, pick(rubbed.stuck, before, kicked), after, w);
        return;
    }
    const mask slides = (after.x != zero) | (after.y != zero);
    auto pick_level = [=](Vec a, Vec b) -> Vec {
        return Vec{select(slides, a.x, b.x), select(slides, a.y, b.y), a.z};
    };
    const Vec level = {after.x, after.y, kicked.z};
    enter(ledger, losses, before, pick_level(kicked, level), w);
    enter(ledger, rubbed, pick_level(kicked, before), level, w);
};

// One mass moved by its whole force f, taken at `at` in the world: a kick of `time` seconds and the
// drift after it. `start`: nothing came before; `last`: the last drift of the step; `left_over`:
// see touch_down.
auto move_mass = [=](Sum& x, Sum& v, Vec f, Vec at, real w, int substeps, real& left_over,
                     scalar time, bool start, bool last, real* ledger, const Own& own)
        __attribute__((always_inline)) {
    const Vec before = v, here = in_world(x);
    Losses losses = {}, rubbed = {};
    if (!start) lose_before(v, here, w, own, losses);
    kick(v, f, at, here, w, time, own, losses);
    lose_after(v, here, w, own, losses);
    const Vec kicked = v;
    drift(x, v, w, substeps, left_over, last, own, rubbed);
    enter_step(ledger, losses, rubbed, before, kicked, v, w);
};
auto move_mass_euler = [=](Sum& x, Sum& v, Vec f, real w, real* ledger, const Own& own)
        __attribute__((always_inline)) {
    const Vec before = v;
    Losses losses = {};
    euler_step(x, v, f, w, own, losses);
    enter(ledger, losses, before, v, w);
};
// Where the gradient kick of chin4 looks.
auto shifted_position = [=](Sum x, Vec f, real w, const Own& own)
        __attribute__((always_inline)) -> Vec {
    add(x, kick_acceleration(f, in_world(x), w, own), GRADIENT_SHIFT);
    return BOUND ? nearest(x, own) : x;
};

// Health of a mass. Who was shot away and braked since the last check shows by the way it went.
auto too_fast = [=](Vec v, Vec way) __attribute__((always_inline)) -> mask {
    const scalar reach = speed_limit * dt * scalar(CHECK_EVERY);
    return (v.x * v.x + v.y * v.y + v.z * v.z > zero + speed_limit * speed_limit)
        | (way.x * way.x + way.y * way.y + way.z * way.z > zero + reach * reach);
};
// Zero where all numbers are finite, else not a number.
auto poison_of = [=](Vec x, Vec v) __attribute__((always_inline)) -> real {
    return (x.x + x.y + x.z + v.x + v.y + v.z) * scalar(0);
};

// Energies of a mass m [J].
auto kinetic_energy = [=](Vec v, real m) __attribute__((always_inline)) -> real {
    return m * (v.x * v.x + v.y * v.y + v.z * v.z) * scalar(0.5);
};
auto gravity_energy = [=](Vec x, real m) __attribute__((always_inline)) -> real {
    const real weight = -(m * (x.x * gravity_x + x.y * gravity_y + x.z * gravity_z));
    return WATER ? weight + buoyancy_energy(x.z, m) : weight;
};
auto contact_energy = [=](Vec x, const Own& own) __attribute__((always_inline)) -> real {
    if (OBSTACLES) return obstacle_energy(x, own);
    return GROUND ? ground_force(x.z, own) * x.z * scalar(-0.5) : zero;
};
"""
)
