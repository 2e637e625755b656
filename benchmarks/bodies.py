"""Ragged generations: what it costs that every robot has a body of its own.

    python benchmarks/bodies.py packing      # built and stepped, all different against all alike
    python benchmarks/bodies.py building     # from genomes to a packed batch, against stepping it
    python benchmarks/bodies.py genomes      # random genomes of every encoding, stepped 100 times

Prints one JSON object a line.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Callable, Sequence

import numpy as np

import warp_springs as ws
from evolve.encodings import ENCODINGS
from evolve.memory import keep_memory

SCENE = ws.Scene(ground=ws.Ground(), damping=4.0)
DT = 1e-3
EVALUATIONS = 3
"""Of each spring in a step of chin4."""
BATCH = 1000
"""Genomes that are stepped together."""


def different(n: int, springs: int, seed: int) -> list[ws.Robot]:
    """Robots of about so many springs, no two of one topology."""
    cls = ENCODINGS["voxels"]
    encoding = cls(None, cls.Settings(cells=(4, 4, 3)))
    found: dict[bytes, ws.Robot] = {}
    for part in itertools.count():
        rng = np.random.Generator(np.random.Philox([seed, part]))
        for robot in encoding.express(encoding.random(512, rng)):
            if abs(robot.n_springs - springs) <= 0.1 * springs:
                found.setdefault(robot.topology, robot)
        if len(found) >= n:
            return list(found.values())[:n]
    raise AssertionError


def rate(robots: Sequence[ws.Robot], duration: float, repeats: int) -> tuple[float, float]:
    """Spring evaluations per second, and seconds to build: the best of some repeats."""
    stepped, built = [], []
    for _ in range(repeats + 1):  # the first loads the kernels
        started = time.perf_counter()
        simulation = ws.Simulation(robots, SCENE, dt=DT, precision="float32")
        built.append(time.perf_counter() - started)
        started = time.perf_counter()
        result = simulation.run(duration)
        stepped.append(result.spring_evaluations / (time.perf_counter() - started))
        assert np.isfinite(result.center_of_mass[np.asarray(result.status) == 0]).all()
    return max(stepped[1:]), min(built[1:])


def packing(options: argparse.Namespace) -> None:
    """Throughput of all different against all alike, and the share of building in a second."""
    robots = different(options.robots, options.springs, 1)
    middle = min(robots, key=lambda robot: abs(robot.n_springs - options.springs))
    steps = 1.0 + 1e-3 * np.arange(len(robots)) / len(robots)
    alike = [middle.replace(stiffness=middle.stiffness * step) for step in steps]
    _validate(robots[:32])
    apart, built = rate(robots, options.duration, options.repeats)
    together, built_alike = rate(alike, options.duration, options.repeats)
    springs = sum(robot.n_springs for robot in robots)
    simulating = springs / DT * EVALUATIONS / apart
    _say(
        what="packing",
        robots=len(robots),
        topologies=len({robot.topology for robot in robots}),
        springs_per_robot=springs / len(robots),
        all_different_springs_per_s=apart,
        one_topology_springs_per_s=together,
        ratio=apart / together,
        build_s=built,
        build_alike_s=built_alike,
        simulating_1_s_takes_s=simulating,
        build_share=built / simulating,
    )


def building(options: argparse.Namespace) -> None:
    """Expressing and packing genomes of different bodies, against a second of the default run."""
    cls = ENCODINGS["voxels"]
    encoding = cls(None, cls.Settings(cells=(4, 4, 3)))
    parts = []
    for part in itertools.count():
        genomes = encoding.random(2048, np.random.Generator(np.random.Philox([1, part])))
        sizes = np.array([robot.n_springs for robot in encoding.express(genomes)])
        near = np.abs(sizes - options.springs) <= 0.1 * options.springs
        parts.append(encoding.take(genomes, np.flatnonzero(near)))
        if sum(map(len, parts)) >= options.robots:
            break
    genomes = encoding.take(encoding.concatenate(parts), np.arange(options.robots))
    found = []
    keep_memory()  # as every search does
    for _ in range(options.repeats):
        started = time.perf_counter()
        robots = encoding.express(genomes)
        expressed = time.perf_counter()
        simulation = ws.Simulation(robots, SCENE)
        found.append((expressed - started, time.perf_counter() - expressed))
    express, pack = (float(np.median(seconds)) for seconds in zip(*found, strict=True))
    simulation.run(DT)
    result = simulation.run(options.duration)
    stepping = result.wall_time / options.duration
    _say(
        what="building",
        robots=len(robots),
        topologies=len({robot.topology for robot in robots}),
        springs_per_robot=float(np.mean([robot.n_springs for robot in robots])),
        springs_per_s=result.spring_evaluations / result.wall_time,
        express_s=express,
        pack_s=pack,
        stepping_1_s_takes_s=stepping,
        building_share=(express + pack) / stepping,
    )


def _validate(robots: Sequence[ws.Robot]) -> None:
    """Robots in a ragged batch end where they end alone, to the bit."""
    together = ws.Simulation(robots, SCENE, dt=DT, precision="float32").run(0.05)
    for i in (0, len(robots) // 2, len(robots) - 1):
        alone = ws.Simulation([robots[i]], SCENE, dt=DT, precision="float32").run(0.05)
        assert np.array_equal(alone.positions(0), together.positions(i)), i


def genomes(options: argparse.Namespace) -> None:
    """Random genomes of every encoding, crossed and mutated, each stepped 100 times.

    Whatever comes of a genome, the run goes on: a robot that is well is where numbers are, and the
    others are counted by what stopped them.
    """
    share = -(-options.genomes // len(ENCODINGS))
    for name in options.encodings or ENCODINGS:
        cls = ENCODINGS[name]
        body = ws.shapes.lattice(2, 1, 1) if cls.needs_body else None
        encoding, started = cls(body, cls.Settings()), time.perf_counter()
        counts, slowest = np.zeros(len(ws.Status), np.int64), 0.0
        for first in range(0, share, BATCH):
            begun = time.perf_counter()
            rng = np.random.Generator(np.random.Philox([7, first]))
            n = min(BATCH, share - first)
            found = encoding.random(n, rng)
            found = encoding.cross(found, encoding.take(found, rng.permutation(n)), rng)
            robots = encoding.express(encoding.mutate(found, rng))
            simulation = ws.Simulation(
                robots, SCENE, dt=DT, precision="float32", threads=options.threads
            )
            result = simulation.run(100 * DT)
            status = np.asarray(result.status)
            assert np.isfinite(result.center_of_mass[status == 0]).all(), (name, first)
            counts += np.bincount(status, minlength=len(counts))
            slowest = max(slowest, time.perf_counter() - begun)
        _say(
            what="genomes",
            encoding=name,
            genomes=int(counts.sum()),
            seconds=time.perf_counter() - started,
            slowest_thousand_s=slowest,
            statuses={ws.Status(i).name: int(n) for i, n in enumerate(counts) if n},
        )


def _say(**row: object) -> None:
    print(json.dumps(row), flush=True)


COMMANDS: dict[str, Callable[[argparse.Namespace], None]] = {
    "packing": packing,
    "building": building,
    "genomes": genomes,
}


def main() -> None:
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=COMMANDS)
    parser.add_argument("--robots", type=int, default=2048)
    parser.add_argument("--springs", type=int, default=300, help="of each robot, about")
    parser.add_argument("--duration", type=float, default=0.1, help="simulated at a time [s]")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--genomes", type=int, default=1_000_000, help="over all encodings")
    parser.add_argument("--encodings", nargs="*", default=(), help="only these; their share each")
    parser.add_argument("--threads", type=int, default=1, help="that step genomes")
    options = parser.parse_args()
    COMMANDS[options.what](options)


if __name__ == "__main__":
    main()
