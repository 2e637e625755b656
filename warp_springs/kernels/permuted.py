"""One robot whose masses are the lanes and fit a few registers: partners by permutation.

The masses lie in rows of W, those with the most springs first, so that those of a row have about as
many; of as many springs the lowest last, so that few rows touch the ground. Each spring is looked
at from both of its ends: the masses of a row go through their springs side by side, and find the
other ends with a permutation of the registers that hold all positions. So nothing is gathered from
memory, nothing is scattered, and no force is added to the sum of another mass. A mass sees its
partners in the order of the masses, as a bundle adds them; f d and f (-d) are the same but for the
sign, so a robot's bits are those of ``kernels.lanes``, wherever its masses lie.
"""

from warp_springs.kernels.buffers import real_dtype

__all__ = ["PERMUTED", "permutation", "permuted_scratch"]

#: Bytes of the registers that are permuted, and registers that one permutation looks into.
REGISTER, AT_ONCE = 64, 2
#: The most masses that fit: as many as lie in eight registers for each coordinate.
MOST_MASSES = {"float32": 128, "float64": 64}


def permuted_scratch(masses: int, springs: int, width: int, surfaces: int) -> int:
    """Scratch values for a robot of so many masses, padded to rows, and springs."""
    rows = masses // width + 2
    return (17 + surfaces) * rows * width + 5 * _entries(springs, width) + 4 * masses + 64


def _entries(springs: int, width: int) -> int:
    """Ends of springs that there is room for: lists shorter than the longest of a row are padded.

    A body with a mass of so many springs that this is not enough is left to the quads.
    """
    return 4 * springs + 32 * width


def permutation(precision: str, width: int) -> str:
    """C++ text: ``permute(a, b, places)``, each lane from one of two registers, and who may."""
    name = real_dtype(precision).name
    whole = width * real_dtype(precision).itemsize == REGISTER
    builtin, number, place = {
        "float32": ("vpermi2varps512", "float", "int"),
        "float64": ("vpermi2varpd512", "double", "long long"),
    }[name]
    bits = (AT_ONCE * width).bit_length() - 1
    wanted = f"const int PLACE_BITS = {bits}, MOST_ENTRIES_OF_ROWS = {32 * width};\n"
    if not whole:
        return wanted + _LANE_BY_LANE
    return f"""
    {wanted}
    #if defined(__AVX512F__)
    const int MOST_MASSES = {MOST_MASSES[name]};
    auto permute = [](real a, real b, mask places) __attribute__((always_inline)) -> real {{
        typedef {number} numbers __attribute__((vector_size({REGISTER})));
        typedef {place} whole __attribute__((vector_size({REGISTER})));
        return (real)__builtin_ia32_{builtin}((numbers)a, (whole)places, (numbers)b);
    }};
    #else
    {_LANE_BY_LANE}
    #endif
    """


# Without such an instruction no robot is stepped so.
_LANE_BY_LANE = r"""
const int MOST_MASSES = 0;
auto permute = [](real a, real, mask) -> real { return a; };
"""

