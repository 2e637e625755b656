"""Taichi: a kernel over springs and one over masses, and robots as SIMD lanes by an expert."""

import numpy as np
import taichi as ti

from peers.lanes import Lanes
from peers.problem import Problem

__all__ = ["PROGRAMS", "TaichiLanes", "TaichiLoops", "versions"]

_started = []
#: Taichi gives a thread no fewer iterations of a loop than these.
LEAST_PART = 512


def start(threads: int) -> None:
    """Start Taichi once a process: it forgets every field when it is started again."""
    if not _started:
        ti.init(
            arch=ti.cpu,
            cpu_max_num_threads=threads,
            default_fp=ti.f64,  # of the constants: what is float32 is cast
            log_level=ti.ERROR,
            offline_cache=False,
        )
        _started.append(threads)


def field(values: np.ndarray, vector: int = 0):
    """A field with these values; with ``vector``, of vectors along the last axis."""
    real = {"float32": ti.f32, "float64": ti.f64, "int32": ti.i32, "uint32": ti.i32}
    dtype = real[values.dtype.name]
    if vector:
        made = ti.Vector.field(vector, dtype, shape=values.shape[:-1])
    else:
        made = ti.field(dtype, shape=values.shape)
    made.from_numpy(values.astype(np.int32) if values.dtype == np.uint32 else values)
    return made


