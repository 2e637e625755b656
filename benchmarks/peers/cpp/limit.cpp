// What this processor can do: the same physics, tuned by hand, as the yardstick for everybody else.
//
// - Robots are the lanes of the vectors: W robots of one topology form a group, and a group runs
//   all its steps before the next, so that its state stays in the first-level cache.
// - Springs are sorted into rows by their lower mass, and two rows are worked on at a time: a
//   partner of both is read and written once for two springs, and the two masses stay in registers
//   until their whole force is known; then they are moved at once, because no later row reads them.
// - The length enters by the hardware's estimate of 1 / sqrt and a polynomial (vectors.h).
// - sin(omega t + phase) is split into sin(omega t), cos(omega t), one pair a robot and step,
//   turned by rotation; a spring is left with two multiply-adds.
// - Threads take whole groups. The blocks of two groups are padded apart, so that one core's
//   prefetcher does not fetch lines that the other core writes, and no two fall on the same sets.

#include <cstdlib>
#include <cstring>
#include <vector>

#include "problem.h"
#include "vectors.h"

namespace {

// Two rows of springs, of masses a and a + 1, in the order in which they are worked on.
struct Rows {
    int a;
    bool single;   // the last mass of an odd number has no second row
    bool joined;   // a spring from a to a + 1
    int both;      // partners of both masses, two springs each; then partners of one mass only
    int first, second;
};

// The order of the work, the same for all groups.
struct Plan {
    std::vector<Rows> rows;
    std::vector<int> partners;  // in order
    std::vector<int> springs;   // spring of the problem for each set of coefficients, in order

    explicit Plan(const Problem& p) {
        const int masses = int(p.masses);
        std::vector<std::vector<int>> spring_to(masses, std::vector<int>(masses, -1));
        for (int s = 0; s < p.springs; ++s) {
            const int i = p.ends[2 * s], j = p.ends[2 * s + 1];
            spring_to[i < j ? i : j][i < j ? j : i] = s;
        }
        for (int a = 0; a < masses; a += 2) {
            Rows r = {a, a + 1 == masses, false, 0, 0, 0};
            if (r.single) { rows.push_back(r); break; }
            const std::vector<int>&of_a = spring_to[a], &of_b = spring_to[a + 1];
            if (of_a[a + 1] >= 0) { r.joined = true; springs.push_back(of_a[a + 1]); }
            for (int j = a + 2; j < masses; ++j)
                if (of_a[j] >= 0 && of_b[j] >= 0) {
                    ++r.both;
                    partners.push_back(j);
                    springs.push_back(of_a[j]);
                    springs.push_back(of_b[j]);
                }
            auto alone = [&](const std::vector<int>& mine, const std::vector<int>& other) {
                int count = 0;
                for (int j = a + 2; j < masses; ++j)
                    if (mine[j] >= 0 && other[j] < 0) {
                        ++count;
                        partners.push_back(j);
                        springs.push_back(mine[j]);
                    }
                return count;
            };
            r.first = alone(of_a, of_b);
            r.second = alone(of_b, of_a);
            rows.push_back(r);
        }
    }
};

template <typename V>
struct Vec { V x, y, z; };

template <typename V>
struct Mass { Vec<V> x, v, force; V kick; };  // kick: what a newton adds to the kept velocity

template <typename V>
struct Coefficients { V k, constant, of_sine, of_cosine; };  // tension k - (...) / L, see vectors.h

template <typename Real>
class Simulation {
    using V = typename VectorOf<Real>::type;
    static constexpr int W = sizeof(V) / sizeof(Real);
    static constexpr size_t LINE = 64, APART = 5 * LINE;  // odd, so that groups are skewed

