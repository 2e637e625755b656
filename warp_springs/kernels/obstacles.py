"""Obstacles: planes, balls, boxes and terrain, as records of numbers and as the law of touch.

A scene with obstacles has its ground among them, as the first plane.
"""

from __future__ import annotations

import numpy as np

from warp_springs.surfaces import Box, HeightField, Plane, Sphere

__all__ = ["MEETING", "RECORD", "TOUCHING", "obstacle_tables"]

#: Numbers of one obstacle: its kind, stiffness, static and kinetic friction, then its shape.
RECORD = 20
_KINDS = {Plane: 0, Sphere: 1, Box: 2, HeightField: 3}


def obstacle_tables(scene) -> tuple[np.ndarray, np.ndarray]:
    """The records of the obstacles of a scene, flat, and the heights of all its terrain [m]."""
    ground = scene.ground
    found = list(scene.obstacles)
    if ground is not None and found:
        skin = (ground.stiffness, ground.static_friction, ground.kinetic_friction)
        names = ("stiffness", "static_friction", "kinetic_friction")
        found.insert(0, Plane(**dict(zip(names, skin, strict=True))))
    records, heights = np.zeros((len(found), RECORD)), [np.zeros(0)]
    for record, obstacle in zip(records, found, strict=True):
        shape = _shape(obstacle, sum(map(len, heights)))
        record[:4] = (
            _KINDS[type(obstacle)],
            obstacle.stiffness,
            obstacle.static_friction,
            obstacle.kinetic_friction,
        )
        record[4 : 4 + len(shape)] = shape
        if isinstance(obstacle, HeightField):
            heights.append(obstacle.heights.ravel())
    return records.ravel(), np.concatenate(heights)


def _shape(obstacle, heights: int) -> tuple[float, ...]:
    """The numbers of an obstacle's shape; its heights begin at ``heights``."""
    if isinstance(obstacle, Plane):
        return (*obstacle.normal, obstacle.offset)
    if isinstance(obstacle, Sphere):
        return (*obstacle.center, obstacle.radius)
    if isinstance(obstacle, Box):
        half = 0.5 * np.asarray(obstacle.size)
        return (*obstacle.center, *half, *obstacle.rotation.ravel())
    return (*obstacle.origin, obstacle.spacing, *obstacle.heights.shape, heights)


