"""The physics, each formula once, as C++ that every layout instantiates for its own number type.

A layout puts in front of ``LAW`` a dialect that defines

========================  ======================================================================
``scalar``                the floating-point type
``real``                  what a formula computes with: a vector of lanes, or one ``scalar``
``mask``                  what a comparison of two ``real`` gives
``select(m, a, b)``       ``m ? a : b``, lane by lane
``any(m)``                true if any lane of ``m`` is
``square_root(a)``        IEEE square root
``inverse_root(a)``       1 / sqrt(a) to the last bit or two, for a >= TINY
========================  ======================================================================

and the constants of ``CONSTANTS`` as ``const scalar``, and the compile-time ``const bool`` of the
features. What a scene lacks is a ``false`` there, and the compiler drops its code.

Units are SI; forces are per robot mass point; ``w`` is the inverse of a mass [1/kg].
"""

from __future__ import annotations

import math

__all__ = ["CONSTANTS", "LAW", "constants"]

# Host and kernel read the constants of a run from one array, in this order.
CONSTANTS = (
    "dt",  # step [s]
    "decay_half",  # exp(-damping dt / 2): damping over half a step
    "gravity_x",  # [m/s^2]
    "gravity_y",
    "gravity_z",
    "ground_stiffness",  # K_G [N/m]
    "static_friction",
    "kinetic_friction",
    "drag",  # c of the drag -c |v| v [kg/m]
    "speed_limit",  # beyond it a robot is stopped [m/s]
)


def constants(scene, dt: float, speed_limit: float) -> list[float]:
    """Values of ``CONSTANTS`` for a scene, in float64."""
    ground = scene.ground
    return [
        dt,
        math.exp(-0.5 * scene.damping * dt),
        *scene.gravity,
        ground.stiffness if ground else 0.0,
        ground.static_friction if ground else 0.0,
        ground.kinetic_friction if ground else 0.0,
        scene.drag,
        speed_limit,
    ]