    struct Group {
        Mass<V>* masses;
        Coefficients<V>* springs;
    };

public:
    explicit Simulation(const Problem& p)
        : plan(p), problem(p), groups((p.robots + W - 1) / W), omega(groups.size() * W) {
        const size_t mass_bytes = p.masses * sizeof(Mass<V>) + APART;
        const size_t spring_bytes = plan.springs.size() * sizeof(Coefficients<V>) + APART;
        const size_t bytes = groups.size() * (mass_bytes + spring_bytes);
        arena = static_cast<char*>(std::aligned_alloc(LINE, bytes));
        std::memset(arena, 0, bytes);
        char* at = arena;
        for (size_t g = 0; g < groups.size(); ++g) {
            groups[g] = {reinterpret_cast<Mass<V>*>(at),
                         reinterpret_cast<Coefficients<V>*>(at + mass_bytes)};
            at += mass_bytes + spring_bytes;
            // Lanes left over in the last group repeat the last robot.
            for (int l = 0; l < W; ++l)
                fill(groups[g], l, g * W + l, std::min<int64_t>(g * W + l, p.robots - 1));
        }
        for (int c = 0; c < 3; ++c) fall[c] = Real(p.gravity[c] * p.dt * p.keep);
        dt = Real(p.dt);
        keep = Real(p.keep);
        ground = Real(p.ground);
        static_friction = Real(p.static_friction);
        kinetic_friction = Real(p.kinetic_friction);
        problem = p;
    }
    ~Simulation() { std::free(arena); }
    Simulation(const Simulation&) = delete;

    void run(int64_t steps) {
#pragma omp parallel for num_threads(problem.threads) schedule(static)
        for (size_t g = 0; g < groups.size(); ++g)
            problem.ground > 0 ? advance<true>(g, steps) : advance<false>(g, steps);
        done += steps;
    }

    void positions(double* out) const {
        for (int64_t r = 0; r < problem.robots; ++r)
            for (int64_t i = 0; i < problem.masses; ++i) {
                const Vec<V>& x = groups[r / W].masses[i].x;
                *out++ = x.x[r % W];
                *out++ = x.y[r % W];
                *out++ = x.z[r % W];
            }
    }

private:
    Plan plan;
    Problem problem;
    std::vector<Group> groups;
    std::vector<double> omega;
    char* arena;
    Real fall[3], dt, keep, ground, static_friction, kinetic_friction;
    int64_t done = 0;

    void fill(Group& group, int l, size_t slot, int64_t robot) {
        const Problem& p = problem;
        omega[slot] = p.omega[robot];
        for (int64_t i = 0; i < p.masses; ++i) {
            Mass<V>& m = group.masses[i];
            const double* x = p.positions + 3 * (robot * p.masses + i);
            const double* v = p.velocities + 3 * (robot * p.masses + i);
            m.x.x[l] = Real(x[0]); m.x.y[l] = Real(x[1]); m.x.z[l] = Real(x[2]);
            m.v.x[l] = Real(v[0]); m.v.y[l] = Real(v[1]); m.v.z[l] = Real(v[2]);
            m.kick[l] = Real(p.dt * p.keep / p.mass[robot * p.masses + i]);
        }
        for (size_t n = 0; n < plan.springs.size(); ++n) {
            const int64_t s = robot * p.springs + plan.springs[n];
            const double part = tension_part(Real()) * p.stiffness[s];
            Coefficients<V>& c = group.springs[n];
            c.k[l] = Real(p.stiffness[s]);
            c.constant[l] = Real(part * p.rest[s]);
            c.of_sine[l] = Real(part * p.amplitude[s] * std::cos(p.phase[s]));
            c.of_cosine[l] = Real(part * p.amplitude[s] * std::sin(p.phase[s]));
        }
    }

    // The pull of one spring from a to b: added to the force on a, taken from the force on b.
    static INLINE void pull(const Coefficients<V>& c, V sine, V cosine, const Vec<V>& a, Vec<V>& fa,
                            const Vec<V>& b, Vec<V>& fb) {
        const V dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
        const V q = c.constant + c.of_sine * sine + c.of_cosine * cosine;
        const V f = tension(c.k, q, dx * dx + dy * dy + dz * dz);
        fa.x += f * dx; fa.y += f * dy; fa.z += f * dz;
        fb.x -= f * dx; fb.y -= f * dy; fb.z -= f * dz;
    }