# Which surface a point touches.
TOUCHING = r"""
// The distance of a point from the surface of an obstacle, negative inside, and the normal there.
struct Touch { real gap; Vec n; };

auto triple = [=](const double* o) __attribute__((always_inline)) -> Far {
    return Far{wide_zero + wide_scalar(o[0]), wide_zero + wide_scalar(o[1]),
               wide_zero + wide_scalar(o[2])};
};
auto touch_plane = [=](const double* o, Far x) __attribute__((always_inline)) -> Touch {
    const Far n = triple(o + 4);
    return Touch{narrow(dot(n, x) - wide_scalar(o[7])), near_of(n)};
};
auto touch_ball = [=](const double* o, Far x) __attribute__((always_inline)) -> Touch {
    const Far d = x - triple(o + 4);
    const wide r = square_root(dot(d, d) + TINY);
    return Touch{narrow(r - wide_scalar(o[7])),
                 near_of(scaled(d, (wide_zero + wide_scalar(1)) / r))};
};
// Inside, the nearest face pushes; outside, only whether a face separates matters.
auto touch_box = [=](const double* o, Far x) __attribute__((always_inline)) -> Touch {
    const Far d = x - triple(o + 4);
    const wide one = wide_zero + wide_scalar(1);
    wide best = wide_zero;
    Far normal = {wide_zero, wide_zero, wide_zero};
    for (int axis = 0; axis < 3; ++axis) {
        const double axes[3] = {o[10 + axis], o[13 + axis], o[16 + axis]};
        const Far e = triple(axes);
        const wide along = dot(e, d);
        const wide_mask under = along < wide_zero;
        const wide gap = select(under, -along, along) - wide_scalar(o[7 + axis]);
        const wide_mask nearer = axis == 0 ? wide_zero == wide_zero : gap > best;
        best = select(nearer, gap, best);
        normal = pick(nearer, scaled(e, select(under, wide_zero - one, one)), normal);
    }
    return Touch{narrow(best), near_of(normal)};
};
// Bilinear between four grid points, flat beyond the rim; the distance is that from the tangent.
auto touch_terrain = [=](const double* o, Far x) -> Touch {
    const double spacing = o[7];
    const int nx = (int)o[8], ny = (int)o[9];
    const double* const field = heights + (int64_t)o[10];
    Touch found = {zero, {zero, zero, zero}};
    for (int l = 0; l < W; ++l) {
        double u = (lane_of(x.x, l) - o[4]) / spacing, v = (lane_of(x.y, l) - o[5]) / spacing;
        const bool flat_u = !(u > 0 && u < nx - 1), flat_v = !(v > 0 && v < ny - 1);
        u = u > 0 ? (u < nx - 1 ? u : nx - 1) : 0;
        v = v > 0 ? (v < ny - 1 ? v : ny - 1) : 0;
        const int i = u < nx - 2 ? (int)u : nx - 2, j = v < ny - 2 ? (int)v : ny - 2;
        u -= i; v -= j;
        const double* const corner = field + (int64_t)i * ny + j;
        const double a = corner[0], b = corner[ny], c = corner[1], d = corner[ny + 1];
        const double z = (a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v;
        const double zx = flat_u ? 0 : ((b - a) * (1 - v) + (d - c) * v) / spacing;
        const double zy = flat_v ? 0 : ((c - a) * (1 - u) + (d - b) * u) / spacing;
        const double steep = 1 / ::sqrt(1 + zx * zx + zy * zy);
        set_lane(found.gap, l, scalar((lane_of(x.z, l) - o[6] - z) * steep));
        set_lane(found.n.x, l, scalar(-zx * steep));
        set_lane(found.n.y, l, scalar(-zy * steep));
        set_lane(found.n.z, l, scalar(steep));
    }
    return found;
};
auto touch = [=](const double* o, const Place& place) -> Touch {
    const int kind = (int)o[0];
    const Far x = exact_of(place);
    if (kind == 0) return touch_plane(o, x);
    if (kind == 1) return touch_ball(o, x);
    return kind == 2 ? touch_box(o, x) : touch_terrain(o, x);
};
auto depth_in_obstacles = [=](const Place& x) -> real {
    real deepest = zero;
    for (int k = 0; k < OBSTACLES; ++k) {
        const real depth = -touch(obstacles + RECORD * k, x).gap;
        deepest = select(depth > deepest, depth, deepest);
    }
    return deepest;
};
auto obstacle_energy = [=](const Place& x, const Own& own) -> real {
    real energy = zero;
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const real gap = touch(o, x).gap, depth = select(gap < zero, gap, zero);
        energy += contact_stiffness(own, scalar(o[1])) * depth * depth * scalar(0.5);
    }
    return energy;
};
"""

