"""Vectors, and sums that lose nothing in mixed precision: what the law computes with."""

__all__ = ["SUMS"]

SUMS = r"""
struct Vec {
    real x, y, z;
    Vec operator+(const Vec& b) const { return Vec{x + b.x, y + b.y, z + b.z}; }
    Vec operator-(const Vec& b) const { return Vec{x - b.x, y - b.y, z - b.z}; }
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
// Where a mass is in the world; its height is exact near the ground.
auto in_world = [=](const Sum& x) __attribute__((always_inline)) -> Vec {
    return Vec{x.x + origin[0], x.y + origin[1], (x.z + origin[2]) + x.low.z};
};
// Where a place near x is that is counted from the same origin.
auto from_here = [=](Vec place, const Sum& x) __attribute__((always_inline)) -> Vec {
    return (place - x) + in_world(x);
};
#else
typedef Vec Sum;
auto sum_of = [](const Vec* a, const Vec*, int i) __attribute__((always_inline)) -> Sum {
    return a[i];
};
auto keep_sum = [](Vec* a, Vec*, int i, const Sum& sum) __attribute__((always_inline)) {
    a[i] = sum;
};
auto in_world = [](const Sum& x) __attribute__((always_inline)) -> Vec { return x; };
auto from_here = [](Vec place, const Sum&) __attribute__((always_inline)) -> Vec { return place; };
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

// What damping, drag and friction took from a velocity between two drifts.
struct Losses { Vec damping, drag, friction, outer; mask stuck; };
"""
