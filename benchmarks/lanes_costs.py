"""What stepping costs besides stepping: looking at the health, compiling, and a generation."""

import multiprocessing
import tempfile
import time

import numpy as np

import evolve
import warp_springs as ws

__all__ = ["compiling", "generation", "health"]

#: No simulation takes so many steps: never.
NEVER = 2**30


def health(rounds: int) -> list[dict]:
    """The part of the time that goes into looking at the health of the robots, every 64 steps.

    Two processes take turns, one of which never looks and never sets its oscillators anew.
    """
    rows = []
    context = multiprocessing.get_context("spawn")
    pipes, workers = [], []
    for every in (None, NEVER):
        here, there = context.Pipe()
        worker = context.Process(target=_step_on_demand, args=(there, every), daemon=True)
        worker.start()
        pipes.append(here)
        workers.append(worker)
    for kind in _POPULATIONS:
        for precision in ("float32", "float64"):
            for pipe in pipes:
                pipe.send((kind, precision))
                pipe.recv()
            seconds = np.zeros((2, 3 * rounds))
            for turn in range(seconds.shape[1]):
                for index, pipe in enumerate(pipes):
                    pipe.send("run")
                    seconds[index, turn] = pipe.recv()
            looking, blind = seconds
            share = 100.0 * float(np.median(looking / blind) - 1.0)
            rows.append({"robots": kind, "precision": precision, "health, % of stepping": share})
    for pipe, worker in zip(pipes, workers, strict=True):
        pipe.send(None)
        worker.join()
    return rows


_POPULATIONS = {
    "a lone cube": lambda: ws.shapes.cube(),
    "256 cubes": lambda: [ws.shapes.cube()] * 256,
    "a lone lattice": lambda: ws.shapes.lattice(4, 2, 2),
    "64 lattices": lambda: [ws.shapes.lattice(4, 2, 2)] * 64,
}


def _step_on_demand(pipe, every: int | None) -> None:
    """A process that times runs of the population it was last told of."""
    ws.quiet()
    if every is not None:
        from warp_springs.kernels import bundle

        bundle.CHECK_EVERY = every
    sim, steps = None, 0
    while (asked := pipe.recv()) is not None:
        if asked == "run":
            pipe.send(sim.run(steps * sim.dt).wall_time)
            continue
        kind, precision = asked
        robots = _POPULATIONS[kind]()
        sim = ws.Simulation(robots, ws.Scene(), 1e-4, precision=precision, threads=1)
        evaluations = sim.run(64 * sim.dt).spring_evaluations / 64
        steps = max(64, round(1e7 / evaluations / 64) * 64)
        pipe.send("ready")


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
