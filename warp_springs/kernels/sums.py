"""Vectors, and sums that lose nothing in mixed precision: what the law computes with."""

__all__ = ["SUMS"]

SUMS = r"""
struct Vec {
    real x, y, z;
    Vec operator+(const Vec& b) const { return Vec{x + b.x, y + b.y, z + b.z}; }
    Vec operator-(const Vec& b) const { return Vec{x - b.x, y - b.y, z - b.z}; }
};
// The same in the numbers that hold a place in the world.
#if MIXED
struct Far {
    wide x, y, z;
    Far operator+(const Far& b) const { return Far{x + b.x, y + b.y, z + b.z}; }
    Far operator-(const Far& b) const { return Far{x - b.x, y - b.y, z - b.z}; }
};
auto far_of = [=](Vec a) __attribute__((always_inline)) -> Far {
    return Far{widen(a.x), widen(a.y), widen(a.z)};
};
auto near_of = [=](Far a) __attribute__((always_inline)) -> Vec {
    return Vec{narrow(a.x), narrow(a.y), narrow(a.z)};
};
#else
typedef Vec Far;
auto far_of = [](Vec a) __attribute__((always_inline)) -> Far { return a; };
auto near_of = [](Far a) __attribute__((always_inline)) -> Vec { return a; };
#endif
struct {
    real operator()(Vec a, Vec b) const { return a.x * b.x + a.y * b.y + a.z * b.z; }
#if MIXED
    wide operator()(Far a, Far b) const { return a.x * b.x + a.y * b.y + a.z * b.z; }
#endif
} const dot{};
struct {
    Vec operator()(Vec a, real s) const { return Vec{a.x * s, a.y * s, a.z * s}; }
#if MIXED
    Far operator()(Far a, wide s) const { return Far{a.x * s, a.y * s, a.z * s}; }
#endif
} const scaled{};
auto pick = [=](auto m, auto a, decltype(a) b) __attribute__((always_inline)) -> decltype(a) {
    return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
};

// A position or a velocity that grows by many small steps. In mixed precision `low` holds what a
// single number does not, so that nothing is lost (Fast2Sum: exact where the step is no larger than
// the sum).
#if MIXED
struct Sum : Vec { Vec low; };
auto grow = [](real& a, real& low, real by) __attribute__((always_inline)) {
    const real change = by + low, sum = a + change;
    low = change - (sum - a);
    a = sum;
};
auto sum_of = [](const Vec* a, const Vec* low, int i) __attribute__((always_inline)) -> Sum {
    return Sum{a[i], low[i]};
};
auto keep_sum = [](Vec* a, Vec* low, int i, const Sum& sum) __attribute__((always_inline)) {
    a[i] = sum; low[i] = sum.low;
};
// The origin moves: what a shifted position cannot hold goes to its low part.
auto move_origin = [](real& a, real& low, real by) __attribute__((always_inline)) {
    const real sum = a - by, part = sum - a;
    const real rest = low + ((a - (sum - part)) - (by + part));
    a = sum + rest;
    low = rest - (a - sum);
};
// The whole of a sum, and a sum from the whole.
auto whole_of = [=](const Sum& a) __attribute__((always_inline)) -> Far {
    return far_of(a) + far_of(a.low);
};
auto sum_from = [=](Far whole) __attribute__((always_inline)) -> Sum {
    const Vec high = near_of(whole);
    return Sum{high, near_of(whole - far_of(high))};
};
// Where a mass is in the world: in single numbers, with a height that is exact near the ground, and
// exactly.
struct Place : Vec { Far exact; };
auto exact_of = [=](const Place& place) __attribute__((always_inline)) -> Far {
    return place.exact;
};
auto in_world = [=](const Sum& x) __attribute__((always_inline)) -> Place {
    const Far start = {far_origin[0], far_origin[1], far_origin[2]};
    return Place{Vec{x.x + origin[0], x.y + origin[1], (x.z + origin[2]) + x.low.z},
                 start + whole_of(x)};
};
// Where a place near x is that is counted from the same origin.
auto from_here = [=](Vec place, const Sum& x) __attribute__((always_inline)) -> Place {
    const Place here = in_world(x);
    return Place{(place - x) + here, far_of(place - x) + here.exact};
};
// A place in the world as counted from the origin, and the way to it from one that is.
auto from_origin = [=](Far place) __attribute__((always_inline)) -> Far {
    return place - Far{far_origin[0], far_origin[1], far_origin[2]};
};
auto way_from = [=](Vec x, Far place) __attribute__((always_inline)) -> Vec {
    return near_of(from_origin(place) - far_of(x));
};
auto replace_where = [=](mask m, Sum& a, Vec by) __attribute__((always_inline)) {
    a = Sum{pick(m, by, Vec(a)), pick(m, Vec{}, a.low)};
};
auto keep_where = [=](mask m, Sum& a, const Sum& by) __attribute__((always_inline)) {
    a = Sum{pick(m, Vec(by), Vec(a)), pick(m, by.low, a.low)};
};
#else
typedef Vec Sum;
auto sum_of = [](const Vec* a, const Vec*, int i) __attribute__((always_inline)) -> Sum {
    return a[i];
};
auto keep_sum = [](Vec* a, Vec*, int i, const Sum& sum) __attribute__((always_inline)) {
    a[i] = sum;
};
auto whole_of = [](Vec a) __attribute__((always_inline)) -> Far { return a; };
auto sum_from = [](Far whole) __attribute__((always_inline)) -> Sum { return whole; };
typedef Vec Place;
auto exact_of = [](Vec place) __attribute__((always_inline)) -> Far { return place; };
auto in_world = [](const Sum& x) __attribute__((always_inline)) -> Place { return x; };
auto from_here = [](Vec place, const Sum&) __attribute__((always_inline)) -> Place {
    return place;
};
auto from_origin = [](Far place) __attribute__((always_inline)) -> Far { return place; };
auto way_from = [](Vec x, Far place) __attribute__((always_inline)) -> Vec { return place - x; };
auto replace_where = [=](mask m, Vec& a, Vec by) __attribute__((always_inline)) {
    a = pick(m, by, a);
};
auto keep_where = replace_where;
#endif
// Adds to the horizontal components, or to the vertical one, a rate times a time.
auto add_level = [=](Sum& sum, Vec rate, scalar time) __attribute__((always_inline)) {
#if MIXED
    grow(sum.x, sum.low.x, rate.x * time);
    grow(sum.y, sum.low.y, rate.y * time);
#else
    sum.x += rate.x * time; sum.y += rate.y * time;
#endif
};
auto add_upright = [=](Sum& sum, real rate, scalar time) __attribute__((always_inline)) {
#if MIXED
    grow(sum.z, sum.low.z, rate * time);
#else
    sum.z += rate * time;
#endif
};
auto add = [=](Sum& sum, Vec rate, scalar time) __attribute__((always_inline)) {
    add_level(sum, rate, time);
    add_upright(sum, rate.z, time);
};
// A velocity that was stopped leaves nothing over.
auto settle_rest = [=](Sum& v) __attribute__((always_inline)) {
#if MIXED
    v.low.x = select(v.x == zero, zero, v.low.x);
    v.low.y = select(v.y == zero, zero, v.low.y);
#endif
};

// What damping, drag and friction took from a velocity between two drifts. Of obstacles: the mean
// velocity of the drift, along which their friction works, and who sticks to a single one.
struct Losses { Vec damping, drag, friction, outer, mean; mask stuck; };
"""
