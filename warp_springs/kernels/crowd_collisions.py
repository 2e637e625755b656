"""Collisions where every mass gathers its own: C++ text for the crowds of ``kernels.gather``.

A *feature* is a mass, a triangle or an edge. Each feature sums, over the features it meets, what
their temporary springs do to its own masses; then each mass gathers from its features. A pair is so
computed from both sides, by the very same arithmetic: no atomics, the same bits with any number of
threads.

The features of a robot are the leaves of a binary tree of boxes, laid out once: masses, triangles
and edges in a quarter each, there bodies together and neighbours in space together. When a mass has
moved by half of the margin since the tree was last fitted, it is fitted anew, and each feature
lists those within thickness and margin of it; a list that does not fit is replaced by a walk
through the tree. A feature that does not touch adds nothing, and the order of those that do is that
of the tree: when a list was made does not matter.

What friction remembers each side keeps for itself. Of a feature that touches more than CROWD_GRIPS
others at once, a coarse triangle under a fine mesh, the rest is rubbed without memory on that side
alone: there friction is not quite the same from both sides.

What a layout must add: ``base_of(robot)``, where its positions begin in a buffer of quads.
"""

from warp_springs.kernels.contact import CONTACT, CROWD_GRIPS

__all__ = [
    "COLLISION_JOBS",
    "CROWD_COLLIDING",
    "FEATURE",
    "MARGIN",
    "MEETING",
    "NO_CROWD_COLLIDING",
    "ROOM",
]

#: Columns of the table of features.
FEATURE = ("robot", "count", "a", "b", "c", "body", "leaf", "user_a", "user_b", "user_c")
#: Columns of the table of what robots need for collisions.
MEETING = ("first", "masses", "triangles", "nodes", "leaves", "near_row", "near", "features")
#: Partners that the list of a feature has room for.
ROOM = 32
#: How far features beyond the thickness are listed, in thicknesses.
MARGIN = 4

#: What stands there without collisions.
NO_CROWD_COLLIDING = r"""
auto touches_of = [](Slot, Force&, Accounts&, scalar, bool) {};
auto touch_energy = [=](Slot) -> real { return zero; };
"""

