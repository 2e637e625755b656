"""Where a thread of a crowd works, and how it loads: C++ text for one slot or for the lanes."""

from warp_springs.kernels.dialect import quad_operations

__all__ = ["ENDS", "KEPT", "SCALAR_LOADS", "SLOT", "vector_loads"]

# Where a thread works: one slot of a slice, or, where the slots are lanes, all of them (lane 0).
# `own` is its place in the buffers of positions, and `base` that of its robot's first slot; `root`
# is the number of that slot among all.
SLOT = r"""
struct Slot { int slice, lane, robot, own, base, root; };
// The same slot where buffers hold all slots.
auto among_all = [=](Slot at) -> Slot {
    return Slot{at.slice, at.lane, at.robot, at.slice * SLICE + at.lane, at.root, at.root};
};
"""

# The springs of a slot that have more to them than k and L0: what each end has of its own lies in
# rows as the coefficients do, and changes in the same way from both ends.
ENDS = r"""
auto each_end = [=](Slot at, auto work) __attribute__((always_inline)) {
    const int* const site = model.slices.data + (long long)at.slice * SITE_COLUMNS;
    const int length = site[3];
    const int moments = TIMETABLE ? model.robots.data[at.robot * ROBOT_COLUMNS + 8] : 0;
    const unsigned* j = (const unsigned*)model.neighbours.data + (long long)site[1] * SLICE
        + at.lane;
    long long end = (long long)site[2] * SLICE + at.lane;
    for (int e = 0; e < length; ++e, j += SLICE, end += SLICE)
        work(j, end, Spring{(const real*)(model.coefficients.data + K * end),
                            (real*)(state.spring_oscillators.data + 4 * end),
                            model.spring_omegas.data + end,
                            (const real*)(model.schedules.data + 2 * moments * end),
                            (real*)(state.worn.data + 2 * end)});
};
"""


def vector_loads(width: int) -> str:
    """How the lanes of a register load: vectors as they lie, quads by transposition."""
    rows = width // 4

    def joined(quads: list[str]) -> str:
        if len(quads) == 1:
            return quads[0]
        half = len(quads) // 2
        order = ", ".join(map(str, range(4 * len(quads))))
        return f"__builtin_shufflevector({joined(quads[:half])}, {joined(quads[half:])}, {order})"

    quads = [f"*(const quad*)(where + j[{slot}])" for slot in range(width)]
    gathered = "\n".join(
        f"real {name} = {joined(quads[v * rows : (v + 1) * rows])};"
        for v, name in enumerate("abcd")
    )
    return (
        quad_operations(width)
        + f"""
typedef scalar quad __attribute__((vector_size(4 * sizeof(scalar))));
auto neighbours_of = [=](const scalar* where, const unsigned* j) __attribute__((always_inline))
        -> Vec {{
    {gathered}
    transpose(a, b, c, d);
    return Vec{{a, b, c}};
}};
"""
        + _VECTOR_LOADS
    )


_VECTOR_LOADS = r"""
auto own_quad = [=](const scalar* where, Slot at, real& w) __attribute__((always_inline)) -> Vec {
    const real* const q = (const real*)(where + 4 * at.own);
    real a = q[0], b = q[1], c = q[2];
    w = q[3];
    transpose(a, b, c, w);
    return Vec{a, b, c};
};
auto keep_quad = [=](scalar* where, Slot at, Vec x, real w) __attribute__((always_inline)) {
    real* const q = (real*)(where + 4 * at.own);
    transpose(x.x, x.y, x.z, w);
    q[0] = x.x; q[1] = x.y; q[2] = x.z; q[3] = w;
};
auto in_slice = [=](scalar* values, Slot at, int rows) __attribute__((always_inline)) -> real* {
    return (real*)(values + (long long)at.slice * rows * W);
};
auto wide_in_slice = [=](wide_scalar* values, Slot at, int rows)
        __attribute__((always_inline)) -> wide* {
    return (wide*)(values + (long long)at.slice * rows * W);
};
const int STRIDE = 1;  // from one row of a slice to the next, in numbers
auto each_spring = [=](Slot at, const scalar* where, auto work) __attribute__((always_inline)) {
    const int* const site = model.slices.data + (long long)at.slice * SITE_COLUMNS;
    const int columns = ACTUATED ? 4 : 2, length = site[3];
    const unsigned* j = (const unsigned*)model.neighbours.data + (long long)site[1] * W;
    const real* c = (const real*)model.coefficients.data + (long long)site[2] * columns;
    for (int e = 0; e < length; ++e, j += W, c += columns)
        work(neighbours_of(where + 4 * at.base, j), c[0], c[1], ACTUATED ? c[2] : zero,
             ACTUATED ? c[3] : zero);
};
"""

