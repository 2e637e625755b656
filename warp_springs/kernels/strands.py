"""A robot that shares its topology with nobody, stepped with its own springs and masses as lanes.

A pass over the springs works in three sweeps. Along the rows, d = p_j - p_i of every spring is
taken as one short vector (x, y, z, pad) and kept. Then W springs at a time are transposed, so that
the lanes hold W springs: the law computes W pulls at once, and each is spread over its own d. Along
the rows again the forces are added up, in the same order as a bundle adds them. The masses are
moved W at a time, transposed likewise; the pad of a position holds the inverse mass.

The order of every sum is that of ``kernels.lanes`` and the law is the same text, so a robot's bits
are the same in both.
"""

from warp_springs.kernels.dialect import native_width, quad_operations, vector_dialect
from warp_springs.kernels.law import LAW
from warp_springs.kernels.permuted import PERMUTED, permutation, permuted_scratch

__all__ = ["strand_passes", "strand_scratch", "strand_width"]


def strand_width(precision: str) -> int:
    """Springs or masses of one robot in the lanes: a register's, but no fewer than four."""
    return max(4, native_width(precision))


def strand_scratch(features, masses: int, springs: int) -> int:
    """Scratch values that the largest robot of a slice needs."""
    width = strand_width(features.precision)
    surfaces = max(1, features.obstacles)
    permuted = permuted_scratch(masses + width, springs, width, surfaces)
    masses, springs = masses + width, springs + 2 * width
    state = 24 if features.precision == "mixed" else 16
    values = (state + surfaces) * masses + 8 * springs
    indices = 2 * masses + 9 * springs  # no larger than a value each
    return max(values + indices, permuted)


def strand_passes(precision: str) -> str:
    """C++ text: the passes of ``kernels.lanes`` for one robot."""
    width = strand_width(precision)

    return f"""
bool permuted = false;
auto pass = [&](int job, scalar time, bool start, bool last) {{
    {vector_dialect(precision, width)}
    {_ORIGIN}
    {LAW}
    {quad_operations(width)}
    {permutation(precision, width)}
    const int MP = (M + W - 1) / W * W;
    {_MOVE}
    {PERMUTED}
    if (job == 6) permuted = M <= MOST_MASSES && place_masses();
    if (permuted) {{ step_permuted(); return; }}
    {_PASS}
}};
{_JOBS}
"""


_ORIGIN = r"""
real origins_here[3] = {zero + origin[0][0], zero + origin[1][0], zero + origin[2][0]};
wide far_origins_here[3] = {wide_zero + far_origin[0][0], wide_zero + far_origin[1][0],
                            wide_zero + far_origin[2][0]};
real* const origin = origins_here;
wide* const far_origin = far_origins_here;
"""

_JOBS = r"""
auto prepare = [&]() { pass(6, scalar(0), false, false); };
auto begin = [&]() { pass(0, scalar(0), false, false); };
auto end = [&]() { pass(1, scalar(0), false, false); };
auto euler = [&]() { pass(2, dt, false, true); };
auto kick_and_drift = [&](bool shifted, scalar time, bool start, bool last) {
    pass(shifted ? 5 : 3, time, start, last);
};
auto gradient_shift = [&]() { pass(4, scalar(0), false, false); };
"""

