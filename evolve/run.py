"""A run: a folder that holds a configuration, the record of every evaluation, and what they gave.

What was decided lives in two files, `run.toml` and `run.sqlite`; everything else in the folder
can be made again from them. `run.toml` appears whole or not at all and is what makes a folder a
run, so a process may be killed at any moment, even before its first generation.
"""

from __future__ import annotations

import os
import shutil
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evolve.config import RunConfig
from evolve.errors import RunError, StoreError
from evolve.judging.judge import Simulator
from evolve.lock import Lock
from evolve.provenance import decisive, origin
from evolve.record import Timing
from evolve.search import Generation, Search, judge_together
from evolve.store import Store
from evolve.toml import dump, load, parse, validate

__all__ = [
    "Progress",
    "Run",
    "Session",
    "create_seeds",
    "evolve_together",
    "open_all",
]

RECORD = "run.sqlite"
LEFTOVERS = (".draft-*", ".usd-*")
"""What a process that is killed while it draws leaves beside the files of the run."""


@dataclass(frozen=True)
class Progress:
    """How far a run is, after each of its generations."""

    generation: int
    """How many are done."""
    generations: int
    """How many there will be."""
    evaluations: int
    failures: int
    """Evaluations without fitness."""
    best_id: int
    best_fitness: float
    median: float
    """Of the fitness of this generation; NaN when nobody has one."""
    springs_per_second: float
    """Spring evaluations per second of evaluating, over the last generations [1/s]."""
    elapsed: float
    """Since this session began [s]."""
    remaining: float
    """Until the last generation, at the pace of the last generations [s]."""


