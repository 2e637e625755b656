"""Closed loops: one thread reads the sensors of one controller, computes its network and sets the
rest lengths of its muscles, between two steps and for every layout. Between two readings it lets
the muscles follow: each activation comes nearer to its signal, and each rest length is that of the
mean activation until the next change.

It reads what a look writes, which is the same for all layouts, and writes the coefficient
``h = k L0 / 2`` of each muscle wherever its layout keeps it. All arithmetic is in float64 and in an
order that depends on the controller alone.
"""

import functools

import numpy as np
import warp as wp

from warp_springs.kernels.buffers import array_struct, real_dtype, real_type, wide_dtype
from warp_springs.kernels.dialect import scalar_dialect
from warp_springs.kernels.features import CHECK_EVERY, Features, feature_flags
from warp_springs.kernels.law import CONSTANTS, LAW
from warp_springs.sensors import KINDS

__all__ = ["BRAIN", "SENSOR", "control", "control_struct"]

#: Columns of the table of controllers. Offsets count elements of the arrays of ``TABLES``.
BRAIN = (
    "place",  # where its robot's positions start in what is seen
    "width",  # and their stride
    "lane",  # its robot's place where what is seen has one value a robot
    "masses",
    "frame",  # [3][masses]
    "sensor",  # its first, and how many
    "sensors",
    "readings",
    "hidden",
    "recurrent",
    "outputs",
    "weight",
    "memory",  # hidden neurons, room for the next ones, and for what grows
    "reading",
    "signal",
    "muscle",  # its first, and how many
    "muscles",
    "activation",  # two for each output: what muscles do of it, now and on average until the next
    "growth",  # -1: its outputs do not grow
)
#: Columns of the table of sensors: kind, first entry of the list of what it sits on, how many.
SENSOR = ("kind", "first", "count")

#: The arrays of all controllers of a piece.
TABLES = {
    "brains": np.int64,
    "sensors": np.int64,
    "places": np.float64,  # of each sensor: place, motion, full
    "sites": np.int64,  # masses, or both ends of springs, two entries for each
    "lengths": np.float64,  # of each site: rest length of the spring, m
    "frames": np.float64,
    "weights": np.float64,
    "muscles": np.int64,  # both outputs, and where its h is kept (each the same twice where one)
    "strengths": np.float64,  # h at an output of 0, and what an output of 1 adds, N
    "growths": np.float64,  # what an output of 1 adds at a reading, limit, budget
    "constants": np.float64,  # of the scene, see kernels.law
    "obstacles": np.float64,
    "heights": np.float64,
    # what a controller changes
    "memories": np.float64,
    "readings": np.float64,
    "signals": np.float64,  # outputs, or what has grown
    "activations": np.float64,  # what the muscles do of a signal
}

_BRAIN = r"""
const int64_t* const brain = tables.brains.data + BRAIN_COLUMNS * (int64_t)index;
if (states.data[brain[2]] != 0) return;  // a robot that was stopped
const int64_t hidden = brain[8], outputs = brain[10];
double* const signal = tables.signals.data + brain[14];
"""