PERMUTED = r"""
const int R = MP / W;
// Positions and so on, a row of W masses each; one row more, for registers come in pairs.
Vec* const PX = (Vec*)scratch.data;
Vec* const PV = PX + R + 1;
Vec* const PF = PV + R + 1;
Vec* const shifted_PX = PF + R + 1;
Vec* const low_PX = shifted_PX + R + 1;
Vec* const low_PV = low_PX + (MIXED ? R : 0);
real* const PW = (real*)(low_PV + (MIXED ? R : 0));
real* const row_left = PW + R;
mask* const places = (mask*)(row_left + (OBSTACLES ? OBSTACLES : 1) * R);
const int most_entries = 4 * S + MOST_ENTRIES_OF_ROWS;
real* const listed = (real*)(places + most_entries / W);  // coefficients of each place
int* const first_entry = (int*)(listed + (ACTUATED ? 4 : 2) * (most_entries / W));
int* const place_of = first_entry + R + 1;  // of each mass
int* const found = place_of + 2 * M;
const int COEFFICIENTS = ACTUATED ? 4 : 2;

// Masses by their number of springs and their height; whether there is room for their lists.
auto place_masses = [=]() -> bool {
    int* const order = place_of + M;
    for (int i = 0; i < M; ++i) found[i] = row[i + 1] - row[i];
    for (int s = 0; s < S; ++s) ++found[partner[s]];
    int entries = 0;
    for (int i = 0; i < M; ++i) {
        int at = i;
        for (; at > 0; --at) {
            const int before = order[at - 1];
            if (found[before] > found[i]) break;
            if (found[before] == found[i] && !(x[before].z[0] < x[i].z[0])) break;
            order[at] = before;
        }
        order[at] = i;
    }
    for (int at = 0; at < M; ++at) {
        place_of[order[at]] = at;
        if (at % W == 0) { first_entry[at / W] = entries; entries += found[order[at]]; }
    }
    first_entry[R] = entries;
    return entries <= most_entries / W;
};
auto list_partners = [=]() {
    for (int r = 0; r < R; ++r)
        for (int e = first_entry[r]; e < first_entry[r + 1]; ++e) {
            for (int l = 0; l < W; ++l) places[e][l] = r * W + l;  // itself, without a pull
            for (int c = 0; c < COEFFICIENTS; ++c) listed[COEFFICIENTS * e + c] = zero;
        }
    for (int i = 0; i < M; ++i) found[i] = 0;
    auto enter = [=](int i, int other, int s) {
        const int at = place_of[i], e = first_entry[at / W] + found[i]++;
        places[e][at % W] = place_of[other];
        for (int c = 0; c < COEFFICIENTS; ++c)
            listed[COEFFICIENTS * e + c][at % W] = p[COEFFICIENTS * s + c][0];
    };
    for (int i = 0; i < M; ++i)
        for (int s = row[i]; s < row[i + 1]; ++s) enter(partner[s], i, s);
    for (int i = 0; i < M; ++i)
        for (int s = row[i]; s < row[i + 1]; ++s) enter(i, partner[s], s);
};
// The forces on all masses where they are at `where`, with a number of pairs of registers.
auto permuted_forces = [=](const Vec* where, auto pairs) __attribute__((always_inline)) {
    const int most = pairs.most;
    Vec t[2 * pairs.most];
    for (int n = 0; n < 2 * most; ++n) t[n] = where[n < R ? n : 0];
    const real si = zero + sine[0], co = zero + cosine[0];
    for (int r = 0; r < R; ++r) {
        const Vec a = where[r];
        Vec f = {zero, zero, zero};
        for (int e = first_entry[r]; e < first_entry[r + 1]; ++e) {
            const mask at = places[e];
            Vec b = {permute(t[0].x, t[1].x, at), permute(t[0].y, t[1].y, at),
                     permute(t[0].z, t[1].z, at)};
            for (int n = 1; n < most; ++n) {
                const mask here = most == 2 ? (at & (2 * W)) != 0 : (at >> PLACE_BITS) == n;
                const Vec one = t[2 * n], other = t[2 * n + 1];
                b.x = select(here, permute(one.x, other.x, at), b.x);
                b.y = select(here, permute(one.y, other.y, at), b.y);
                b.z = select(here, permute(one.z, other.z, at), b.z);
            }
            const Vec d = b - a;
            const real* const k = listed + COEFFICIENTS * e;
            const real h = ACTUATED ? breathing(k[1], k[2], k[3], si, co) : k[1];
            const real pull = spring_pull(squared_length(d.x, d.y, d.z), k[0], h);
            f = f + scaled(d, pull);
        }
        PF[r] = f;
    }
};
auto step_permuted = [&]() {
    if (job == 6) { list_partners(); return; }
    if (job == 0) {
        // A lane that no mass fills stays far above the ground.
        for (int r = 0; r < R + 1; ++r) {
            PX[r] = shifted_PX[r] = Vec{zero, zero, zero + scalar(1000000)};
            PV[r] = Vec{};
        }
        for (int r = 0; r < R; ++r) PW[r] = zero;
        for (int r = 0; MIXED && r < R; ++r) low_PX[r] = low_PV[r] = Vec{};
        for (int i = 0; i < M; ++i) {
            const int r = place_of[i] / W, l = place_of[i] % W;
            PX[r].x[l] = x[i].x[0]; PX[r].y[l] = x[i].y[0]; PX[r].z[l] = x[i].z[0];
            PV[r].x[l] = v[i].x[0]; PV[r].y[l] = v[i].y[0]; PV[r].z[l] = v[i].z[0];
            PW[r][l] = w[i][0];
            if (!MIXED) continue;
            low_PX[r].x[l] = low_x[i].x[0]; low_PX[r].y[l] = low_x[i].y[0];
            low_PX[r].z[l] = low_x[i].z[0]; low_PV[r].x[l] = low_v[i].x[0];
            low_PV[r].y[l] = low_v[i].y[0]; low_PV[r].z[l] = low_v[i].z[0];
        }
        return;
    }
    if (job == 1) {
        for (int i = 0; i < M; ++i) {
            const int r = place_of[i] / W, l = place_of[i] % W;
            x[i].x[0] = PX[r].x[l]; x[i].y[0] = PX[r].y[l]; x[i].z[0] = PX[r].z[l];
            v[i].x[0] = PV[r].x[l]; v[i].y[0] = PV[r].y[l]; v[i].z[0] = PV[r].z[l];
            if (!MIXED) continue;
            low_x[i].x[0] = low_PX[r].x[l]; low_x[i].y[0] = low_PX[r].y[l];
            low_x[i].z[0] = low_PX[r].z[l]; low_v[i].x[0] = low_PV[r].x[l];
            low_v[i].y[0] = low_PV[r].y[l]; low_v[i].z[0] = low_PV[r].z[l];
        }
        return;
    }
    const Vec* const where = job == 5 ? shifted_PX : PX;
    struct Two { enum { most = 1 }; };
    struct Four { enum { most = 2 }; };
    struct Six { enum { most = 3 }; };
    struct Eight { enum { most = 4 }; };
    if (R <= 2) permuted_forces(where, Two());
    else if (R <= 4) permuted_forces(where, Four());
    else if (R <= 6) permuted_forces(where, Six());
    else permuted_forces(where, Eight());
    for (int r = 0; r < R; ++r)
        move_row(PF[r], PX, low_PX, PV, low_PV, shifted_PX, r, PW[r],
                 row_left + (OBSTACLES ? OBSTACLES : 1) * r);
};
"""
