// The simulator as a good C++ programmer writes it: one robot at a time, readable, compiled with
// -O3 -march=native, the robots shared out by OpenMP.

#include <cmath>
#include <vector>

#include "problem.h"

namespace {

template <typename Real>
struct Vec {
    Real x = 0, y = 0, z = 0;
    Vec operator+(Vec b) const { return {x + b.x, y + b.y, z + b.z}; }
    Vec operator-(Vec b) const { return {x - b.x, y - b.y, z - b.z}; }
    Vec operator*(Real s) const { return {x * s, y * s, z * s}; }
    void operator+=(Vec b) { *this = *this + b; }
    void operator-=(Vec b) { *this = *this - b; }
};

template <typename Real>
struct Spring {
    int i, j;
    Real stiffness, rest, amplitude, phase;
};

template <typename Real>
struct Mass {
    Vec<Real> position, velocity, force;
    Real mass;
};

template <typename Real>
struct Robot {
    std::vector<Mass<Real>> masses;
    std::vector<Spring<Real>> springs;
    Real omega;
};

template <typename Real>
struct World {
    Vec<Real> gravity;
    Real dt, keep, ground, static_friction, kinetic_friction;
};

template <typename Real>
void pull(Robot<Real>& robot, Real time) {
    for (const Spring<Real>& spring : robot.springs) {
        Mass<Real>&a = robot.masses[spring.i], &b = robot.masses[spring.j];
        const Vec<Real> d = b.position - a.position;
        const Real length = std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
        const Real rest =
            spring.rest + spring.amplitude * std::sin(robot.omega * time + spring.phase);
        const Vec<Real> force = d * (spring.stiffness * (length - rest) / length);
        a.force += force;
        b.force -= force;
    }
}

// The classroom's friction: horizontal force against mu times the normal force.
template <typename Real>
void touch(Mass<Real>& mass, const World<Real>& world) {
    Vec<Real>& f = mass.force;
    const Real normal = -mass.position.z * world.ground;
    const Real along = std::sqrt(f.x * f.x + f.y * f.y);
    if (along < world.static_friction * normal) {
        f.x = f.y = mass.velocity.x = mass.velocity.y = 0;
    } else {
        const Real left = std::max(Real(0), 1 - world.kinetic_friction * normal / along);
        f.x *= left;
        f.y *= left;
    }
    f.z += normal;
}

template <typename Real>
void move(Robot<Real>& robot, const World<Real>& world) {
    for (Mass<Real>& mass : robot.masses) {
        mass.force += world.gravity * mass.mass;
        if (world.ground > 0 && mass.position.z < 0) touch(mass, world);
        mass.velocity += mass.force * (world.dt / mass.mass);
        mass.velocity = mass.velocity * world.keep;
        mass.position += mass.velocity * world.dt;
        mass.force = {};
    }
}

template <typename Real>
class Simulation {
public:
    explicit Simulation(const Problem& p)
        : robots(p.robots), threads(int(p.threads)) {
        world = {{Real(p.gravity[0]), Real(p.gravity[1]), Real(p.gravity[2])},
                 Real(p.dt), Real(p.keep), Real(p.ground),
                 Real(p.static_friction), Real(p.kinetic_friction)};
        dt = p.dt;
        for (int64_t r = 0; r < p.robots; ++r) {
            robots[r].omega = Real(p.omega[r]);
            for (int64_t i = 0; i < p.masses; ++i) {
                const double* x = p.positions + 3 * (r * p.masses + i);
                const double* v = p.velocities + 3 * (r * p.masses + i);
                robots[r].masses.push_back({{Real(x[0]), Real(x[1]), Real(x[2])},
                                            {Real(v[0]), Real(v[1]), Real(v[2])},
                                            {},
                                            Real(p.mass[r * p.masses + i])});
            }
            for (int64_t s = 0; s < p.springs; ++s) {
                const int64_t at = r * p.springs + s;
                robots[r].springs.push_back({p.ends[2 * s], p.ends[2 * s + 1],
                                             Real(p.stiffness[at]), Real(p.rest[at]),
                                             Real(p.amplitude[at]), Real(p.phase[at])});
            }
        }
    }

    void run(int64_t steps) {
#pragma omp parallel for num_threads(threads) schedule(static)
        for (size_t r = 0; r < robots.size(); ++r)
            for (int64_t n = first; n < first + steps; ++n) {
                pull(robots[r], Real(n * dt));
                move(robots[r], world);
            }
        first += steps;
    }

    void positions(double* out) const {
        for (const Robot<Real>& robot : robots)
            for (const Mass<Real>& mass : robot.masses) {
                *out++ = mass.position.x;
                *out++ = mass.position.y;
                *out++ = mass.position.z;
            }
    }

private:
    std::vector<Robot<Real>> robots;
    World<Real> world;
    double dt;
    int threads;
    int64_t first = 0;
};

}  // namespace

#include "interface.h"