CROWD_COLLIDING = (
    f"const int GRIPS = {CROWD_GRIPS};\n"
    + CONTACT
    + f"const int FEATURE_ROW = {len(FEATURE)}, MEETING_ROW = {len(MEETING)};\n"
    + f"const int ROOM = {ROOM}, MARGIN = {MARGIN};\n"
    + r"""
// The number of a slot within its slice, as the lanes are ordered.
auto lane_of_slot = [](int l) -> int { return W > 1 ? 4 * (l % (W / 4)) + l / (W / 4) : l; };
auto feature_row = [=](int f) -> const int* {
    return model.features.data + (long long)FEATURE_ROW * f;
};
auto meeting_row = [=](int robot) -> const int* {
    return model.meetings.data + MEETING_ROW * robot;
};
auto quad_point = [](const scalar* where, int place) -> Point {
    const scalar* const q = where + 4 * (long long)place;
    return Point{q[0], q[1], q[2]};
};
// Do two masses, as the user counts them, belong together: the same, or joined by a spring?
auto joined = [=](const int* about, int i, int j) -> bool {
    if (i == j) return true;
    const int* const row = model.near_rows.data + about[5];
    const int* const near = model.nears.data + about[6];
    for (int e = row[i]; e < row[i + 1]; ++e)
        if (near[e] == j) return true;
    return false;
};
// A mass and a triangle, or two edges, that do not belong together.
auto may_meet = [=](const int* about, const int* f, const int* g) -> bool {
    if (f[1] + g[1] != 4) return false;
    if (f[5] != g[5]) return true;
    if (model.contacts.data[CONTACT_ROW * f[0] + 5] == scalar(0)) return false;
    for (int i = 0; i < f[1]; ++i)
        for (int j = 0; j < g[1]; ++j)
            if (joined(about, f[7 + i], g[7 + j])) return false;
    return true;
};

// Boxes: low x, y, z, high x, y, z. What is empty, or not a number, meets nobody.
auto merge = [](scalar* box, const scalar* a, const scalar* b) {
    for (int c = 0; c < 3; ++c) {
        box[c] = b[c] < a[c] ? b[c] : a[c];
        box[3 + c] = b[3 + c] > a[3 + c] ? b[3 + c] : a[3 + c];
    }
};
auto box_leaf = [=](const scalar* where, int base, int f, scalar* box) {
    for (int c = 0; c < 3; ++c) { box[c] = scalar(1e30); box[3 + c] = scalar(-1e30); }
    if (f < 0) return;
    const int* const row = feature_row(f);
    for (int i = 0; i < row[1]; ++i) {
        const Point p = quad_point(where, base + row[2 + i]);
        const scalar q[6] = {p.x, p.y, p.z, p.x, p.y, p.z};
        merge(box, box, q);
    }
};
// Fits the tree of a robot to its masses at `where`; `member` of a `team` of threads that `meet`.
auto fit_tree = [=](const scalar* where, int robot, int base, int member, int team, auto meet) {
    const int* const about = meeting_row(robot);
    const int leaves = about[4];
    scalar* const boxes = state.boxes.data + 6 * (long long)about[3];
    const int* const order = model.leaf_features.data + about[3] / 2;
    for (int i = member; i < leaves; i += team)
        box_leaf(where, base, order[i], boxes + 6 * (leaves + i));
    meet();
    for (int level = leaves / 2; level >= 1; level /= 2) {
        for (int k = level + member; k < 2 * level; k += team)
            merge(boxes + 6 * k, boxes + 12 * k, boxes + 12 * k + 6);
        meet();
    }
};
// found(g) for all features that feature f may meet, near it when the tree was fitted.
auto each_near = [=](int f, auto found) {
    const int* const row = feature_row(f);
    const int* const about = meeting_row(row[0]);
    const int leaves = about[4];
    const scalar* const boxes = state.boxes.data + 6 * (long long)about[3];
    const int* const order = model.leaf_features.data + about[3] / 2;
    const scalar* const mine = boxes + 6 * (leaves + row[6]);
    const scalar reach = model.contacts.data[CONTACT_ROW * row[0]] * scalar(1 + MARGIN);
    auto apart = [=](const scalar* box) -> bool {
        bool near = true;
        for (int c = 0; c < 3; ++c)
            near = near && box[c] <= mine[3 + c] + reach && box[3 + c] >= mine[c] - reach;
        return !near;
    };
    int stack[40], height = 0;
    stack[height++] = row[1] == 2 ? 6 : row[1] == 1 ? 5 : 4;  // edges, triangles, masses
    while (height > 0) {
        const int k = stack[--height];
        if (apart(boxes + 6 * k)) continue;
        if (k < leaves) { stack[height++] = 2 * k + 1; stack[height++] = 2 * k; continue; }
        const int g = order[k - leaves];
        if (g >= 0 && g != f && may_meet(about, row, feature_row(g))) found(g);
    }
};
auto list_near = [=](int f) {
    int* const list = state.partners.data + (long long)ROOM * f;
    int count = 0;
    each_near(f, [&](int g) { if (count < ROOM) list[count] = g; ++count; });
    state.partner_counts.data[f] = count;
};
// Has the mass in a slot moved by half of the margin since the tree was fitted?
auto has_left = [=](const scalar* where, int base, int robot, int slot) -> bool {
    const int first = model.robots.data[robot * ROBOT_COLUMNS];
    const Point now = quad_point(where, base + slot - first);
    const Point then = quad_point(state.fitted_positions.data, slot);
    const Point way = minus(now, then);
    const scalar margin = model.contacts.data[CONTACT_ROW * robot] * scalar(MARGIN * 0.5);
    return !(inner(way, way) <= margin * margin);
};
auto remember = [=](const scalar* where, int base, int robot, int slot) {
    const int first = model.robots.data[robot * ROBOT_COLUMNS];
    for (int c = 0; c < 3; ++c)
        state.fitted_positions.data[4 * (long long)slot + c] =
            where[4 * (long long)(base + slot - first) + c];
};

// What the temporary springs of a feature do to its own masses.
auto push_feature = [=](int f, const scalar* where, int base, scalar time, bool rubs, bool keeps) {
    const int count = state.partner_counts.data[f];
    int* const partners = state.grip_partners.data + 2 * GRIPS * (long long)f;
    state.touched.data[f] = 0;
    if (count == 0) { if (keeps) let_go(partners); return; }
    const int* const row = feature_row(f);
    const int first = model.robots.data[row[0] * ROBOT_COLUMNS];
    scalar force[9] = {}, energy = 0, rub = 0, soft = 0;
    bool touched = false;
    auto meet_one = [&](int g) {
        const int* const a = f < g ? row : feature_row(g);
        const int* const b = f < g ? feature_row(g) : row;
        const int m = a[1];
        int slots_of[4];
        Point at[4];
        for (int c = 0; c < 4; ++c) {
            slots_of[c] = c < m ? a[2 + c] : b[2 + c - m];
            at[c] = quad_point(where, base + slots_of[c]);
        }
        auto speed_of = [&](int c) -> Point {
            const int slot = first + slots_of[c];
            const scalar* const v = state.velocities.data
                + (long long)(slot / SLICE) * 3 * SLICE + lane_of_slot(slot % SLICE);
            return Point{v[0], v[SLICE], v[2 * SLICE]};
        };
        auto inverse_of = [&](int c) -> scalar {
            const int slot = first + slots_of[c];
            const auto* const free = model.bonds.data  // the diagonal of its projector
                + (long long)(slot / SLICE) * 10 * SLICE + lane_of_slot(slot % SLICE);
            if (BOUND && free[0] == 0 && free[SLICE] == 0 && free[2 * SLICE] == 0) return scalar(0);
            return where[4 * (long long)(base + slots_of[c]) + 3];
        };
        Push pair;
        const scalar* const contact = model.contacts.data + CONTACT_ROW * row[0];
        auto grip_of = [&](bool& fresh) -> scalar* {
            int e = find_grip(partners, g, keeps);
            fresh = e < 0;
            if (fresh && keeps) e = new_grip(partners, g);
            return e < 0 ? nullptr : state.grips.data + GRIP * (GRIPS * (long long)f + e);
        };
        if (!pair_push(at, m, contact, time, rubs, speed_of, inverse_of, grip_of, keeps, pair))
            return;
        touched = true;
        energy += pair.energy * scalar(0.5);  // half of it belongs to the other side
        rub += pair.rub * scalar(0.5);
        soft += pair.soft * scalar(0.5);
        const int own = f < g ? 0 : m;
        for (int c = 0; c < row[1]; ++c) {
            force[3 * c] += pair.force.x * pair.weights[own + c];
            force[3 * c + 1] += pair.force.y * pair.weights[own + c];
            force[3 * c + 2] += pair.force.z * pair.weights[own + c];
        }
    };
    if (count <= ROOM) {
        const int* const list = state.partners.data + (long long)ROOM * f;
        for (int e = 0; e < count; ++e) meet_one(list[e]);
    } else each_near(f, meet_one);
    if (keeps) let_go(partners);
    if (!touched) return;
    state.touched.data[f] = 1;
    scalar* const out = state.feature_forces.data + 12 * (long long)f;
    for (int c = 0; c < 9; ++c) out[c] = force[c];
    out[9] = energy; out[10] = rub; out[11] = soft;
};
// work(lane, what its feature sums, its corner) for all features of the masses of a slot.
auto each_touch = [=](Slot at, auto work) {
    const int first = at.slice * SLICE + at.lane;
    for (int l = 0; l < W; ++l) {
        const int* const range = model.touch_rows.data + first + l;
        for (int e = range[0]; e < range[1]; ++e) {
            const int entry = model.touches.data[e], f = entry / 3;
            if (state.touched.data[f])
                work(lane_of_slot(l), state.feature_forces.data + 12 * (long long)f, entry % 3);
        }
    }
};
auto add_to_lane = [=](real sum, int l, scalar by) -> real {
    set_lane(sum, l, lane_of(sum, l) + by);
    return sum;
};
auto touches_of = [=](Slot at, Force& sum, Accounts& accounts, scalar time, bool enters) {
    each_touch(at, [&](int l, const scalar* of, int corner) {
        l = W > 1 ? l : 0;
        sum.f.x = add_to_lane(sum.f.x, l, of[3 * corner]);
        sum.f.y = add_to_lane(sum.f.y, l, of[3 * corner + 1]);
        sum.f.z = add_to_lane(sum.f.z, l, of[3 * corner + 2]);
        if (!LEDGER || !enters || corner) return;
        accounts.values[3] = add_to_lane(accounts.values[3], l, of[10] * time);
        accounts.values[5] = add_to_lane(accounts.values[5], l, of[11] * time);
    });
};
auto touch_energy = [=](Slot at) -> real {
    real sum = zero;
    each_touch(at, [&](int l, const scalar* of, int corner) {
        if (!corner) sum = add_to_lane(sum, W > 1 ? l : 0, of[9]);
    });
    return sum;
};
"""
)