    // The classroom's friction and the push of the ground, on what the forces add to the velocity.
    INLINE void touch(const Mass<V>& m, Vec<V>& v, Vec<V>& added) const {
        const V zero = {};
        const V push = m.x.z * m.kick * -ground, along = root(added.x * added.x + added.y * added.y);
        const auto below = m.x.z < zero, sticks = below & (along < push * static_friction);
        const V rest = (zero + Real(1)) - push * kinetic_friction / along;
        const V left = rest > zero ? rest : zero;
        added.x = sticks ? zero : below ? added.x * left : added.x;
        added.y = sticks ? zero : below ? added.y * left : added.y;
        v.x = sticks ? zero : v.x;
        v.y = sticks ? zero : v.y;
        added.z += below ? push : zero;
    }

    template <bool GROUND>
    INLINE void move(Mass<V>& m, const Vec<V>& force) const {
        Vec<V> v = m.v;
        Vec<V> added = {force.x * m.kick + fall[0], force.y * m.kick + fall[1],
                        force.z * m.kick + fall[2]};
        if (GROUND && negative(m.x.z)) touch(m, v, added);
        m.v = {v.x * keep + added.x, v.y * keep + added.y, v.z * keep + added.z};
        m.x = {m.x.x + m.v.x * dt, m.x.y + m.v.y * dt, m.x.z + m.v.z * dt};
        m.force = Vec<V>{};
    }

    template <bool GROUND>
    void step(const Group& group, V sine, V cosine) const {
        const int* partner = plan.partners.data();
        const Coefficients<V>* c = group.springs;
        Mass<V>* const masses = group.masses;
        for (const Rows& r : plan.rows) {
            Mass<V>&a = masses[r.a], &b = masses[r.single ? r.a : r.a + 1];
            const Vec<V> xa = a.x, xb = b.x;
            Vec<V> fa = a.force, fb = b.force;
            if (r.joined) pull(*c++, sine, cosine, xa, fa, xb, fb);
            for (int n = 0; n < r.both; ++n, c += 2) {
                Mass<V>& m = masses[*partner++];
                const Vec<V> x = m.x;
                Vec<V> f = m.force;
                pull(c[0], sine, cosine, xa, fa, x, f);
                pull(c[1], sine, cosine, xb, fb, x, f);
                m.force = f;
            }
            for (int n = 0; n < r.first; ++n) {
                Mass<V>& m = masses[*partner++];
                pull(*c++, sine, cosine, xa, fa, m.x, m.force);
            }
            for (int n = 0; n < r.second; ++n) {
                Mass<V>& m = masses[*partner++];
                pull(*c++, sine, cosine, xb, fb, m.x, m.force);
            }
            move<GROUND>(a, fa);
            if (!r.single) move<GROUND>(b, fb);
        }
    }

    template <bool GROUND>
    void advance(size_t g, int64_t steps) {
        constexpr int FRESH = 64;  // steps after which the rotated sine is computed anew
        V sine = {}, cosine = {}, turn_sine = {}, turn_cosine = {};
        const double* w = omega.data() + g * W;
        for (int l = 0; l < W; ++l) {
            turn_sine[l] = Real(std::sin(w[l] * problem.dt));
            turn_cosine[l] = Real(std::cos(w[l] * problem.dt));
        }
        for (int64_t n = 0; n < steps; ++n) {
            if (n % FRESH == 0)
                for (int l = 0; l < W; ++l) {
                    const double angle = w[l] * (problem.dt * double(done + n));
                    sine[l] = Real(std::sin(angle));
                    cosine[l] = Real(std::cos(angle));
                }
            step<GROUND>(groups[g], sine, cosine);
            const V s = sine * turn_cosine + cosine * turn_sine;
            cosine = cosine * turn_cosine - sine * turn_sine;
            sine = s;
        }
    }
};

}  // namespace

#include "interface.h"
