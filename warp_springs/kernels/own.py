"""What one mass may have of its own: outer forces, a skin, a constraint; and water around it."""

__all__ = ["BINDING", "OWN"]

OWN = r"""
// What a mass has of its own. A layout fills in what the features ask for; the rest is not read.
struct Own {
    Vec outer;         // OUTER: force of pushes, tethers and collisions during the kick [N]
    Vec skin;          // SKIN: static and kinetic friction, stiffness; negative: the surface's own
    Far diagonal;      // BOUND: the projector P of the constraint c + P r ...
    Far corner;        // ... P_yz, P_xz, P_xy ...
    Far centre;        // ... c [m] ...
    wide radius;       // ... and the distance kept from it [m], 0 for none
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

# Constraints, in the numbers that hold a place in the world. A mass in flight on a circle or sphere
# follows its great circle.
BINDING = r"""
auto project = [=](Far r, const Own& o) __attribute__((always_inline)) -> Far {
    return Far{o.diagonal.x * r.x + o.corner.z * r.y + o.corner.y * r.z,
               o.corner.z * r.x + o.diagonal.y * r.y + o.corner.x * r.z,
               o.corner.y * r.x + o.corner.x * r.y + o.diagonal.z * r.z};
};
auto is_round = [=](const Own& own) __attribute__((always_inline)) -> wide_mask {
    return own.radius > wide_zero;
};
// The part of a velocity or an acceleration at x that the constraint allows.
auto allowed_part = [=](Far v, Far x, const Own& own) __attribute__((always_inline)) -> Far {
    const Far allowed = project(v, own), arm = project(x - own.centre, own);
    const wide length2 = dot(arm, arm);
    const wide_mask radial = is_round(own) & (length2 > wide_zero);
    const wide along = dot(allowed, arm) / select(radial, length2, wide_zero + wide_scalar(1));
    return allowed - scaled(arm, select(radial, along, wide_zero));
};
auto tangent = [=](Vec a, const Place& x, const Own& own) __attribute__((always_inline)) -> Vec {
    return near_of(allowed_part(far_of(a), exact_of(x), own));
};
auto restrain = [=](Sum& v, const Place& x, const Own& own) __attribute__((always_inline)) {
    v = sum_from(allowed_part(whole_of(v), exact_of(x), own));
};
// The point of the constraint nearest to x.
auto nearest = [=](Far x, const Own& own) __attribute__((always_inline)) -> Far {
    const Far arm = project(x - own.centre, own);
    const wide length2 = dot(arm, arm);
    const wide_mask round = is_round(own) & (length2 > wide_zero);
    const wide length = square_root(select(round, length2, wide_zero + wide_scalar(1)));
    const wide stretch = select(round, own.radius / length, wide_zero + wide_scalar(1));
    return own.centre + scaled(arm, stretch);
};
// cos(a) and sin(a) / a from a^2, to rounding up to an angle of 1: much more than a drift's.
auto cosine_of = [=](wide a2) __attribute__((always_inline)) -> wide {
    wide sum = wide_zero + wide_scalar(1);
    for (int k = 16; k > 0; k -= 2)
        sum = wide_scalar(1) - sum * a2 * wide_scalar(1.0 / (k * (k - 1)));
    return sum;
};
auto sine_ratio_of = [=](wide a2) __attribute__((always_inline)) -> wide {
    wide sum = wide_zero + wide_scalar(1);
    for (int k = 17; k > 1; k -= 2)
        sum = wide_scalar(1) - sum * a2 * wide_scalar(1.0 / (k * (k - 1)));
    return sum;
};
// Put what a drift from (x0, v0) made of a mass, (x, v), on its constraint.
auto bind = [=](Sum& x, Sum& v, const Sum& x0, const Sum& v0, const Own& own)
        __attribute__((always_inline)) {
    const wide_mask round = is_round(own);
    const Far arm = exact_of(in_world(x0)) - own.centre, start = whole_of(v0);
    const wide r2 = select(round, own.radius * own.radius, wide_zero + wide_scalar(1));
    const wide rate2 = dot(start, start) / r2, angle2 = rate2 * wide_scalar(span * span);
    const wide c = cosine_of(angle2), s = sine_ratio_of(angle2) * wide_scalar(span);
    const Far turned = own.centre + scaled(arm, c) + scaled(start, s);
    const Far there = nearest(pick(round, turned, exact_of(in_world(x))), own);
    const Far moving = pick(round, scaled(start, c) - scaled(arm, rate2 * s), whole_of(v));
    x = sum_from(from_origin(there));
    v = sum_from(allowed_part(moving, there, own));
};
"""