_PASS = r"""
typedef scalar quad __attribute__((vector_size(4 * sizeof(scalar))));
const int SP = (S + W - 1) / W * W;
quad* const X = (quad*)scratch.data;
quad* const V = X + MP;
quad* const FQ = V + MP;
quad* const shifted_x = FQ + MP;
quad* const low_X = shifted_x + MP;  // in mixed precision
quad* const low_V = low_X + (MIXED ? MP : 0);
real* const left = (real*)(low_V + (MIXED ? MP : 0));
quad* const D = (quad*)((scalar*)left + (OBSTACLES ? OBSTACLES : 1) * MP);
real* const P = (real*)(D + SP + W);
const int coefficients = ACTUATED ? 4 : 2;
int* const lower = (int*)(P + coefficients * (SP / W));

// Springs that end and that start at each mass, for four masses side by side: entry k of group g,
// mass i, is at 4 (start[g] + k) + i % 4. Lists that are shorter than the longest of their group
// are filled with the spring SP, whose force is zero.
const int G = MP / 4;
int* const ends_start = lower + SP;
int* const starts_start = ends_start + G + 1;
int* const count = starts_start + G + 1;
int* const ends = count + MP;
auto fill_lists = [=]() {
    int* list = ends;
    for (int out = 0; out < 2; ++out) {
        int* const begin = out ? starts_start : ends_start;
        for (int i = 0; i < MP; ++i) count[i] = 0;
        for (int s = 0; s < S; ++s) ++count[out ? lower[s] : partner[s]];
        begin[0] = 0;
        for (int g = 0; g < G; ++g) {
            int longest = 0;
            for (int i = 4 * g; i < 4 * g + 4; ++i)
                longest = count[i] > longest ? count[i] : longest;
            begin[g + 1] = begin[g] + longest;
        }
        for (int e = 0; e < 4 * begin[G]; ++e) list[e] = SP;
        for (int i = 0; i < MP; ++i) count[i] = 0;
        for (int s = 0; s < S; ++s) {
            const int i = out ? lower[s] : partner[s];
            list[4 * (begin[i / 4] + count[i]++) + i % 4] = s;
        }
        if (!out) list += 4 * begin[G];
    }
};

if (job == 6) {
    for (int s = S; s <= SP; ++s) D[s] = quad{};
    // Lane l of a batch is row (l % 4) (W / 4) + l / 4: how the transposed rows lie.
    for (int s = 0; s < SP; s += W)
        for (int l = 0; l < W; ++l) {
            const int from = s + (l % 4) * (W / 4) + l / 4;
            for (int c = 0; c < coefficients; ++c)
                P[s / W * coefficients + c][l] =
                    from < S ? p[coefficients * from + c][0] : scalar(0);
        }
    for (int i = 0; i < M; ++i)
        for (int s = row[i]; s < row[i + 1]; ++s) lower[s] = i;
    fill_lists();
    return;
}
if (job == 0) {
    // A lane that no mass fills stays far above the ground.
    for (int i = 0; i < MP; ++i) {
        const bool full = i < M;
        X[i] = full ? quad{x[i].x[0], x[i].y[0], x[i].z[0], w[i][0]} : quad{0, 0, 1000000, 0};
        V[i] = full ? quad{v[i].x[0], v[i].y[0], v[i].z[0], 0} : quad{};
        if (MIXED) {
            low_X[i] = full ? quad{low_x[i].x[0], low_x[i].y[0], low_x[i].z[0], 0} : quad{};
            low_V[i] = full ? quad{low_v[i].x[0], low_v[i].y[0], low_v[i].z[0], 0} : quad{};
        }
    }
    return;
}
if (job == 1) {
    for (int i = 0; i < M; ++i) {
        x[i].x[0] = X[i][0]; x[i].y[0] = X[i][1]; x[i].z[0] = X[i][2];
        v[i].x[0] = V[i][0]; v[i].y[0] = V[i][1]; v[i].z[0] = V[i][2];
        if (MIXED) {
            low_x[i].x[0] = low_X[i][0]; low_x[i].y[0] = low_X[i][1]; low_x[i].z[0] = low_X[i][2];
            low_v[i].x[0] = low_V[i][0]; low_v[i].y[0] = low_V[i][1]; low_v[i].z[0] = low_V[i][2];
        }
    }
    return;
}

const int* const starts = ends + 4 * ends_start[G];
const quad* const at = job == 5 ? shifted_x : X;
for (int s = 0; s < S; ++s) D[s] = at[partner[s]] - at[lower[s]];
const real si = zero + sine[0], co = zero + cosine[0];
for (int s = 0; s < SP; s += W) {
    real* const d = (real*)(D + s);
    const real* const k = P + s / W * coefficients;
    const real h = ACTUATED ? breathing(k[1], k[2], k[3], si, co) : k[1];
    real dx = d[0], dy = d[1], dz = d[2], pad = d[3];
    transpose(dx, dy, dz, pad);
    const real pull = spring_pull(squared_length(dx, dy, dz), k[0], h);
    d[0] *= spread0(pull); d[1] *= spread1(pull); d[2] *= spread2(pull); d[3] *= spread3(pull);
}
for (int g = 0; g < G; ++g) {
    quad f0 = {}, f1 = {}, f2 = {}, f3 = {};
    for (int e = 4 * ends_start[g]; e < 4 * ends_start[g + 1]; e += 4) {
        f0 -= D[ends[e]]; f1 -= D[ends[e + 1]]; f2 -= D[ends[e + 2]]; f3 -= D[ends[e + 3]];
    }
    for (int e = 4 * starts_start[g]; e < 4 * starts_start[g + 1]; e += 4) {
        f0 += D[starts[e]]; f1 += D[starts[e + 1]]; f2 += D[starts[e + 2]];
        f3 += D[starts[e + 3]];
    }
    FQ[4 * g] = f0; FQ[4 * g + 1] = f1; FQ[4 * g + 2] = f2; FQ[4 * g + 3] = f3;
}
// W masses side by side, and back into quads.
auto load = [=](const quad* from, real& pad) __attribute__((always_inline)) -> Vec {
    const real* const q = (const real*)from;
    Vec a = {q[0], q[1], q[2]};
    pad = q[3];
    transpose(a.x, a.y, a.z, pad);
    return a;
};
auto keep = [=](quad* to, Vec a, real pad) __attribute__((always_inline)) {
    real* const q = (real*)to;
    transpose(a.x, a.y, a.z, pad);
    q[0] = a.x; q[1] = a.y; q[2] = a.z; q[3] = pad;
};
for (int i = 0; i < MP; i += W) {
    real iw, pad;
    const Vec f = load(FQ + i, pad);
    Vec x_here = load(X + i, iw), low_x_here = MIXED ? load(low_X + i, pad) : Vec{};
    Vec v_here = load(V + i, pad), low_v_here = MIXED ? load(low_V + i, pad) : Vec{};
    Vec shifted = job == 5 && WATER ? load(at + i, pad) : Vec{};
    move_row(f, &x_here, &low_x_here, &v_here, &low_v_here, &shifted, 0, iw,
             left + (OBSTACLES ? OBSTACLES : 1) * (i / W));
    if (job == 4) { keep(shifted_x + i, shifted, iw); continue; }
    keep(X + i, x_here, iw);
    keep(V + i, v_here, zero);
    if (MIXED) { keep(low_X + i, low_x_here, zero); keep(low_V + i, low_v_here, zero); }
}
"""

# What the forces f do to row i of masses, which lie side by side.
_MOVE = r"""
auto move_row = [&](Vec f, Vec* xs, Vec* low_xs, Vec* vs, Vec* low_vs, Vec* shifted, int i, real iw,
                    real* left) __attribute__((always_inline)) {
    Sum a = sum_of(xs, low_xs, i);
    Own own = {};
    if (OBSTACLES) own.left_over = left;
    if (job == 4) { shifted[i] = shifted_position(a, f, iw, own); return; }
    Sum u = sum_of(vs, low_vs, i);
    if (EULER) move_mass_euler(a, u, f, iw, 0, own);
    else {
        const Place at_here = job == 5 && WATER ? from_here(shifted[i], a) : in_world(a);
        real rest = CHIN4 && GROUND && last ? *left : zero;
        move_mass(a, u, f, at_here, iw, substeps, rest, time, start, last, 0, own);
        if (CHIN4 && GROUND && !last) *left = rest;
    }
    keep_sum(xs, low_xs, i, a);
    keep_sum(vs, low_vs, i, u);
};
"""