# What touching does.
MEETING = r"""
// What Coulomb's law leaves of the tangential velocity u, for a surface with friction of its own.
auto rub_surface = [=](Vec u, real hold, real impulse, const Own& own, const double* o)
        __attribute__((always_inline)) -> Vec {
    const real factor = coulomb(square_root(dot(u, u)), hold, impulse,
                                static_friction_of(own, scalar(o[2])),
                                kinetic_friction_of(own, scalar(o[3])));
    return scaled(u, factor);
};

// How a mass met a surface: its normal, what it can hold and what its impulse was; see touch_down.
struct Meeting { Vec n; real hold, impulse; };

// Friction of the surfaces that were met, once all have pushed: on the mean velocity of the drift,
// which tells how far the mass went. What sticks to one surface then keeps its place along it, also
// where another would push it that way, and a mass in a corner rests. What one surface pushes along
// another it pushes evenly, in both drifts of a step.
auto rub_on_surfaces = [=](const Meeting* met, mask wedged, Sum& v, Vec& mean, Vec& bow,
                           const Own& own, Losses& losses) {
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const real mu_s = static_friction_of(own, scalar(o[2]));
        const real mu_k = kinetic_friction_of(own, scalar(o[3]));
        const mask rubs = (met[k].impulse > zero) & ((mu_s > zero) | (mu_k > zero));
        if (!any(rubs)) continue;
        const Vec n = met[k].n, rise = scaled(n, dot(n, mean)), slip = mean - rise;
        const real impulse = met[k].impulse, least = select(wedged, impulse, zero);
        const real hold = select(met[k].hold > least, met[k].hold, least);
        const real left = coulomb(square_root(dot(slip, slip)), hold, impulse, mu_s, mu_k);
        const mask stuck = rubs & (left <= zero);
        const Vec lost = pick(rubs, scaled(slip, scalar(1) - left), Vec{zero, zero, zero});
        const real part = select(stuck, zero, (left + scalar(1)) * scalar(0.5));
        replace_where(rubs, v, v - lost);
        mean = pick(rubs, rise + scaled(slip, part), mean);
        if (CHIN4) bow = pick(rubs, scaled(n, dot(n, bow)), bow);
        if (!LEDGER) continue;
        losses.friction = losses.friction + lost;
        losses.stuck |= stuck;
    }
    if (LEDGER) losses.mean = mean;
};
// A place after a drift of this mean velocity.
auto moved_on = [=](Sum from, Vec mean) __attribute__((always_inline)) -> Sum {
    add(from, mean, span);
    return from;
};
// A mass that its drift took from `from` to x, after a kick by the acceleration a, is stopped and
// turned by the obstacles it meets. Gravity, a kick here, acts together with their forces, so that
// a mass at rest stays at rest.
auto meet_obstacles = [=](Sum& x, Sum& v, const Sum& from, Vec a, real w, int substeps, bool last,
                          const Own& own, Losses& losses) {
    const Vec gravity = {zero + gravity_x, zero + gravity_y, zero + gravity_z};
    const scalar bow_rate = (bow_before(last) - bow_after(last)) / span;
    Meeting met[OBSTACLES ? OBSTACLES : 1];
    Vec mean = v, bow = {zero, zero, zero};  // how far the stages of a step leave its ends
    real surfaces = zero;
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const Touch end = touch(o, in_world(x));
        const mask touching = (end.gap < zero) | (touch(o, in_world(from)).gap < zero);
        met[k] = Meeting{end.n, zero, zero};
        if (!any(touching)) { if (CHIN4) own.left_over[k] = zero; continue; }
        const real speed = dot(v, end.n), stiffness = contact_stiffness(own, scalar(o[1]));
        real z = end.gap - dot(end.n, mean) * span, u = speed;
        const real back = taken_back(z, u, stiffness, w, zero, dot(a, end.n),
                                     dot(gravity, end.n), last);
        const real impulse = contact_flow(z, u, stiffness, w, zero, back, substeps, last);
        met[k].hold = met[k].impulse = select(touching, impulse, zero);
        if (CHIN4) share_hold(met[k].hold, met[k].impulse, own.left_over[k], last);
        replace_where(touching, v, v + scaled(end.n, u - speed));
        mean = pick(touching, mean + scaled(end.n, (z - end.gap) / span), mean);
        if (CHIN4) bow = pick(touching, bow + scaled(end.n, dot(a, end.n) * bow_rate), bow);
        keep_where(touching, x, moved_on(from, mean));
        surfaces += select(touching, zero + scalar(1), zero);
    }
    if (!any(surfaces > zero)) return;
    mean = mean - bow;
    rub_on_surfaces(met, surfaces > scalar(1.5), v, mean, bow, own, losses);
    keep_where(surfaces > zero, x, moved_on(from, mean + bow));
    if (LEDGER) losses.stuck &= surfaces < scalar(1.5);
};

// The same for symplectic Euler, before its drift: forces at x.
auto push_by_obstacles = [=](const Place& x, Sum& v, real w, const Own& own, Losses& losses) {
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const Touch now = touch(o, x);
        const real depth = select(now.gap < zero, -now.gap, zero);
        if (!any(depth > zero)) continue;
        const real impulse = contact_stiffness(own, scalar(o[1])) * depth * w * dt;
        const real speed = dot(v, now.n);
        const Vec along = v - scaled(now.n, speed);
        const Vec rubbed = rub_surface(along, impulse, impulse, own, o);
        if (LEDGER) losses.friction = losses.friction + (along - rubbed);
        replace_where(depth > zero, v, rubbed + scaled(now.n, speed + impulse));
    }
};
// A mass that sticks is reported at rest; see synchronise.
auto hold_by_obstacles = [=](const Place& x, Sum& v, real w, scalar time, const Own& own,
                             Losses& losses) {
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const Touch now = touch(o, x);
        const real depth = select(now.gap < zero, -now.gap, zero);
        if (!any(depth > zero)) continue;
        const real impulse = contact_stiffness(own, scalar(o[1])) * depth * w * time;
        const Vec along = v - scaled(now.n, dot(v, now.n));
        const Vec rubbed = rub_surface(along, impulse, zero, own, o);
        if (LEDGER) losses.friction = losses.friction + (along - rubbed);
        replace_where(depth > zero, v, v - along + rubbed);
    }
};
"""