#: What finds the temporary springs before a kick, where each pass is a launch: in order, by name,
#: what each is launched over and its text. Around it: `index`, the positions `where`, the `time`
#: of the kick, whether it `rubs` and `keeps` what friction remembers, and who `takes_part`.
COLLISION_JOBS = {
    "watch": (
        "sites",
        r"""
for (int slot = index * W; slot < index * W + W; ++slot) {
    const int robot = model.slices.data[slot / SLICE * SITE_COLUMNS];
    if (!takes_part(robot)) return;
    const int base = model.robots.data[robot * ROBOT_COLUMNS];
    if (model.touch_rows.data[slot] < model.touch_rows.data[slot + 1]
            && has_left(where, base, robot, slot))
        raise(state.stale.data + robot, 1);
}
""",
    ),
    "fit": (
        "teams",
        r"""
const int robot = index / team, member = index % team;
if (!state.stale.data[robot]) return;
const int* const about = model.robots.data + robot * ROBOT_COLUMNS;
const int past = about[0] + (about[1] + SLICE - 1) / SLICE * SLICE;
for (int slot = about[0] + member; slot < past; slot += team)
    remember(where, about[0], robot, slot);
auto meet = []() {
#if defined(__CUDA_ARCH__)
    __syncthreads();  // a team is a block
#endif
};
fit_tree(where, robot, about[0], member, team, meet);
""",
    ),
    "list": ("features", "if (state.stale.data[feature_row(index)[0]]) list_near(index);\n"),
    "push": (
        "features",
        r"""
const int robot = feature_row(index)[0];
if (!takes_part(robot)) return;
push_feature(index, where, model.robots.data[robot * ROBOT_COLUMNS], time, rubs, keeps);
if (index == meeting_row(robot)[0]) state.stale.data[robot] = 0;
""",
    ),
}
