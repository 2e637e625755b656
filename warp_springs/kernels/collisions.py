"""Collisions within a body and between bodies of one world: C++ text for bundles of one robot.

A mass and a triangle, or two edges, that come closer than ``thickness`` are pushed apart by a
temporary spring between the nearest points of both, with rest length ``thickness``: its energy
k (thickness - d)^2 / 2 is a continuous function of the positions, so no energy comes from nowhere.

Which pairs may touch is looked up by sorting along x and sweeping, for features that are within
thickness and a margin of each other, and is looked up anew once a mass has moved by half of the
margin. More pairs than the list holds are looked at one by one.
"""

__all__ = ["COLLIDING"]

COLLIDING = r"""
const int* const triangle = model.triangles.data + triangle_;
const int* const edge = model.edges.data + edge_;
const int* const body = model.bodies.data + body_;
const int* const near_row = model.near_rows.data + near_row_;
const int* const near = model.nears.data + near_;
int* const pair_list = state.pair_lists.data + pair_list_;  // count, room for order, pairs
scalar* const listed_x = state.listed_positions.data + listed_;
const scalar* const contact = model.contacts.data + contact_;  // see warp_springs.engine.colliding
const int T = (int)triangles_, E = (int)edges_, CAPACITY = (int)capacity_;
real collision_energy = zero, rub_power = zero, soft_power = zero;

struct Point { scalar x, y, z; };
auto point_at = [](const Vec* x, int i) -> Point {
    return Point{x[i].x[0], x[i].y[0], x[i].z[0]};
};
auto minus = [](Point a, Point b) -> Point { return Point{a.x - b.x, a.y - b.y, a.z - b.z}; };
auto grown = [](Point a, scalar s) -> Point { return Point{a.x * s, a.y * s, a.z * s}; };
auto inner = [](Point a, Point b) -> scalar { return a.x * b.x + a.y * b.y + a.z * b.z; };
auto within_unit = [](scalar a) -> scalar {
    return a > scalar(0) ? (a < scalar(1) ? a : scalar(1)) : scalar(0);
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
auto refresh_pairs = [&](const Vec* x) {
    const scalar half_margin = contact[0] * scalar(0.5), limit = half_margin * half_margin;
    bool stale = pair_list[0] < 0;
    for (int i = 0; i < M && !stale; ++i) {
        const Point then = {listed_x[3 * i], listed_x[3 * i + 1], listed_x[3 * i + 2]};
        const Point way = minus(point_at(x, i), then);
        stale = !(inner(way, way) <= limit);
    }
    if (stale) list_pairs(x);
};

// The weights of the point of a triangle, or of a segment, that is nearest to p.
auto nearest_on_segment = [=](Point p, Point a, Point b, scalar* weights) {
    const Point ab = minus(b, a);
    const scalar length2 = inner(ab, ab);
    const scalar along = inner(minus(p, a), ab);
    const scalar t = length2 > scalar(0) ? within_unit(along / length2) : scalar(0);
    weights[0] = scalar(1) - t; weights[1] = t;
};
auto nearest_on_triangle = [=](Point p, const Point* corner, scalar* weights) {
    const Point ab = minus(corner[1], corner[0]), ac = minus(corner[2], corner[0]);
    const Point ap = minus(p, corner[0]);
    const scalar g00 = inner(ab, ab), g01 = inner(ab, ac), g11 = inner(ac, ac);
    const scalar r0 = inner(ab, ap), r1 = inner(ac, ap), det = g00 * g11 - g01 * g01;
    if (det > scalar(0)) {
        const scalar u = (g11 * r0 - g01 * r1) / det, v = (g00 * r1 - g01 * r0) / det;
        if (u >= scalar(0) && v >= scalar(0) && u + v <= scalar(1)) {
            weights[0] = scalar(1) - u - v; weights[1] = u; weights[2] = v;
            return;
        }
    }
    scalar best = 0;
    for (int side = 0; side < 3; ++side) {
        const int i = side, j = (side + 1) % 3;
        scalar w[2];
        nearest_on_segment(p, corner[i], corner[j], w);
        const Point q = {corner[i].x * w[0] + corner[j].x * w[1],
                         corner[i].y * w[0] + corner[j].y * w[1],
                         corner[i].z * w[0] + corner[j].z * w[1]};
        const Point d = minus(p, q);
        const scalar far = inner(d, d);
        if (side == 0 || far < best) {
            best = far;
            weights[0] = weights[1] = weights[2] = scalar(0);
            weights[i] = w[0]; weights[j] = w[1];
        }
    }
};
auto nearest_of_segments = [=](const Point* a, const Point* b, scalar* wa, scalar* wb) {
    const Point u = minus(a[1], a[0]), v = minus(b[1], b[0]), r = minus(a[0], b[0]);
    const scalar uu = inner(u, u), vv = inner(v, v), uv = inner(u, v);
    const scalar ur = inner(u, r), vr = inner(v, r), det = uu * vv - uv * uv;
    scalar s = det > uu * vv * scalar(1e-12) ? within_unit((uv * vr - vv * ur) / det)
                                            : scalar(0.5);
    scalar t = vv > scalar(0) ? within_unit((uv * s + vr) / vv) : scalar(0);
    s = uu > scalar(0) ? within_unit((uv * t - ur) / uu) : scalar(0);
    wa[0] = scalar(1) - s; wa[1] = s;
    wb[0] = scalar(1) - t; wb[1] = t;
};

// The temporary spring of a pair, if it is there: forces on its masses into F.
auto push_pair = [&](const Vec* x, int f, int g, scalar time, bool rubs) {
    int masses[6];
    scalar weights[6];
    Point at[6];
    const int m = masses_of(f, masses), n = masses_of(g, masses + m);
    for (int c = 0; c < m + n; ++c) at[c] = point_at(x, masses[c]);
    weights[0] = scalar(1);
    if (m == 1) nearest_on_triangle(at[0], at + 1, weights + 1);
    else nearest_of_segments(at, at + 2, weights, weights + 2);
    Point d = {};  // from the second feature to the first
    for (int c = 0; c < m + n; ++c) {
        if (c >= m) weights[c] = -weights[c];
        d.x += at[c].x * weights[c]; d.y += at[c].y * weights[c]; d.z += at[c].z * weights[c];
    }
    const scalar far2 = inner(d, d), thickness = contact[0];
    if (!(far2 < thickness * thickness) || !(far2 > TINY)) return;
    const scalar far = square_root(zero + far2)[0];
    const Point normal = grown(d, scalar(1) / far);
    const scalar depth = thickness - far, k = contact[1];
    collision_energy += k * depth * depth * scalar(0.5);
    scalar push = k * depth;
    Point force = grown(normal, push);
    if (rubs) {
        Point u = {};
        scalar inverse = 0;
        for (int c = 0; c < m + n; ++c) {
            const Vec speed = v[masses[c]];
            u.x += speed.x[0] * weights[c]; u.y += speed.y[0] * weights[c];
            u.z += speed.z[0] * weights[c];
            inverse += w[masses[c]][0] * weights[c] * weights[c];
        }
        const scalar rate = inner(u, normal);
        const scalar damping = scalar(2) * contact[4] * square_root(zero + k / inverse)[0];
        scalar softer = -damping * rate;
        if (push + softer < scalar(0)) softer = -push;  // it never pulls
        soft_power -= softer * (rate + softer * inverse * time * scalar(0.5));
        const Point slip = minus(u, grown(normal, rate));
        const scalar speed = square_root(zero + inner(slip, slip))[0];
        // A quarter of what would stop the slip at once: a mass has several such springs.
        const scalar stop = speed / (inverse * time) * scalar(0.25), load = push + softer;
        const scalar rub = stop <= contact[2] * load ? stop
            : contact[3] * load < stop ? contact[3] * load : stop;
        rub_power += rub * (speed - rub * inverse * time * scalar(0.5));  // at the mean speed
        const scalar along = speed > scalar(0) ? rub / speed : scalar(0);
        force = Point{normal.x * load - slip.x * along, normal.y * load - slip.y * along,
                      normal.z * load - slip.z * along};
    }
    for (int c = 0; c < m + n; ++c) {
        Vec& f_here = F[masses[c]];
        f_here.x += force.x * weights[c];
        f_here.y += force.y * weights[c];
        f_here.z += force.z * weights[c];
    }
};
// All temporary springs with the masses at x, for a kick of `time`; `rubs`: with losses.
// `listed`: by the list of candidates, which looks it up anew if need be; a look at the robots does
// without, so that it changes nothing.
auto collide = [&](const Vec* x, scalar time, bool rubs, bool listed) {
    if (listed) refresh_pairs(x);
    collision_energy = rub_power = soft_power = zero;
    const int count = pair_list[0], n = M + T + E;
    const int* const pairs = pair_list + 1 + n;
    if (listed && count <= CAPACITY) {
        for (int e = 0; e < count; ++e) push_pair(x, pairs[2 * e], pairs[2 * e + 1], time, rubs);
        return;
    }
    for (int f = 0; f < n; ++f)
        for (int g = f + 1; g < n; ++g)
            if (may_meet(f, g)) push_pair(x, f, g, time, rubs);
};
auto enter_collisions = [&](scalar time) {
    if (!LEDGER) return;
    ledger[3] += rub_power * time;
    ledger[5] += soft_power * time;
};
"""