_SENSE = r"""
const int64_t place = brain[0], stride = brain[1], masses = brain[3];
auto component = [&](const shown* of, int64_t i, int c) -> double {
    return double(of[place + (3 * i + c) * stride]);
};
auto mass_at = [&](int64_t i) -> Vec {
    const shown* const x = positions.data;
    return Vec{component(x, i, 0), component(x, i, 1), component(x, i, 2)};
};
const double* const frame = tables.frames.data + brain[4];
Vec center = {}, moving = {}, forward = {}, left = {};
const Vec first = mass_at(0);
for (int64_t i = 0; i < masses; ++i) {
    const Vec x = mass_at(i) - first;
    const shown* const v = velocities.data;
    const Vec u = {component(v, i, 0), component(v, i, 1), component(v, i, 2)};
    center = center + scaled(x, frame[i]);
    moving = moving + scaled(u, frame[i]);
    forward = forward + scaled(x, frame[masses + i]);
    left = left + scaled(x, frame[2 * masses + i]);
}
center = center + first;
auto unit_or = [&](Vec a, Vec instead) -> Vec {
    const double size = ::sqrt(dot(a, a));
    return size > 1e-9 ? scaled(a, 1.0 / size) : instead;
};
auto cross = [](Vec a, Vec b) -> Vec {
    return Vec{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
};
forward = unit_or(forward, Vec{1, 0, 0});
left = left - scaled(forward, dot(left, forward));
left = unit_or(left, unit_or(cross(Vec{0, 0, 1}, forward), Vec{0, 1, 0}));  // a rod has no left
const Vec up = cross(forward, left);

const Own own = {};
auto pressure = [&](Vec x, bool& touching) -> double {
    double sum = 0.0;
    if (GROUND) {
        touching = x.z <= 0.0;
        sum = ground_force(x.z, own);
    }
    for (int k = 0; k < OBSTACLES; ++k) {
        const double* const o = obstacles + RECORD * k;
        const double gap = touch(o, x).gap;
        touching = touching || gap <= 0.0;
        sum += surface_force(gap, contact_stiffness(own, o[1]));
    }
    return sum;
};

double* const reading = tables.readings.data + brain[13];
int64_t filled = 0;
auto read = [&](double value) { reading[filled++] = value; };
for (int64_t s = brain[5]; s < brain[5] + brain[6]; ++s) {
    const int64_t* const sensor = tables.sensors.data + SENSOR_COLUMNS * s;
    const double* const where = tables.places.data + 7 * s;
    const double full = where[6];
    const Vec target = {where[0] + where[3] * now, where[1] + where[4] * now,
                        where[2] + where[5] * now};
    for (int64_t e = sensor[1]; e < sensor[1] + sensor[2]; ++e) {
        const Vec x = mass_at(tables.sites.data[2 * e]);
        bool touching = false;
        if (sensor[0] == CONTACT_SENSOR) {
            pressure(x, touching);
            read(touching ? 1.0 : 0.0);
        } else if (sensor[0] == FORCE_SENSOR) {
            read(pressure(x, touching) / full);
        } else if (sensor[0] == LENGTH_SENSOR) {
            const Vec d = mass_at(tables.sites.data[2 * e + 1]) - x;
            const double length = ::sqrt(dot(d, d)), rest = tables.lengths.data[e];
            read((rest > 0.0 ? length / rest - 1.0 : length) / full);
        } else {
            const Vec d = target - x;
            read(1.0 / (1.0 + dot(d, d) / (full * full)));
        }
    }
    if (sensor[0] == VELOCITY_SENSOR) {
        read(dot(moving, forward) / full);
        read(dot(moving, left) / full);
        read(dot(moving, up) / full);
    } else if (sensor[0] == TILT_SENSOR) {
        read(forward.z);
        read(left.z);
    } else if (sensor[0] == GOAL_SENSOR) {
        const Vec way = {target.x - center.x, target.y - center.y, 0.0};
        const Vec ahead = unit_or(Vec{forward.x, forward.y, 0.0}, Vec{1, 0, 0});
        const double distance = ::sqrt(dot(way, way));
        const Vec there = unit_or(way, Vec{0, 0, 0});
        read(distance / full);
        read(dot(ahead, there));
        read(cross(ahead, there).z);
    } else if (sensor[0] == CLOCK_SENSOR) {
        const double turns = now / full, angle = 6.283185307179586 * (turns - ::floor(turns));
        read(::sin(angle));
        read(::cos(angle));
    }
}
"""

_THINK = r"""
const double* weight = tables.weights.data + brain[11];
double* const memory = tables.memories.data + brain[12];
double* const next = memory + hidden;
auto weighed = [&](const double* from, int64_t count) -> double {
    double sum = 0.0;
    for (int64_t i = 0; i < count; ++i) sum += *weight++ * from[i];
    return sum;
};
for (int64_t j = 0; j < hidden; ++j) {
    double sum = weighed(reading, filled);
    if (brain[9]) sum += weighed(memory, hidden);
    next[j] = ::tanh(sum + *weight++);
}
for (int64_t j = 0; j < hidden; ++j) memory[j] = next[j];
// Where they grow, what they ask for goes aside first, for the material may not suffice.
const double* const growth = tables.growths.data + brain[18];
const bool growing = brain[18] >= 0;
double* const asked = memory + 2 * hidden;
double wanted = 0.0, used = 0.0;
for (int64_t j = 0; j < outputs; ++j) {
    const double sum = hidden ? weighed(memory, hidden) : weighed(reading, filled);
    const double output = ::tanh(sum + *weight++);
    if (!growing) {
        signal[j] = output;
        continue;
    }
    const double more = output > 0.0 ? growth[0] * output : 0.0, room = growth[1] - signal[j];
    asked[j] = more < room ? more : room;
    wanted += asked[j];
    used += signal[j];
}
if (growing && wanted > 0.0) {
    const double left_over = growth[2] > used ? growth[2] - used : 0.0;
    const double part = wanted > left_over ? left_over / wanted : 1.0;
    for (int64_t j = 0; j < outputs; ++j) signal[j] += part * asked[j];
}
"""