class Run:
    """The folder of a run."""

    def __init__(self, directory: Path, config: RunConfig) -> None:
        self.directory = directory
        self.config = config

    @property
    def record_path(self) -> Path:
        """Where every evaluation is recorded."""
        return self.directory / RECORD

    @classmethod
    def create(cls, config: RunConfig, directory: Path) -> Run:
        """Make the folder of a new run.

        Raises:
            RunError: There is something in that place already.
            StoreError: Another process is about to start a run there.
        """
        _refuse_occupied(directory)
        directory.mkdir(parents=True, exist_ok=True)
        run = cls(directory, config)
        with run._locked():
            _refuse_occupied(directory)  # another process may have been faster
            run._write_config()
        return run

    @classmethod
    def open(cls, directory: Path) -> Run:
        """Open the folder of a run that was created before.

        Raises:
            RunError: It is not there.
            ConfigError: Its run.toml is no longer a configuration.
            StoreError: Its record has another format.
        """
        path = directory / "run.toml"
        if not directory.is_dir():
            raise RunError(f"there is no folder {directory}")
        if not path.is_file():
            raise RunError(
                f"{directory} holds no run (it has no run.toml); start one with "
                f"evolve run PRESET --out {directory}"
            )
        # Older records come with older configurations; it is the record that cannot be mended.
        Store.check_format(directory / RECORD)
        return cls(directory, load(path))

    def read(self) -> Store:
        """Open the record for reading."""
        return Store.open(self.record_path)

    def change(self, generations: int | None = None, threads: int | None = None) -> None:
        """Change what does not decide any bit of the record: its length, and the cores to use."""
        data = self.config.model_dump()
        if generations is not None:
            data["generations"] = generations
        if threads is not None:
            data["simulation"]["threads"] = threads
        changed = validate(data, str(self.directory / "run.toml"))
        if changed != self.config:
            with self._locked():
                self.config = changed
                self._write_config()

    def evolve(
        self,
        watch: Callable[[Progress], None] = lambda progress: None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> bool:
        """Search from where the record ends to the last generation.

        Args:
            watch: Told how far the run is, before the first step and after each generation.
            should_stop: Asked before each generation.

        Returns:
            Whether the run is complete, rather than stopped.

        Raises:
            StoreError: Another process evolves this run, or its record is not usable.
            RunError: run.toml was changed since the record was begun.
        """
        return evolve_together([self], [watch], should_stop)

    @contextmanager
    def session(self, simulator: Simulator | None = None) -> Iterator[Session]:
        """Within, the search stands where the record ends, and nobody else continues it.

        Raises:
            StoreError, RunError: As `evolve`.
        """
        meta = {"config": dump(self.config), **origin()}
        with self._locked(), Store.create(self.record_path, meta, self.config.descriptors) as store:
            self._check_unchanged(store)
            with suppress(StoreError), self.exporting():
                pass  # entering it tidies up, unless somebody is at work there
            search = Search(self.config, simulator)
            try:
                search.restore(store)
                yield Session(search, store)
            finally:
                search.close()

    @contextmanager
    def exporting(self) -> Iterator[None]:
        """Within, no other process exports this run; what a killed one left is removed.

        A run may be exported while it is evolved.

        Raises:
            StoreError: Another process exports it.
        """
        lock = Lock(self.directory / "export.lock", "exported")
        try:
            for path in sorted(p for pattern in LEFTOVERS for p in self.directory.glob(pattern)):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            yield
        finally:
            lock.release()

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Within, no other process starts, changes or evolves this run."""
        lock = Lock(self.directory / "run.lock")
        try:
            yield
        finally:
            lock.release()

    def _check_unchanged(self, store: Store) -> None:
        """Refuse to continue a record under another configuration."""
        then = decisive(parse(store.meta["config"], str(self.record_path)))
        now = decisive(self.config)
        changes = [
            f"{key} was {then.get(key)!r}, is {now.get(key)!r}"
            for key in sorted(then.keys() | now.keys())
            if then.get(key) != now.get(key)
        ]
        if changes:
            raise RunError(
                f"{self.directory / 'run.toml'} was changed since the run began: "
                f"{'; '.join(changes)}; undo that, or start a new run from it"
            )

    def _write_config(self) -> None:
        """Write run.toml, whole or not at all."""
        made_by = "".join(f"# {key}: {value}\n" for key, value in origin().items())
        text = f"# Repeat this run: evolve run {self.directory / 'run.toml'} --out NEW_FOLDER\n"
        draft = self.directory / "run.toml.draft"
        with draft.open("w", encoding="utf-8") as file:
            file.write(f"{text}{made_by}\n{dump(self.config)}")
            file.flush()
            os.fsync(file.fileno())
        draft.replace(self.directory / "run.toml")


def create_seeds(config: RunConfig, count: int, directory: Path) -> list[Run]:
    """Make the folders of runs from the seed of a configuration and those that follow it.

    Raises:
        RunError, StoreError: As `Run.create`; then none is made.
    """
    seeds = range(config.seed, config.seed + count)
    places = [directory / f"seed-{seed}" for seed in seeds]
    _refuse_occupied(directory)
    return [
        Run.create(config.model_copy(update={"seed": seed}), place)
        for seed, place in zip(seeds, places, strict=True)
    ]


def open_all(directory: Path) -> list[Run]:
    """Open the run in a folder, or those of several seeds in the folders within.

    Raises:
        RunError, ConfigError, StoreError: As `Run.open`.
    """
    if (directory / "run.toml").is_file() or not directory.is_dir():
        return [Run.open(directory)]
    within = [path.parent for path in directory.glob("seed-*/run.toml")]
    if not within:
        return [Run.open(directory)]
    return [Run.open(path) for path in sorted(within, key=lambda p: int(p.name.split("-")[1]))]


class Session:
    """A search, its record, and its pace."""

    def __init__(self, search: Search, store: Store) -> None:
        self.search, self._store, self._clock = search, store, _Clock()

    def start(self) -> Progress:
        """Start the clock; how far the search is."""
        self._clock = _Clock()
        return self._clock.progress(self.search, None)

    def keep(self, generation: Generation, together: int = 1) -> Progress:
        """Record a generation, one of so many that were computed together; how far it is now."""
        self._store.add_generation(
            generation.number,
            generation.candidates,
            generation.blobs,
            generation.scores,
            self.search.state(),
            self._clock.lap(generation, together),
        )
        return self._clock.progress(self.search, generation)


def evolve_together(
    runs: Sequence[Run],
    watches: Sequence[Callable[[Progress], None]],
    should_stop: Callable[[], bool] = lambda: False,
) -> bool:
    """Search in several runs that differ in their seed alone, their generations in one batch.

    The record of each is the same to the bit as if it were alone. Those that are behind, because
    they were killed while the others were recorded, catch up first.

    Args:
        runs: The runs.
        watches: For each: told how far it is, before the first step and after each generation.
        should_stop: Asked before each generation.

    Returns:
        Whether all runs are complete, rather than stopped.

    Raises:
        StoreError, RunError: As `Run.evolve`.
    """
    with ExitStack() as stack:
        sessions: list[Session] = []
        for run in runs:
            # Perturbed trials follow from the seed: then each run needs a simulator of its own.
            shared = sessions and run.config.task.trials.count == 1
            simulator = sessions[0].search.simulator if shared else None
            sessions.append(stack.enter_context(run.session(simulator)))
        for session, watch in zip(sessions, watches, strict=True):
            watch(session.start())
        sessions[0].search.prepare()
        for session in sessions:
            session.start()
        while going := [i for i, session in enumerate(sessions) if not session.search.finished]:
            if should_stop():
                return False
            first = min(sessions[i].search.optimizer.generation for i in going)
            going = [i for i in going if sessions[i].search.optimizer.generation == first]
            searches = [sessions[i].search for i in going]
            together = len({id(search.simulator) for search in searches}) == 1
            generations = (
                judge_together(searches) if together else [search.step() for search in searches]
            )
            for i, generation in zip(going, generations, strict=True):
                watches[i](sessions[i].keep(generation, len(going)))
    return True


class _Clock:
    """Measures the pace of a session over its last generations."""

    def __init__(self) -> None:
        self._started = self._lap = time.perf_counter()
        self._recent: deque[tuple[float, float, int]] = deque(maxlen=8)

    def lap(self, generation: Generation, together: int) -> Timing:
        """Times of the generation that ends now, its share of those computed together.

        Recording the one before counts as driving.
        """
        now = time.perf_counter()
        whole, self._lap = now - self._lap, now
        cost = int(generation.scores.spring_evaluations.sum())
        self._recent.append((whole, generation.scores.wall_time, cost))
        evaluating = generation.scores.wall_time
        return Timing(evaluating, max(whole / together - evaluating, 0.0))

    def progress(self, search: Search, generation: Generation | None) -> Progress:
        """How far the search is after a generation, or before the first."""
        optimizer, total = search.optimizer, search.config.generations
        fitness = [] if generation is None else generation.scores.fitness
        fitness = np.asarray(fitness)[np.isfinite(fitness)]
        whole, evaluating, cost = np.sum(self._recent, axis=0) if self._recent else (np.nan,) * 3
        pace = whole / max(len(self._recent), 1)
        return Progress(
            generation=optimizer.generation,
            generations=total,
            evaluations=optimizer.evaluations,
            failures=optimizer.failures,
            best_id=optimizer.best_id,
            best_fitness=optimizer.best_fitness,
            median=float(np.median(fitness)) if len(fitness) else float("nan"),
            springs_per_second=float(cost / evaluating),
            elapsed=time.perf_counter() - self._started,
            remaining=float(pace * left) if (left := total - optimizer.generation) > 0 else 0.0,
        )


def _refuse_occupied(directory: Path) -> None:
    """Refuse a place that holds more than what a start cut short may have left."""
    if not directory.exists():
        return
    if not directory.is_dir():
        raise RunError(f"{directory} is a file; choose another place with --out")
    names = {path.name for path in directory.iterdir()}
    if "run.toml" in names:
        raise RunError(
            f"{directory} already holds a run; continue it with evolve resume {directory}, "
            "or choose another place with --out"
        )
    if others := sorted(names - {"run.lock", "run.lock-journal", "run.toml.draft"}):
        raise RunError(f"{directory} is not empty ({others[0]}); choose another place with --out")
