"""Collisions within a body and between bodies of one world: C++ text for bundles of one robot.

A mass and a triangle, or two edges, that come closer than ``thickness`` are pushed apart by a
temporary spring between the nearest points of both, with rest length ``thickness``: its energy
k (thickness - d)^2 / 2 is a continuous function of the positions, so no energy comes from nowhere.

Which pairs may touch is looked up by sorting along x and sweeping, for features that are within
thickness and a margin of each other, and is looked up anew once a mass has moved by half of the
margin. More pairs than the list holds are looked at one by one.
"""

from warp_springs.kernels.contact import CONTACT, GRIPS

__all__ = ["COLLIDING"]

COLLIDING = (
    f"const int GRIPS = {GRIPS};\n"
    + CONTACT
    + r"""
const int* const triangle = model.triangles.data + triangle_;
const int* const edge = model.edges.data + edge_;
const int* const body = model.bodies.data + body_;
const int* const near_row = model.near_rows.data + near_row_;
const int* const near = model.nears.data + near_;
int* const pair_list = state.pair_lists.data + pair_list_;  // count, room for order, pairs
int* const grip_partners = state.grip_partners.data + grip_partner_;
scalar* const grips = state.grips.data + grip_;
scalar* const listed_x = state.listed_positions.data + listed_;
const scalar* const contact = model.contacts.data + contact_;  // see kernels.contact
const int T = (int)triangles_, E = (int)edges_, CAPACITY = (int)capacity_;
real collision_energy = zero, rub_power = zero, soft_power = zero;

auto point_at = [](const Vec* x, int i) -> Point {
    return Point{x[i].x[0], x[i].y[0], x[i].z[0]};
};

// Do two masses belong together: the same, or joined by a spring?
auto joined = [=](int i, int j) -> bool {
    if (i == j) return true;
    for (int e = near_row[i]; e < near_row[i + 1]; ++e)
        if (near[e] == j) return true;
    return false;
};
// Feature f: a mass (f < M), a triangle, or an edge; its masses and how many.
auto masses_of = [=](int f, int* masses) -> int {
    if (f < M) { masses[0] = f; return 1; }
    const int count = f < M + T ? 3 : 2;
    const int* const from = f < M + T ? triangle + 3 * (f - M) : edge + 2 * (f - M - T);
    for (int c = 0; c < count; ++c) masses[c] = from[c];
    return count;
};
// A mass and a triangle, or two edges, that do not belong together.
auto may_meet = [=](int f, int g) -> bool {
    const bool edges = f >= M + T && g >= M + T;
    const bool mass_and_face = (f < M) != (g < M) && f < M + T && g < M + T;
    if (!edges && !mass_and_face) return false;
    int a[3], b[3];
    const int m = masses_of(f, a), n = masses_of(g, b);
    if (body[a[0]] != body[b[0]]) return true;
    if (contact[5] == scalar(0)) return false;
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j)
            if (joined(a[i], b[j])) return false;
    return true;
};
auto box_of = [=](const Vec* x, int f, scalar* low, scalar* high) {
    int masses[3];
    const int n = masses_of(f, masses);
    for (int c = 0; c < n; ++c) {
        const Point p = point_at(x, masses[c]);
        const scalar q[3] = {p.x, p.y, p.z};
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = c && low[axis] < q[axis] ? low[axis] : q[axis];
            high[axis] = c && high[axis] > q[axis] ? high[axis] : q[axis];
        }
    }
};
auto left_end = [=](const Vec* x, int f) -> scalar {
    scalar low[3], high[3];
    box_of(x, f, low, high);
    return low[0];
};
// Candidates, from features sorted by where they begin along x. Returns false if they do not fit.
auto list_pairs = [&](const Vec* x) {
    int* const order = pair_list + 1;
    int* const pairs = order + M + T + E;
    const int n = M + T + E;
    const scalar reach = contact[0] * scalar(2);  // thickness and as much margin
    for (int gap = n / 2; gap > 0; gap /= 2)  // Shell's sort: nearly sorted from the last time
        for (int i = gap; i < n; ++i) {
            const int f = order[i];
            const scalar key = left_end(x, f);
            int j = i;
            for (; j >= gap && left_end(x, order[j - gap]) > key; j -= gap)
                order[j] = order[j - gap];
            order[j] = f;
        }
    int count = 0;
    for (int i = 0; i < n; ++i) {
        scalar low[3], high[3];
        box_of(x, order[i], low, high);
        for (int j = i + 1; j < n; ++j) {
            scalar from[3], to[3];
            box_of(x, order[j], from, to);
            if (from[0] > high[0] + reach) break;
            if (from[1] > high[1] + reach || to[1] < low[1] - reach) continue;
            if (from[2] > high[2] + reach || to[2] < low[2] - reach) continue;
            if (!may_meet(order[i], order[j])) continue;
            if (count < CAPACITY) {
                const bool swap = order[i] > order[j];  // the lower feature first
                pairs[2 * count] = swap ? order[j] : order[i];
                pairs[2 * count + 1] = swap ? order[i] : order[j];
            }
            ++count;
        }
    }
    pair_list[0] = count;
    for (int i = 0; i < M; ++i) {
        const Point p = point_at(x, i);
        listed_x[3 * i] = p.x; listed_x[3 * i + 1] = p.y; listed_x[3 * i + 2] = p.z;
    }
};
auto list_is_stale = [=](const Vec* x) -> bool {
    const scalar half_margin = contact[0] * scalar(0.5), limit = half_margin * half_margin;
    bool stale = pair_list[0] < 0;
    for (int i = 0; i < M && !stale; ++i) {
        const Point then = {listed_x[3 * i], listed_x[3 * i + 1], listed_x[3 * i + 2]};
        const Point way = minus(point_at(x, i), then);
        stale = !(inner(way, way) <= limit);
    }
    return stale;
};

// The temporary spring of a pair, if it is there: forces on its masses into F.
auto push_pair = [&](const Vec* x, int f, int g, scalar time, bool rubs, bool keeps) {
    int masses[4];
    Point at[4];
    const int m = masses_of(f, masses);
    masses_of(g, masses + m);
    for (int c = 0; c < 4; ++c) at[c] = point_at(x, masses[c]);
    Push pair;
    auto speed_of = [&](int c) -> Point { return point_at(v, masses[c]); };
    auto inverse_of = [&](int c) -> scalar {
        const wide* const free = bonds + 10 * masses[c];  // the diagonal of its projector
        if (BOUND && free[0][0] == 0 && free[1][0] == 0 && free[2][0] == 0) return scalar(0);
        return w[masses[c]][0];
    };
    auto grip_of = [&](bool& fresh) -> scalar* {
        for (int attempt = 0; attempt < (keeps ? 4 : 2); ++attempt) {
            const int owner = attempt % 2 ? g : f, partner = attempt % 2 ? f : g;
            int* const partners = grip_partners + 2 * GRIPS * owner;
            fresh = attempt >= 2;
            const int e = fresh ? new_grip(partners, partner) : find_grip(partners, partner, keeps);
            if (e >= 0) return grips + GRIP * (GRIPS * (int64_t)owner + e);
        }
        return nullptr;
    };
    if (!pair_push(at, m, contact, time, rubs, speed_of, inverse_of, grip_of, keeps, pair)) return;
    collision_energy += pair.energy;
    rub_power += pair.rub;
    soft_power += pair.soft;
    for (int c = 0; c < 4; ++c) {
        Vec& f_here = F[masses[c]];
        f_here.x += pair.force.x * pair.weights[c];
        f_here.y += pair.force.y * pair.weights[c];
        f_here.z += pair.force.z * pair.weights[c];
    }
};
// All temporary springs with the masses at x, for a kick of `time`; `rubs`: with losses.
// `listed`: by the list of candidates, which is looked up anew if need be; a look at the robots
// takes it only if it still holds, so that it changes nothing.
auto collide = [&](const Vec* x, scalar time, bool rubs, bool listed) {
    const bool stale = list_is_stale(x), keeps = listed && rubs;
    if (listed && stale) list_pairs(x);
    collision_energy = rub_power = soft_power = zero;
    const int count = pair_list[0], n = M + T + E;
    const int* const pairs = pair_list + 1 + n;
    if ((listed || !stale) && count <= CAPACITY) {
        for (int e = 0; e < count; ++e)
            push_pair(x, pairs[2 * e], pairs[2 * e + 1], time, rubs, keeps);
    } else
        for (int f = 0; f < n; ++f)
            for (int g = f + 1; g < n; ++g)
                if (may_meet(f, g)) push_pair(x, f, g, time, rubs, keeps);
    for (int f = 0; keeps && f < n; ++f) let_go(grip_partners + 2 * GRIPS * f);
};
auto enter_collisions = [&](scalar time) {
    if (!LEDGER) return;
    ledger[3] += rub_power * time;
    ledger[5] += soft_power * time;
};
"""
)
