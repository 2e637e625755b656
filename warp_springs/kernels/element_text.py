"""The elements of a bundle's robots as the lanes see them: C++ text between arrays and law."""

__all__ = ["OWN_OF", "RATES"]

OWN_OF = r"""
const int* const outer_mass = model.outer_masses.data + outer_list_;
const wide* const outer_value = (const wide*)(model.outer_values.data + outer_);
const double* const outer_window = model.outer_windows.data + window_;
const Vec* const skins = (const Vec*)(model.skins.data + skin_);
const wide* const bonds = (const wide*)(model.bonds.data + bond_);
Vec* const outer = (Vec*)(left_over + (OBSTACLES ? OBSTACLES : 1) * M);

auto acting = [&](int e) __attribute__((always_inline)) -> real {
    const double* const window = outer_window + 2 * W * e;
    real part = zero;
    for (int l = 0; l < W; ++l) set_lane(part, l, acting_part(window[l], window[W + l]));
    return part;
};
// Forces of pushes, and of tethers where the masses are at x.
auto gather_outer = [&](const Vec* x) {
    for (int i = 0; i < M; ++i) outer[i] = Vec{zero, zero, zero};
    for (int e = 0; e < pushes_ + tethers_; ++e) {
        const real part = acting(e);
        if (!any(part > zero)) continue;
        const int i = outer_mass[e];
        const wide* const o = outer_value + 5 * e;
        const Far given = {o[0], o[1], o[2]};  // a force, or the point of a tether
        const Vec f = e < pushes_ ? near_of(given)
            : tether_force(way_from(x[i], given), narrow(o[3]), narrow(o[4]));
        outer[i] = outer[i] + scaled(f, part);
    }
};
// What mass i has of its own.
auto own_of = [=](int i) __attribute__((always_inline)) -> Own {
    Own own = {};
    if (OBSTACLES) own.left_over = left_over + OBSTACLES * i;
    if (OUTER) own.outer = outer[i];
    if (SKIN) own.skin = skins[i];
    if (BOUND) {
        const wide* const b = bonds + 10 * i;
        own.diagonal = Far{b[0], b[1], b[2]};
        own.corner = Far{b[3], b[4], b[5]};
        own.centre = Far{b[6], b[7], b[8]};
        own.radius = b[9];
    }
    return own;
};
"""

# The dashpots act within the kicks, by the midpoint rule: their forces are those at velocities that
# half of the kick has changed already.
RATES = r"""
// collisions
Vec* const before_v = (Vec*)(outer + (OUTER ? M : 0));
Vec* const middle_v = before_v + M;
auto find_rates = [&](const Vec* where, scalar time, bool start, auto sweep) {
    const real kept = power;
    for (int i = 0; i < M; ++i) {
        Sum u = sum_of(v, low_v, i);
        Losses losses = {};
        if (!start) lose_before(u, in_world(sum_of(x, low_x, i)), w[i], own_of(i), losses);
        before_v[i] = u;
    }
    rate_v = before_v;
    if (!EULER) {
        if (COLLIDING) collide(where, time, true, false);
        sweep(where, [&](int i, Vec f) {
            const Place at = in_world(sum_of(x, low_x, i));
            const Vec a = kick_acceleration(f, at, w[i], own_of(i));
            middle_v[i] = before_v[i] + scaled(a, zero + time * scalar(0.5));
        });
        rate_v = middle_v;
    }
    power = kept;
    dash_power = zero;
};
"""