@ti.data_oriented
class TaichiLoops:
    """Two parallel kernels a step, forces by atomic additions."""

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        start(threads)
        self.p, self.steps = problem, 0
        self.real = ti.f32 if precision == "float32" else ti.f64

        def flat(name: str, vector: int = 0):
            values = getattr(problem, name).astype(precision)
            return field(values.reshape((-1, 3) if vector else -1), vector)

        shift = problem.n_masses * np.arange(problem.n_robots, dtype=np.int32)[:, None, None]
        self.ends = field((problem.springs + shift).reshape(-1, 2), 2)
        self.x, self.v = flat("positions", 3), flat("velocities", 3)
        self.f = ti.Vector.field(3, self.real, shape=self.x.shape)
        self.m, self.k, self.rest = flat("masses"), flat("stiffness"), flat("rest_length")
        self.amplitude, self.phase, self.omega = flat("amplitude"), flat("phase"), flat("omega")

    @ti.kernel
    def pull(self, time: ti.f64):
        """Add the pull of every spring to the forces."""
        for s in self.k:
            i, j = self.ends[s][0], self.ends[s][1]
            d = self.x[j] - self.x[i]
            length = d.norm()
            angle = self.omega[s // self.p.n_springs] * ti.cast(time, self.real) + self.phase[s]
            rest = self.rest[s] + self.amplitude[s] * ti.sin(angle)
            force = self.k[s] * (length - rest) / length * d
            self.f[i] += force
            self.f[j] -= force

    @ti.kernel
    def move(self):
        """Move every mass."""
        dt = ti.cast(self.p.dt, self.real)
        for i in self.x:
            f = self.f[i]
            for c in ti.static(range(3)):
                f[c] += self.m[i] * ti.cast(self.p.gravity[c], self.real)
            if ti.static(self.p.ground_stiffness > 0.0):  # noqa: SIM102 (decided when compiled)
                if self.x[i].z < 0:
                    normal = -ti.cast(self.p.ground_stiffness, self.real) * self.x[i].z
                    along = ti.sqrt(f.x * f.x + f.y * f.y)
                    left = ti.cast(0.0, self.real)
                    if along < ti.cast(self.p.static_friction, self.real) * normal:
                        self.v[i].x = 0
                        self.v[i].y = 0
                    else:
                        kinetic = ti.cast(self.p.kinetic_friction, self.real)
                        left = ti.max(left, 1 - kinetic * normal / along)
                    f.x *= left
                    f.y *= left
                    f.z += normal
            self.v[i] = (self.v[i] + f * (dt / self.m[i])) * ti.cast(self.p.keep, self.real)
            self.x[i] += self.v[i] * dt
            self.f[i] = 0

    def run(self, steps: int) -> None:
        """Step all robots."""
        for _ in range(steps):
            self.pull(self.steps * self.p.dt)
            self.move()
            self.steps += 1
        ti.sync()

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self.x.to_numpy().reshape(self.p.positions.shape).astype(np.float64)


@ti.data_oriented
class TaichiLanes:
    """Robots as lanes, springs in rows, the sine split, all steps of a group in one kernel.

    A lane is a component of Taichi's vectors, which LLVM turns into SIMD instructions. Plain sums
    where Taichi's ``+=`` would be an atomic addition.
    """

    bytes = 64

    def __init__(self, problem: Problem, precision: str, threads: int) -> None:
        start(threads)
        self.real = ti.f32 if precision == "float32" else ti.f64
        self.width = self.bytes // np.dtype(precision).itemsize
        self.lanes = lanes = Lanes.of(problem, precision, self.width)
        self.robots, self.steps = problem.n_robots, 0
        self.groups, self.masses = lanes.x.shape[:2]
        self.x, self.v = field(lanes.x, self.width), field(lanes.v, self.width)
        self.f = field(np.zeros_like(lanes.x), self.width)
        self.kick, self.springs = field(lanes.kick, self.width), field(lanes.springs, self.width)
        self.rows, self.partners = field(lanes.rows), field(lanes.partners)
        self.turn, self.wave = field(lanes.turn, self.width), field(lanes.turn, self.width)
        self.dt, self.keep, self.ground, self.static, self.kinetic = map(float, lanes.world)
        self.fall = [float(value) for value in lanes.fall]

    @ti.func
    def pull(self, g, s, i, j, sine, cosine):
        """Add the pull of spring s of a group to the forces on masses i and j."""
        dx = self.x[g, j, 0] - self.x[g, i, 0]
        dy = self.x[g, j, 1] - self.x[g, i, 1]
        dz = self.x[g, j, 2] - self.x[g, i, 2]
        q = self.springs[g, s, 1] + self.springs[g, s, 2] * sine + self.springs[g, s, 3] * cosine
        pull = self.springs[g, s, 0] - q / ti.sqrt(dx * dx + dy * dy + dz * dz)
        self.f[g, i, 0] = self.f[g, i, 0] + pull * dx
        self.f[g, i, 1] = self.f[g, i, 1] + pull * dy
        self.f[g, i, 2] = self.f[g, i, 2] + pull * dz
        self.f[g, j, 0] = self.f[g, j, 0] - pull * dx
        self.f[g, j, 1] = self.f[g, j, 1] - pull * dy
        self.f[g, j, 2] = self.f[g, j, 2] - pull * dz

    @ti.func
    def move(self, g, i):
        """Move mass i of a group, without a branch."""
        dt, keep = ti.cast(self.dt, self.real), ti.cast(self.keep, self.real)
        ground, static = ti.cast(self.ground, self.real), ti.cast(self.static, self.real)
        kinetic, zero = ti.cast(self.kinetic, self.real), ti.cast(0.0, self.real)
        fall = [ti.cast(self.fall[c], self.real) for c in ti.static(range(3))]
        weight = self.kick[g, i]
        ax = self.f[g, i, 0] * weight + fall[0]
        ay = self.f[g, i, 1] * weight + fall[1]
        az = self.f[g, i, 2] * weight + fall[2]
        push = ground * weight * ti.max(-self.x[g, i, 2], zero)
        along = ti.sqrt(ax * ax + ay * ay)
        sticks = along < static * push
        left = ti.max(1 - kinetic * push / ti.max(along, ti.cast(1e-30, self.real)), zero)
        left = ti.select(sticks, left * 0, left)
        hold = ti.select(sticks, left * 0, left * 0 + keep)
        vx = self.v[g, i, 0] * hold + ax * left
        vy = self.v[g, i, 1] * hold + ay * left
        vz = self.v[g, i, 2] * keep + az + push
        self.v[g, i, 0], self.v[g, i, 1], self.v[g, i, 2] = vx, vy, vz
        self.x[g, i, 0] = self.x[g, i, 0] + vx * dt
        self.x[g, i, 1] = self.x[g, i, 1] + vy * dt
        self.x[g, i, 2] = self.x[g, i, 2] + vz * dt
        for c in ti.static(range(3)):
            self.f[g, i, c] = 0

    @ti.kernel
    def advance(self, steps: ti.i32):
        """Step all groups."""
        for n in range(self.groups * LEAST_PART):
            if n % LEAST_PART == 0:
                self.group(n // LEAST_PART, steps)

    @ti.func
    def group(self, g, steps):
        """Step one group."""
        for _ in range(steps):
            sine, cosine = self.wave[g, 0], self.wave[g, 1]
            for i in range(self.masses):
                for s in range(self.rows[i], self.rows[i + 1]):
                    self.pull(g, s, i, self.partners[s], sine, cosine)
                self.move(g, i)
            self.wave[g, 0] = sine * self.turn[g, 1] + cosine * self.turn[g, 0]
            self.wave[g, 1] = cosine * self.turn[g, 1] - sine * self.turn[g, 0]

    def run(self, steps: int) -> None:
        """Step all robots."""
        self.wave.from_numpy(self.lanes.wave(self.steps))
        self.advance(steps)
        ti.sync()
        self.steps += steps

    def positions(self) -> np.ndarray:
        """Positions [m], shape (N, M, 3)."""
        return self.lanes.robots_first(self.x.to_numpy(), self.robots)


PROGRAMS = {"Taichi": TaichiLoops, "Taichi lanes": TaichiLanes}


def versions() -> dict[str, str]:
    """The version of Taichi."""
    return {"taichi": ".".join(map(str, ti.__version__))}
