"""Springs per second against the program everybody writes first: two kernels a step, atomics.

    python benchmarks/two_kernels.py [--robots 1024] [--precision float64] [--json FILE]

Both step the same robots with the same physics (symplectic Euler, the classroom's friction, ground,
damping, every spring breathing), in turns in one process. The final states must agree before a
speed is printed. The two-kernel program runs on one core, because Warp's own launch uses one.
"""

import argparse
import json
import platform
import time
from pathlib import Path

import numpy as np
import warp as wp
from rich.console import Console
from rich.table import Table

import warp_springs as ws

DT, OMEGA = 1e-4, 2.0 * np.pi
SCENE = ws.Scene(ground=ws.Ground(friction="course"), damping=ws.damping_rate(0.9999, DT))


def population(robots: int, seed: int = 0) -> ws.Variants:
    """Lattices of 4 x 2 x 2 voxels just above the ground, every spring breathing in its phase."""
    body = ws.shapes.lattice(4, 2, 2).moved((0.0, 0.0, 0.0005))
    shape = (robots, body.n_springs)
    return body.variants(
        amplitude=np.broadcast_to(0.1 * body.rest_length, shape),
        phase=np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, shape),
        omega=np.full(robots, OMEGA),
    )


def two_kernels(precision: str):
    """The two kernels, one thread a spring and one thread a mass."""
    real = wp.float64 if precision == "float64" else wp.float32
    vec3 = wp.types.vector(3, real)

    @wp.kernel(module=f"two_kernels_{precision}", enable_backward=False)
    def pull(
        x: wp.array(dtype=vec3),
        ends: wp.array(dtype=wp.vec2i),
        k: wp.array(dtype=real),
        rest: wp.array(dtype=real),
        amplitude: wp.array(dtype=real),
        phase: wp.array(dtype=real),
        angle: real,
        # outputs
        force: wp.array(dtype=vec3),
    ):
        s = wp.tid()
        i, j = ends[s][0], ends[s][1]
        d = x[j] - x[i]
        length = wp.length(d)
        f = d * (k[s] * (length - rest[s] - amplitude[s] * wp.sin(angle + phase[s])) / length)
        wp.atomic_add(force, i, f)
        wp.atomic_sub(force, j, f)

    @wp.kernel(module=f"two_kernels_{precision}", enable_backward=False)
    def move(
        mass: wp.array(dtype=real),
        dt: real,
        keep: real,
        # state
        x: wp.array(dtype=vec3),
        v: wp.array(dtype=vec3),
        force: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        f = force[i] + vec3(real(0.0), real(0.0), real(-9.81) * mass[i])
        u = v[i]
        if x[i][2] < real(0.0):
            normal = real(-1.0e5) * x[i][2]
            along = wp.sqrt(f[0] * f[0] + f[1] * f[1])
            if along < normal:
                f = vec3(real(0.0), real(0.0), f[2])
                u = vec3(real(0.0), real(0.0), u[2])
            else:
                left = wp.max(real(1.0) - real(0.8) * normal / along, real(0.0))
                f = vec3(f[0] * left, f[1] * left, f[2])
            f += vec3(real(0.0), real(0.0), normal)
        u = (u + f * (dt / mass[i])) * keep
        v[i] = u
        x[i] += u * dt
        force[i] = vec3()

    return pull, move, vec3


class TwoKernels:
    """The same population, stepped by the two kernels."""

    def __init__(self, robots: ws.Variants, precision: str) -> None:
        self.pull, self.move, vec3 = two_kernels(precision)
        count, masses = len(robots), robots.body.n_masses

        def device(values: np.ndarray, dtype=None) -> wp.array:
            flat = np.ascontiguousarray(values.reshape(-1, *values.shape[2:]).astype(precision))
            return wp.array(flat, dtype=dtype or wp.dtype_from_numpy(flat.dtype), device="cpu")

        ends = robots.body.springs + masses * np.arange(count)[:, None, None]
        self.ends = wp.array(ends.reshape(-1, 2).astype(np.int32), dtype=wp.vec2i, device="cpu")
        self.springs = [
            device(robots.array(name))
            for name in ("stiffness", "rest_length", "amplitude", "phase")
        ]
        self.mass = device(robots.array("masses"))
        self.x = device(robots.array("positions"), vec3)
        self.v = device(robots.array("velocities"), vec3)
        self.force = wp.zeros_like(self.x)
        self.keep, self.step, self.shape = np.exp(-SCENE.damping * DT), 0, (count, masses, 3)

    def run(self, steps: int) -> float:
        """Step and return the seconds it took."""
        start = time.perf_counter()
        for _ in range(steps):
            inputs = [self.x, self.ends, *self.springs, self.step * DT * OMEGA]
            wp.launch(self.pull, len(self.ends), inputs, [self.force], device="cpu")
            inputs = [self.mass, DT, self.keep, self.x, self.v, self.force]
            wp.launch(self.move, len(self.x), inputs, device="cpu")
            self.step += 1
        return time.perf_counter() - start

    def positions(self) -> np.ndarray:
        """Positions, shape (N, M, 3)."""
        return self.x.numpy().reshape(self.shape)


def measure(robots: int, steps: int, rounds: int, precision: str) -> dict:
    """Validate, then time both in turns; rates are medians over the rounds."""
    many = population(robots)
    ours = ws.Simulation(many, SCENE, DT, precision=precision, integrator="euler")
    theirs = TwoKernels(many, precision)
    check = 500  # 0.05 s: all have landed by then
    result = ours.run(check * DT)
    theirs.run(check)
    difference = np.abs([result.positions(i) for i in range(robots)] - theirs.positions())
    # In float32 a mass near the stick limit may flip a step earlier; the typical one must agree.
    error = float(difference.max() if precision == "float64" else np.median(difference))
    allowed = 1e-10 if precision == "float64" else 1e-6
    if not error < allowed:
        raise SystemExit(f"the final states differ by {error:.1e} m, allowed {allowed:.0e} m")

    evaluations = many.body.n_springs * robots * steps
    rates, peers = [], []
    for _ in range(rounds):
        rates.append(evaluations / ours.run(steps * DT).wall_time)
        peers.append(evaluations / theirs.run(steps))
    return {
        "robots": robots,
        "springs_per_robot": many.body.n_springs,
        "precision": precision,
        "features": "ground, classroom friction, damping, actuation; symplectic Euler, dt 1e-4 s",
        "threads": ours.threads,
        "position_difference_m": error,
        "springs_per_second": float(np.median(rates)),
        "springs_per_second_two_kernels": float(np.median(peers)),
        "ratio": float(np.median(np.divide(rates, peers))),
    }


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=100, help="steps a round")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--precision", choices=("float64", "float32"), nargs="+")
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    args = parser.parse_args()
    ws.quiet()
    rows = [
        measure(args.robots, args.steps, args.rounds, precision)
        for precision in args.precision or ("float64", "float32")
    ]
    table = Table("precision", "two kernels", "warp_springs", "ratio", "states differ by")
    for row in rows:
        table.add_row(
            row["precision"],
            f"{row['springs_per_second_two_kernels'] / 1e6:,.0f} M/s",
            f"{row['springs_per_second'] / 1e6:,.0f} M/s",
            f"{row['ratio']:.1f} x",
            f"{row['position_difference_m']:.0e} m",
        )
    console = Console()
    console.print(
        f"{args.robots} lattices of {rows[0]['springs_per_robot']} springs, springs per second; "
        f"{rows[0]['threads']} threads, {platform.machine()}; {rows[0]['features']}"
    )
    console.print(table)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=2) + "\n")
        console.print(f"wrote {args.json}")


if __name__ == "__main__":
    main()