_FOLLOW = r"""
double* const activation = tables.activations.data + brain[17];
double* const average = activation + outputs;
for (int64_t j = 0; j < outputs; ++j) {
    const double lag = activation[j] - signal[j];
    average[j] = signal[j] + mean * lag;
    activation[j] = signal[j] + left * lag;
}
for (int64_t m = brain[15]; m < brain[15] + brain[16]; ++m) {
    const int64_t* const muscle = tables.muscles.data + 4 * m;
    const double* const strength = tables.strengths.data + 2 * m;
    const double a = 0.5 * (average[muscle[0]] + average[muscle[1]]);
    const double h = strength[0] + strength[1] * a;
    coefficients.data[muscle[2]] = coefficients.data[muscle[3]] = (coefficient)h;
}
"""


def _text(precision: str, ground: bool, obstacles: int) -> str:
    """The dialect, the law of surfaces, and the work of one controller."""
    flags = feature_flags(
        Features(
            precision="float64",
            width=1,
            actuated=False,
            ground=ground,
            friction="none",
            damping=False,
            drag=False,
            integrator="euler",
            obstacles=obstacles,
        )
    )
    lines = [
        f"const scalar {name} = tables.constants.data[{i}];" for i, name in enumerate(CONSTANTS)
    ]
    lines += [f"const int {kind.upper()}_SENSOR = {i};" for i, kind in enumerate(KINDS)]
    lines += [f"const int BRAIN_COLUMNS = {len(BRAIN)}, SENSOR_COLUMNS = {len(SENSOR)};"]
    lines += [f"const int CHECK_EVERY = {CHECK_EVERY};"]
    lines += ["const double* const obstacles = tables.obstacles.data;"]
    lines += ["const double* const heights = tables.heights.data;"]
    lines += ["real origins_here[3] = {}; real* const origin = origins_here;"]
    # What a look saw, and the coefficients, are of the run's precision.
    real = "double" if real_dtype(precision).itemsize == 8 else "float"
    seen = "double" if wide_dtype(precision).itemsize == 8 else "float"
    lines += [f"typedef {real} coefficient; typedef {seen} shown;"]
    work = f"{_BRAIN}if (reads) {{{_SENSE}{_THINK}}}{_FOLLOW}"
    return scalar_dialect("float64") + flags + "\n".join(lines) + LAW + work


@functools.cache
def control_struct() -> type:
    """The struct of the arrays of controllers."""
    return array_struct("Control", {name: np.dtype(kind) for name, kind in TABLES.items()})


@functools.cache
def control(precision: str, ground: bool, obstacles: int) -> wp.Kernel:
    """The kernel of all controllers of a piece; the first use of one compiles it."""
    Tables, real = control_struct(), real_type(precision)
    wide = wp.dtype_from_numpy(wide_dtype(precision))
    name = f"warp_springs_control_{precision}_{int(ground)}_{obstacles}"
    module = wp.get_module(name)
    wp.set_module_options({"enable_backward": False}, module)

    @wp.func_native(_text(precision, ground, obstacles))
    def work(
        tables: Tables,
        positions: wp.array(dtype=wide),
        velocities: wp.array(dtype=wide),
        states: wp.array(dtype=wp.int32),
        coefficients: wp.array(dtype=real),
        now: wp.float64,
        reads: wp.bool,
        left: wp.float64,
        mean: wp.float64,
        index: int,
    ): ...

    @wp.kernel(module=module)
    def set_muscles(
        tables: Tables,
        positions: wp.array(dtype=wide),
        velocities: wp.array(dtype=wide),
        states: wp.array(dtype=wp.int32),
        now: wp.float64,
        reads: wp.bool,
        left: wp.float64,
        mean: wp.float64,
        # outputs
        coefficients: wp.array(dtype=real),
    ):
        i = wp.tid()
        work(tables, positions, velocities, states, coefficients, now, reads, left, mean, i)

    return set_muscles
