"""The ground: its force, friction, and how a mass moves that touches it.

Other surfaces stand in ``obstacles``; their touch is the same flow and the same friction.
"""

__all__ = ["GROUND"]

GROUND = r"""
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

// What kicks a mass acts all the time. When a drift begins, its kicks are ahead of it by so many
// seconds, and the stages of a step leave its parabola by so many square seconds in the middle.
auto ahead_of = [=](bool last) __attribute__((always_inline)) -> scalar {
    return CHIN4 ? (last ? dt / scalar(3) : dt / scalar(6)) : dt * scalar(0.5);
};
auto bow_before = [=](bool last) __attribute__((always_inline)) -> scalar {
    return CHIN4 && last ? dt * dt / scalar(24) : scalar(0);
};
auto bow_after = [=](bool last) __attribute__((always_inline)) -> scalar {
    return CHIN4 && !last ? dt * dt / scalar(24) : scalar(0);
};
// The part of a kick's acceleration a that the flow takes back: all where the mass may touch down
// or leave during the drift, since after an impulse it would do so at the wrong time, an error of
// dt^3 in each touch-down. Only `always`, a constant, where it stays in contact: the flow of a kick
// taken back keeps no area, and what rests would heat up in an hour.
auto taken_back = [=](real z, real u, real k, real w, real g, real a, real always, bool last)
        __attribute__((always_inline)) -> real {
    if (!CHIN4) return always;
    z += a * bow_before(last);
    u -= a * ahead_of(last);
    const real rise = u + (surface_force(z, w * k) + (g + a)) * (span * scalar(0.5));
    return select((z < zero) & (z + rise * span < zero), always, a);
};
// Height z over a surface of stiffness k and velocity u along its normal, under the surface's force
// and gravity g along it, over one drift in `substeps` steps; returns the impulse of the surface
// per unit of mass. The acceleration a is taken back from the last kick and acts during the drift.
//
// The steps are kick-drift-kick, of lengths with which an oscillation comes out exactly (tan and
// sin of its phase, as series) while the mass is held, and plain ones while it is free. The step in
// which it changes between the two gets the impulse of a force that begins or ends inside it. The
// kicks that meet between two steps are one. The impulse is added up, exactly zero where nothing
// touches; what longer kicks give of the other forces counts as the surface's. A surface does not
// hold back: rounding must not make friction push.
auto contact_flow = [=](real& z, real& u, real k, real w, real g, real a, int substeps, bool last)
        __attribute__((always_inline)) -> real {
    const scalar h = span / scalar(substeps), half = scalar(0.5), ahead = ahead_of(last);
    const real all = g + a, strength = w * k, angle2 = strength * (h * h);
    const real q = select(angle2 < scalar(1), angle2, zero);
    const real free_kick = zero + h * half, free_reach = zero + h;
    const real held_kick = (q * (q + scalar(10)) * scalar(1.0 / 120) + scalar(1)) * (h * half);
    const real held_reach = (q * (q - scalar(20)) * scalar(1.0 / 120) + scalar(1)) * h;
    z += a * bow_before(last);
    u -= a * ahead;
    mask held = z < zero;
    real time = select(held, held_kick, free_kick);
    real push = surface_force(z, strength), impulse = push * time;
    u += all * time + impulse;
    impulse += all * (time - free_kick);
    for (int s = 0; s < substeps; ++s) {
        const real before = z;
        z += u * select(held, held_reach, free_reach);
        push = surface_force(z, strength);
        const mask holds = z < zero, crosses = holds != held;
        const real next = select(holds, held_kick, free_kick), both = time + next;
        time = next; held = holds;
        u += all * both;
        real given = push * both;
        if (any(crosses)) {
            const real excess = strength * (h * half) * z * before / (z - before);
            given -= select(crosses, select(z < before, excess, -excess), zero);
        }
        u += given;
        impulse += given + all * (both - free_reach);
    }
    u -= (push + all) * time;
    impulse -= push * time + all * (time - free_kick);
    z -= a * bow_after(last);
    u += a * (ahead - span);
    return select(impulse > zero, impulse, zero);
};
// The part of an impulse that may hold a mass in this drift; see touch_down.
auto share_hold = [=](real& hold, real impulse, real& left_over, bool last)
        __attribute__((always_inline)) {
    hold = last ? impulse + left_over : impulse * (scalar(2) / scalar(3));
    left_over = impulse - hold;
    hold = select(impulse > zero, hold, zero);
};

// A mass in free flight follows its parabola; where the parabola's ends, which the kick's vertical
// acceleration `a` tells, are not both above the ground, the contact flow takes over. Friction acts
// once a drift, between the kick and the drift, so that a mass that sticks does not move at all.
// What slides is slowed by the drift's own impulse. What sticks is held in proportion to the kick
// before the drift: the first drift of a chin4 step, after a third of the step's kicks, leaves a
// third of its hold to the second.
auto touch_down = [=](Sum& x, Sum& v, real w, int substeps, real& left_over, bool last,
                      real a, const Own& own, Losses& losses) __attribute__((always_inline)) {
    const real height = in_world(x).z, u = v.z;
    const real mean = u + gravity_z * span * scalar(0.5), z = height + mean * span;
    add_upright(v, zero + gravity_z, span);
    const mask touching = (height + a * bow_before(last) < zero) | (z + a * bow_after(last) < zero);
    if (any(touching)) {
        const real k = contact_stiffness(own, ground_stiffness), g = zero + gravity_z;
        real z_contact = height, u_contact = u;
        a = taken_back(height, u, k, w, g, a, zero, last);
        real impulse = contact_flow(z_contact, u_contact, k, w, g, a, substeps, last);
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
"""