SCALAR_LOADS = r"""
// A GPU moves 16 bytes at once where it knows them aligned; shared memory on a CPU is not.
#if defined(__CUDA_ARCH__)
const int QUAD_ALIGNMENT = 16;
#else
const int QUAD_ALIGNMENT = sizeof(scalar);
#endif
struct alignas(QUAD_ALIGNMENT) Quad { scalar x, y, z, w; };
struct alignas(2 * sizeof(scalar)) Pair { scalar x, y; };
struct alignas(8) Two { int x, y; };
struct alignas(16) Four { int x, y, z, w; };

auto own_quad = [=](const scalar* where, Slot at, real& w) -> Vec {
    const Quad q = *(const Quad*)(where + 4 * at.own);
    w = q.w;
    return Vec{q.x, q.y, q.z};
};
auto keep_quad = [=](scalar* where, Slot at, Vec x, real w) {
    *(Quad*)(where + 4 * at.own) = Quad{x.x, x.y, x.z, w};
};
auto in_slice = [=](auto* values, Slot at, int rows) -> decltype(values) {
    return values + (long long)at.slice * rows * SLICE + at.lane;
};
auto wide_in_slice = in_slice;
const int STRIDE = SLICE;
auto neighbours_of = [=](const scalar* where, const unsigned* j) -> Vec {
    const Quad q = *(const Quad*)(where + *j);
    return Vec{q.x, q.y, q.z};
};
auto each_spring = [=](Slot at, const scalar* where, auto work) {
    const Four site = *(const Four*)(model.slices.data + (long long)at.slice * SITE_COLUMNS);
    const int length = site.w, columns = ACTUATED ? 4 : 2;
    const int* j = model.neighbours.data + (long long)site.y * SLICE + at.lane * TOGETHER;
    const scalar* c = model.coefficients.data
        + ((long long)site.z * SLICE + at.lane * TOGETHER) * columns;
    auto there = [=](int neighbour) -> Vec {
        const Quad q = *(const Quad*)(where + 4 * at.base + neighbour);
        return Vec{q.x, q.y, q.z};
    };
    for (int e = 0; e < length; e += TOGETHER) {
        if (ACTUATED) {
            const Quad q = *(const Quad*)c;
            work(there(*j), q.x, q.y, q.z, q.w);
        } else if (TOGETHER == 2) {
            const Two pair = *(const Two*)j;
            const Quad q = *(const Quad*)c;
            work(there(pair.x), q.x, q.y, zero, zero);
            work(there(pair.y), q.z, q.w, zero, zero);
        } else {
            const Pair q = *(const Pair*)c;
            work(there(*j), q.x, q.y, zero, zero);
        }
        j += SLICE * TOGETHER;
        c += SLICE * TOGETHER * columns;
    }
};
"""

# Where the flat layouts keep what a mass is besides its position.
KEPT = r"""
auto low_at = [=](Slot at) -> Vec {
    return MIXED ? load(state.low_positions.data, at) : Vec{};
};
auto velocity_at = [=](Slot at) -> Sum {
    return load_sum(state.velocities.data, state.low_velocities.data, at);
};
auto keep = [=](Slot at, Vec low, const Sum& v) {
    if (MIXED) store(state.low_positions.data, at, low);
    store_sum(state.velocities.data, state.low_velocities.data, at, v);
};
"""
