"""What one mass may have of its own: outer forces, a skin, a constraint; and water around it."""

__all__ = ["BINDING", "OWN"]

OWN = r"""
auto dot = [=](Vec a, Vec b) __attribute__((always_inline)) -> real {
    return a.x * b.x + a.y * b.y + a.z * b.z;
};
auto scaled = [=](Vec a, real s) __attribute__((always_inline)) -> Vec {
    return Vec{a.x * s, a.y * s, a.z * s};
};
auto pick = [=](mask m, Vec a, Vec b) __attribute__((always_inline)) -> Vec {
    return Vec{select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
};

// What a mass has of its own. A layout fills in what the features ask for; the rest is not read.
struct Own {
    Vec outer;         // OUTER: force of pushes, tethers and collisions during the kick [N]
    Vec skin;          // SKIN: static and kinetic friction, stiffness; negative: the surface's own
    Vec diagonal;      // BOUND: the projector P of the constraint c + P r ...
    Vec corner;        // ... P_yz, P_xz, P_xy ...
    Vec centre;        // ... c [m] ...
    real radius;       // ... and the distance kept from it [m], 0 for none
    real* left_over;   // OBSTACLES: what each leaves over for friction, see touch_down
};
auto own_or = [=](real own, scalar surface) __attribute__((always_inline)) -> real {
    return select(own < zero, zero + surface, own);
};
auto static_friction_of = [=](const Own& own, scalar mu) __attribute__((always_inline)) -> real {
    return SKIN ? own_or(own.skin.x, mu) : zero + mu;
};
auto kinetic_friction_of = [=](const Own& own, scalar mu) __attribute__((always_inline)) -> real {
    return SKIN ? own_or(own.skin.y, mu) : zero + mu;
};
auto contact_stiffness = [=](const Own& own, scalar k) __attribute__((always_inline)) -> real {
    return SKIN ? own_or(own.skin.z, k) : zero + k;
};

// Which part of a mass at height z is immersed, and the force that lifts it.
auto immersed = [=](real z) __attribute__((always_inline)) -> real {
    const real part = (zero + water_level - z) / water_layer + scalar(0.5);
    return select(part < zero, zero, select(part > scalar(1), zero + scalar(1), part));
};
auto buoyancy_energy = [=](real z, real m) __attribute__((always_inline)) -> real {
    const real part = immersed(z);
    const real deep = zero + (water_level - water_layer * scalar(0.5)) - z;
    return m * water_lift
        * (part * part * (water_layer * scalar(0.5)) + select(deep > zero, deep, zero));
};
// Acceleration of a mass by water and by what acts on it from outside.
auto outer_acceleration = [=](real z, real w, const Own& own)
        __attribute__((always_inline)) -> Vec {
    Vec a = {zero, zero, zero};
    if (OUTER) a = scaled(own.outer, w);
    if (WATER) a.z += immersed(z) * water_lift;
    return a;
};
"""

# Constraints. A mass in flight on a circle or sphere follows its great circle.
BINDING = r"""
auto project = [=](Vec r, const Own& o) __attribute__((always_inline)) -> Vec {
    return Vec{o.diagonal.x * r.x + o.corner.z * r.y + o.corner.y * r.z,
               o.corner.z * r.x + o.diagonal.y * r.y + o.corner.x * r.z,
               o.corner.y * r.x + o.corner.x * r.y + o.diagonal.z * r.z};
};
auto is_round = [=](const Own& own) __attribute__((always_inline)) -> mask {
    return own.radius > zero;
};
// The part of a velocity or an acceleration at x that the constraint allows.
auto tangent = [=](Vec v, Vec x, const Own& own) __attribute__((always_inline)) -> Vec {
    const Vec allowed = project(v, own), arm = project(x - own.centre, own);
    const real length2 = dot(arm, arm);
    const mask radial = is_round(own) & (length2 > zero);
    const real along = dot(allowed, arm) / select(radial, length2, zero + scalar(1));
    return allowed - scaled(arm, select(radial, along, zero));
};
// The point of the constraint nearest to x.
auto nearest = [=](Vec x, const Own& own) __attribute__((always_inline)) -> Vec {
    const Vec arm = project(x - own.centre, own);
    const real length2 = dot(arm, arm);
    const mask round = is_round(own) & (length2 > zero);
    const real length = square_root(select(round, length2, zero + scalar(1)));
    return own.centre + scaled(arm, select(round, own.radius / length, zero + scalar(1)));
};
// cos(a) and sin(a) / a from a^2, to rounding up to an angle of 1: much more than a drift's.
auto cosine_of = [=](real a2) __attribute__((always_inline)) -> real {
    real sum = zero + scalar(1);
    for (int k = 16; k > 0; k -= 2) sum = scalar(1) - sum * a2 * scalar(1.0 / (k * (k - 1)));
    return sum;
};
auto sine_ratio_of = [=](real a2) __attribute__((always_inline)) -> real {
    real sum = zero + scalar(1);
    for (int k = 17; k > 1; k -= 2) sum = scalar(1) - sum * a2 * scalar(1.0 / (k * (k - 1)));
    return sum;
};
// A velocity put in place of another.
auto restrain = [=](Sum& v, Vec allowed) __attribute__((always_inline)) {
    v.x = allowed.x; v.y = allowed.y; v.z = allowed.z;
};
// Put what a drift from (x0, v0) made of a mass, (x, v), on its constraint.
auto bind = [=](Vec& x, Vec& v, Vec x0, Vec v0, const Own& own) __attribute__((always_inline)) {
    const mask round = is_round(own);
    const Vec arm = x0 - own.centre;
    const real r2 = select(round, own.radius * own.radius, zero + scalar(1));
    const real rate2 = dot(v0, v0) / r2, angle2 = rate2 * (span * span);
    const real c = cosine_of(angle2), s = sine_ratio_of(angle2) * span;
    x = pick(round, own.centre + scaled(arm, c) + scaled(v0, s), x);
    v = pick(round, scaled(v0, c) - scaled(arm, rate2 * s), v);
    x = nearest(x, own);
    v = tangent(v, x, own);
};
"""
