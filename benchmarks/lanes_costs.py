"""What stepping costs besides stepping: looking at the health, compiling, and a generation."""

import multiprocessing
import tempfile
import time

import numpy as np

import evolve
import warp_springs as ws
from warp_springs.kernels.features import CHECK_EVERY

__all__ = ["compiling", "generation", "health"]

#: Steps from one look at the health to the next, and of the launches that tell what a step takes.
BETWEEN, MANY = CHECK_EVERY, CHECK_EVERY // 2


def health(rounds: int) -> list[dict]:
    """The part of the time that goes into looking at the health of the robots, every 64 steps.

    A launch of one step that looks before it takes longer than one that does not by the price of a
    look, with all that is saved, set anew and transposed for it. They alternate; of each the
    shortest counts, since whatever else the machine does only adds.
    """
    rows = []
    for kind, make in _POPULATIONS.items():
        for precision in ("float32", "mixed", "float64"):
            sim = ws.Simulation(make(), ws.Scene(), 1e-4, precision=precision, threads=1)
            sim.run(sim.dt)
            (piece,) = sim._slices
            launches = (BETWEEN, BETWEEN + 1), (BETWEEN + 1, BETWEEN + 2), (1, 1 + MANY)
            seconds = np.full(len(launches), np.inf)
            for _ in range(100 * rounds):
                for index, (first, last) in enumerate(launches):
                    started = time.perf_counter()
                    piece.advance(first, last)
                    seconds[index] = min(seconds[index], time.perf_counter() - started)
            looking, blind, many = seconds
            step, look = (many - blind) / (MANY - 1), looking - blind
            rows.append(
                {
                    "robots": kind,
                    "precision": precision,
                    "a step, us": 1e6 * step,
                    "a look, us": 1e6 * look,
                    "health, % of stepping": 100.0 * look / (BETWEEN * step),
                }
            )
    return rows


_POPULATIONS = {
    "a lone cube": lambda: [ws.shapes.cube()],
    "256 cubes": lambda: [ws.shapes.cube()] * 256,
    "a lone lattice": lambda: [ws.shapes.lattice(4, 2, 2)],
    "64 lattices": lambda: [ws.shapes.lattice(4, 2, 2)] * 64,
}


def compiling(rounds: int) -> list[dict]:
    """Seconds until a first step: with nothing compiled, and with all of it in the cache."""
    rows = []
    context = multiprocessing.get_context("spawn")
    for robots in ("a lone cube", "256 cubes"):
        for precision in ("float32", "mixed", "float64"):
            with tempfile.TemporaryDirectory() as cache:
                times = []
                for _ in range(2):
                    here, there = context.Pipe()
                    args = (there, cache, robots, precision)
                    worker = context.Process(target=_first_step, args=args)
                    worker.start()
                    times.append(here.recv())
                    worker.join()
            rows.append(
                {
                    "robots": robots,
                    "precision": precision,
                    "first use, s": times[0],
                    "cached, s": times[1],
                }
            )
    return rows


def _first_step(pipe, cache: str, kind: str, precision: str) -> None:
    """Times the first step of a process, Warp's own start apart."""
    import warp as wp

    wp.config.kernel_cache_dir = cache
    ws.quiet()
    scene = ws.Scene(damping=1.0, drag=0.01)
    started = time.perf_counter()
    ws.Simulation(_POPULATIONS[kind](), scene, 1e-4, precision=precision).run(1e-4)
    pipe.send(time.perf_counter() - started)


def generation(rounds: int) -> list[dict]:
    """Milliseconds of a generation: 1,024 walkers of 248 springs for a second in steps of 1 ms."""
    rows = []
    for integrator in ("leapfrog", "chin4"):
        for precision in ("float32", "float64"):
            told = {
                "population": 1024,
                "task": {"settle": 0.5, "measure": 0.5},
                "simulation": {"dt": 1e-3, "precision": precision, "integrator": integrator},
            }
            search = evolve.Search(evolve.load("walker", told))
            search.prepare()
            laps = np.array([_timed_generation(search) for _ in range(rounds)])
            total, stepping, packing, asking = 1e3 * np.median(laps, axis=0)
            rows.append(
                {
                    "integrator": integrator,
                    "precision": precision,
                    "all": total,
                    "stepping": stepping,
                    "packing": packing,
                    "optimizer": asking,
                    "rest": total - stepping - packing - asking,
                    "overhead, %": 100.0 * (1.0 - stepping / total),
                }
            )
    return rows


def _timed_generation(search: "evolve.Search") -> tuple[float, float, float, float]:
    """Seconds of one generation: all, and of it stepping, packing, and the optimizer."""
    spent = dict.fromkeys(("stepping", "packing", "optimizer"), 0.0)

    def timed(kind, method, seconds=None):
        def call(*args, **kwargs):
            started = time.perf_counter()
            result = method(*args, **kwargs)
            spent[kind] += seconds(result) if seconds else time.perf_counter() - started
            return result

        return call

    sim, optimizer = ws.Simulation, search.optimizer
    kept = sim.run, sim.__init__
    sim.run = timed("stepping", sim.run, lambda result: result.wall_time)
    sim.__init__ = timed("packing", sim.__init__)
    optimizer.ask, optimizer.tell = (
        timed("optimizer", method) for method in (optimizer.ask, optimizer.tell)
    )
    started = time.perf_counter()
    try:
        search.step()
    finally:
        sim.run, sim.__init__ = kept
        del optimizer.ask, optimizer.tell
    return time.perf_counter() - started, *spent.values()