LAW = r"""
struct Vec { real x, y, z; };

// A spring of stiffness k and rest length L0 = q / k pulls its first mass with
// k (L - L0) d / L = (k - q / L) d. TINY keeps 1 / L finite where two masses coincide;
// d = 0 then makes the force zero.
auto squared_length = [=](real x, real y, real z) __attribute__((always_inline)) -> real {
    return x * x + (y * y + (z * z + TINY));
};
auto spring_pull = [=](real length2, real k, real q) __attribute__((always_inline)) -> real {
    return k - q * inverse_root(length2);
};
auto spring_energy = [=](real length2, real k, real q) __attribute__((always_inline)) -> real {
    real stretch_force = k * square_root(length2) - q;
    return stretch_force * stretch_force / k * scalar(0.5);
};

// q(t) = k (a + b sin(wt + c)) = qa + qs sin(wt) + qc cos(wt)
auto breathing = [=](real qa, real qs, real qc, real sine, real cosine)
        __attribute__((always_inline)) -> real {
    return qa + (qs * sine + qc * cosine);
};

// Exact flow of dv/dt = -c |v| v / m over h: |v| falls to |v| / (1 + c |v| h / m).
auto drag_flow = [=](Vec& v, real w, scalar h) __attribute__((always_inline)) {
    real speed = square_root(v.x * v.x + v.y * v.y + v.z * v.z);
    real factor = real(scalar(1) + zero) / (speed * w * (drag * h) + scalar(1));
    v.x *= factor; v.y *= factor; v.z *= factor;
};

// Upward force of the ground on a mass at height z.
auto ground_force = [=](real z) __attribute__((always_inline)) -> real {
    return select(z < zero, z * -ground_stiffness, zero);
};

// Coulomb's law for one step: a normal impulse j (per unit of mass) stops a tangential velocity
// up to mu_s j and shortens a larger one by mu_k j along its own direction.
auto coulomb = [=](real& ux, real& uy, real j) __attribute__((always_inline)) {
    real speed = square_root(ux * ux + uy * uy);
    real left = scalar(1) - kinetic_friction * j / select(speed > zero, speed, zero + scalar(1));
    left = select(left > zero, left, zero);
    real factor = select(speed <= static_friction * j, zero, left);
    ux *= factor; uy *= factor;
};

// The classroom's rule: the horizontal FORCE f against the normal force n. Below mu_s n both the
// force and the velocity vanish, above it the force is reduced by mu_k n.
auto course_friction = [=](real& fx, real& fy, real& ux, real& uy, real n)
        __attribute__((always_inline)) {
    real f = square_root(fx * fx + fy * fy);
    mask touching = n > zero;
    mask stuck = touching & (f < static_friction * n);
    real left = scalar(1) - kinetic_friction * n / select(f > zero, f, zero + scalar(1));
    left = select(left > zero, left, zero);
    real factor = select(stuck, zero, select(touching, left, zero + scalar(1)));
    fx *= factor; fy *= factor;
    ux = select(stuck, zero, ux); uy = select(stuck, zero, uy);
};

// Height z and vertical velocity u under gravity and the ground over one step, by `substeps`
// velocity-Verlet steps; returns the impulse of the ground per unit of mass.
auto contact_flow = [=](real& z, real& u, real w, int substeps)
        __attribute__((always_inline)) -> real {
    const scalar h = dt / scalar(substeps), half_h = h * scalar(0.5);
    real push = ground_force(z) * w, impulse = zero;
    for (int s = 0; s < substeps; ++s) {
        u += (push + gravity_z) * half_h;
        impulse += push;
        z += u * h;
        push = ground_force(z) * w;
        u += (push + gravity_z) * half_h;
        impulse += push;
    }
    return impulse * half_h;
};

// Leapfrog, kick - drift - kick. Two half kicks meet between steps, so the state kept is the
// position at t_n and the velocity just before the kick of t_n; only the first kick is a half one.
// Damping and drag act for half a step on either side of the kick (Strang splitting).
auto leapfrog_kick = [=](Vec& v, Vec f, real w, real z, bool before, scalar kick, bool after)
        __attribute__((always_inline)) {
    if (before && DAMPING) { v.x *= decay_half; v.y *= decay_half; v.z *= decay_half; }
    if (before && DRAG) drag_flow(v, w, dt * scalar(0.5));
    real ax = f.x * w + gravity_x, ay = f.y * w + gravity_y, az = f.z * w;
    if (GROUND) { if (COURSE) course_friction(ax, ay, v.x, v.y, ground_force(z) * w); }
    else az += gravity_z;
    v.x += ax * kick; v.y += ay * kick; v.z += az * kick;
    if (after && DRAG) drag_flow(v, w, dt * scalar(0.5));
    if (after && DAMPING) { v.x *= decay_half; v.y *= decay_half; v.z *= decay_half; }
};

// The drift moves by the velocity; gravity and the ground's normal force belong to it. A mass in
// free flight follows its parabola; where the parabola's ends are not both above the ground, the
// contact flow takes over, and friction acts once, with the impulse it added up.
auto leapfrog_drift = [=](Vec& x, Vec& v, real w, int substeps) __attribute__((always_inline)) {
    if (GROUND) {
        real z = x.z + (v.z + gravity_z * dt * scalar(0.5)) * dt, u = v.z + gravity_z * dt;
        mask touching = (x.z < zero) | (z < zero);
        if (any(touching)) {
            real z_contact = x.z, u_contact = v.z;
            real j = contact_flow(z_contact, u_contact, w, substeps);
            z = select(touching, z_contact, z);
            u = select(touching, u_contact, u);
            if (COULOMB) coulomb(v.x, v.y, select(touching, j, zero));
        }
        x.z = z; v.z = u;
    } else {
        x.z += v.z * dt;
    }
    x.x += v.x * dt; x.y += v.y * dt;
};

// The velocity at t_n, from the state before its kick: the missing half step, with the friction
// of half a step, so that a mass that sticks is reported at rest.
auto leapfrog_synchronise = [=](Vec& v, Vec f, real w, real z) __attribute__((always_inline)) {
    leapfrog_kick(v, f, w, z, true, dt * scalar(0.5), false);
    if (GROUND && COULOMB) coulomb(v.x, v.y, ground_force(z) * w * (dt * scalar(0.5)));
};

// Symplectic Euler, the classroom's method: all forces at t_n, then velocity, then position.
auto euler_step = [=](Vec& x, Vec& v, Vec f, real w) __attribute__((always_inline)) {
    real ax = f.x * w + gravity_x, ay = f.y * w + gravity_y, az = f.z * w + gravity_z;
    if (GROUND) {
        real push = ground_force(x.z) * w;
        if (COURSE) course_friction(ax, ay, v.x, v.y, push);
        v.x += ax * dt; v.y += ay * dt;
        if (COULOMB) coulomb(v.x, v.y, push * dt);
        v.z += (az + push) * dt;
    } else {
        v.x += ax * dt; v.y += ay * dt; v.z += az * dt;
    }
    if (DAMPING) {
        const scalar decay = decay_half * decay_half;
        v.x *= decay; v.y *= decay; v.z *= decay;
    }
    if (DRAG) drag_flow(v, w, dt);
    x.x += v.x * dt; x.y += v.y * dt; x.z += v.z * dt;
};
"""
