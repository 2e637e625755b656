"""The temporary spring between two features that are close: C++ text that every layout shares.

Everything here is scalar: a pair at a time, in whatever lanes the rest of a layout computes.
"""

__all__ = ["CONTACT", "CROWD_GRIPS", "GRIP", "GRIPS", "GRIP_DAMPING", "NUMBERS"]

#: Numbers of the contact of a robot: distance [m], stiffness [N/m], friction, damping as a part of
#: critical damping, whether a body meets itself, and how many pairs touch at once where a corner
#: meets a corner, or an edge.
NUMBERS = (
    "thickness",
    "stiffness",
    "static",
    "kinetic",
    "damping",
    "within",
    "corners",
    "corner_and_edge",
)

#: Numbers that the friction of a pair remembers: weights of the points that met, how far apart they
#: were then, and whether they slide.
GRIP = 8
#: Pairs of a feature whose friction is remembered at a time: in the lanes, where the other feature
#: of a pair may remember it too, and in a crowd.
GRIPS, CROWD_GRIPS = 8, 16
#: Damping along the surface, as a part of critical damping.
GRIP_DAMPING = 0.2

CONTACT = (
    f"const int CONTACT_ROW = {len(NUMBERS)}, GRIP = {GRIP};\n"
    f"const double GRIP_DAMPING = {GRIP_DAMPING};\n"
    + r"""
struct Point { scalar x, y, z; };
auto minus = [](Point a, Point b) -> Point { return Point{a.x - b.x, a.y - b.y, a.z - b.z}; };
auto grown = [](Point a, scalar s) -> Point { return Point{a.x * s, a.y * s, a.z * s}; };
auto inner = [](Point a, Point b) -> scalar { return a.x * b.x + a.y * b.y + a.z * b.z; };
auto within_unit = [](scalar a) -> scalar {
    return a > scalar(0) ? (a < scalar(1) ? a : scalar(1)) : scalar(0);
};
auto root_of = [=](scalar a) -> scalar { return lane_of(square_root(zero + a), 0); };

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
// Squared sine below which rounding decides where parallel segments meet: in the middle, then.
const scalar PARALLEL = scalar(sizeof(scalar) == 4 ? 1e-6 : 1e-12);
auto nearest_of_segments = [=](const Point* a, const Point* b, scalar* wa, scalar* wb) {
    const Point u = minus(a[1], a[0]), v = minus(b[1], b[0]), r = minus(a[0], b[0]);
    const scalar uu = inner(u, u), vv = inner(v, v), uv = inner(u, v);
    const scalar ur = inner(u, r), vr = inner(v, r), det = uu * vv - uv * uv;
    scalar s = det > uu * vv * PARALLEL ? within_unit((uv * vr - vv * ur) / det) : scalar(0.5);
    scalar t = vv > scalar(0) ? within_unit((uv * s + vr) / vv) : scalar(0);
    s = uu > scalar(0) ? within_unit((uv * t - ur) / uu) : scalar(0);
    wa[0] = scalar(1) - s; wa[1] = s;
    wb[0] = scalar(1) - t; wb[1] = t;
};

// How many pairs touch at once where this one does: all that share a corner which meets a corner,
// or a corner which meets an edge; elsewhere it is alone.
auto company = [=](const scalar* weights, int m, const scalar* contact) -> scalar {
    int ends[2] = {0, 0};  // masses that each side's nearest point lies between
    for (int c = 0; c < 4; ++c) ends[c >= m] += weights[c] != scalar(0);
    if (ends[0] == 1 && ends[1] == 1) return contact[6];
    return ends[0] + ends[1] == 3 ? contact[7] : scalar(1);
};

// What the temporary spring of a pair does: the force on the first feature, which the weights
// share among the masses of both (negative: those of the second), its energy, and the power of its
// friction and of its damping.
struct Push { scalar weights[4]; Point force; scalar energy, rub, soft; };
// The first feature has m masses and the second n, m + n = 4 of them `at` their places, with the
// numbers of `contact` (see NUMBERS), in a kick of `time`; `rubs`: with losses, which ask for the
// velocity and the inverse mass of each, zero where it is fixed. `grip_of` finds what their
// friction remembers, which is kept up if it `keeps`. False: they do not touch.
auto pair_push = [=](const Point* at, int m, const scalar* contact, scalar time, bool rubs,
                    auto speed_of, auto inverse_of, auto grip_of, bool keeps,
                    Push& pair) -> bool {
    scalar* const weights = pair.weights;
    weights[0] = scalar(1);
    if (m == 1) nearest_on_triangle(at[0], at + 1, weights + 1);
    else nearest_of_segments(at, at + 2, weights, weights + 2);
    Point d = {};  // from the second feature to the first
    for (int c = 0; c < 4; ++c) {
        if (c >= m) weights[c] = -weights[c];
        d.x += at[c].x * weights[c]; d.y += at[c].y * weights[c]; d.z += at[c].z * weights[c];
    }
    const scalar far2 = inner(d, d), thickness = contact[0];
    if (!(far2 < thickness * thickness) || !(far2 > TINY)) return false;
    const scalar far = root_of(far2);
    const Point normal = grown(d, scalar(1) / far);
    const scalar depth = thickness - far, k = contact[1], push = k * depth;
    pair.energy = k * depth * depth * scalar(0.5);
    pair.force = grown(normal, push);
    pair.rub = pair.soft = scalar(0);
    if (!rubs) return true;
    Point u = {};
    scalar inverse = 0;
    for (int c = 0; c < 4; ++c) {
        const Point speed = speed_of(c);
        u.x += speed.x * weights[c]; u.y += speed.y * weights[c]; u.z += speed.z * weights[c];
        inverse += inverse_of(c) * weights[c] * weights[c];
    }
    if (!(inverse > scalar(0))) return true;  // all are fixed
    // Together they damp as much as one spring of all their stiffness would.
    const scalar critical = scalar(2) * root_of(k / (inverse * company(weights, m, contact)));
    const scalar rate = inner(u, normal);
    const scalar damping = contact[4] * critical;
    scalar softer = -damping * rate;
    if (push + softer < scalar(0)) softer = -push;  // it never pulls
    pair.soft = -softer * (rate + softer * inverse * time * scalar(0.5));
    const Point slip = minus(u, grown(normal, rate));
    // The grip: a second spring holds together the two points that met first, along the surface. It
    // gives way beyond static friction and then slides on with kinetic friction.
    const scalar load = push + softer, drag_along = scalar(GRIP_DAMPING) * critical;
    bool fresh = true;
    scalar* const grip = grip_of(fresh);
    scalar own[GRIP] = {};
    for (int e = 0; e < 4; ++e) own[e] = weights[e];
    for (int e = 0; grip && !fresh && e < GRIP; ++e) own[e] = grip[e];
    Point way = {-own[4], -own[5], -own[6]};
    for (int c = 0; c < 4; ++c) {
        way.x += at[c].x * own[c]; way.y += at[c].y * own[c]; way.z += at[c].z * own[c];
    }
    way = grown(minus(way, grown(normal, inner(way, normal))), k);
    Point rub = {way.x + slip.x * drag_along, way.y + slip.y * drag_along,
                 way.z + slip.z * drag_along};
    const scalar most = (own[7] > scalar(0) ? contact[3] : contact[2]) * load;
    const scalar size = root_of(inner(rub, rub));
    const bool slides = size > most;
    if (slides) {
        const scalar least = contact[3] * load;
        if (least < size) rub = grown(rub, least / size);
        for (int e = 0; e < 4; ++e) own[e] = weights[e];
        own[4] = -rub.x / k; own[5] = -rub.y / k; own[6] = -rub.z / k;
    }
    own[7] = slides ? scalar(1) : scalar(0);
    for (int e = 0; grip && keeps && e < GRIP; ++e) grip[e] = own[e];
    pair.rub = inner(rub, slip) - inner(rub, rub) * inverse * time * scalar(0.5);
    pair.force = minus(grown(normal, load), rub);
    return true;
};

// What the friction of a feature remembers: for each of its grips the partner, -1 for none, and
// whether it was needed in the present kick. A pair that finds no room is rubbed as if it had just
// met: by damping along the surface, up to mu times its load.
auto find_grip = [](int* partners, int g, bool keeps) -> int {
    for (int e = 0; e < GRIPS; ++e)
        if (partners[e] == g) { if (keeps) partners[GRIPS + e] = 1; return e; }
    return -1;
};
auto new_grip = [](int* partners, int g) -> int {
    for (int e = 0; e < GRIPS; ++e)
        if (partners[e] < 0) { partners[e] = g; partners[GRIPS + e] = 1; return e; }
    return -1;
};
auto let_go = [](int* partners) {
    for (int e = 0; e < GRIPS; ++e) {
        if (!partners[GRIPS + e]) partners[e] = -1;
        partners[GRIPS + e] = 0;
    }
};
"""
)
