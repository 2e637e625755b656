"""Slices of a batch: what one thread steps at a time, and what it records on the way."""

from __future__ import annotations

import copy
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, field, replace

import numpy as np
import warp as wp

from warp_springs.batch import Batch, Group, Slots
from warp_springs.engine.audit import AUDIT_EVERY, Audit, flow_places
from warp_springs.engine.buffers import aligned
from warp_springs.engine.control import Pilot, Reach
from warp_springs.engine.crew import crew
from warp_springs.engine.crowd import Crowd, crowds
from warp_springs.engine.ranks import Ranks
from warp_springs.engine.reel import Reel
from warp_springs.kernels.buffers import ACCOUNTS, BUNDLE, ENERGIES, real_dtype, structs
from warp_springs.kernels.lanes import kernels, scratch_size

__all__ = ["Slice", "Tape", "cut", "run_all"]

#: Slices a thread, so that a thread that is done early takes over work of another.
SLICES_PER_THREAD = 4
#: Spring evaluations of one launch: about a fifth of a second, so that Ctrl-C is answered.
LAUNCH_WORK = 1e8
#: Values between the scratch blocks of two slices: threads then never share a cache line.
SCRATCH_GAP = 256
#: No robots.
NOBODY = np.zeros(0, np.int64)


def cut(
    batch: Batch, buffers: Mapping[str, np.ndarray], threads: int, device: wp.Device
) -> list[Slice | Crowd]:
    """Cut the groups of a batch into slices of about equal work, or into crowds."""
    springs, masses, division = (
        batch.bundles[:, BUNDLE.index(name)] for name in ("springs", "masses", "division")
    )
    work = (springs + 2 * masses) * division
    pieces = SLICES_PER_THREAD * threads if threads > 1 else 1
    target = work.sum() / pieces
    slices, filled = [], {}
    for group in batch.groups:
        if group.layout != "lanes":
            slices += crowds(group, batch, buffers, device, threads)
            continue
        here = np.s_[group.first : group.first + group.count]
        total = np.cumsum(work[here])
        inner = np.searchsorted(total, np.arange(target, total[-1], target)) + 1
        edges = np.unique([0, *inner[inner < group.count], group.count]) + group.first
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            load = int(work[first:last].sum()) * group.features.width
            largest = (int(masses[first:last].max()), int(springs[first:last].max()))
            if not filled:
                kinds = structs(group.features.precision)
                filled = {kind.key.lower(): _filled(kind, buffers) for kind in kinds}
            like = slices[-1] if first > group.first else None
            slices.append(Slice(group, first, last, load, largest, buffers, filled, like))
    return slices


class Slice:
    """Bundles ``first`` to ``last - 1`` of one group, with scratch memory of their own.

    Launches are recorded when the slice is made, on one thread, which also loads the modules
    (loading is not safe on several); threads only launch them. Those of a slice of the same group,
    ``like``, are copied: to convert every argument again takes longer.
    """

    launch_work, gang, place = LAUNCH_WORK, False, "cpu"

    def __init__(
        self,
        group: Group,
        first: int,
        last: int,
        work: int,
        largest: tuple[int, int],
        buffers: Mapping[str, np.ndarray],
        filled: Mapping[str, object],
        like: Slice | None,
    ) -> None:
        self.first, self.last, self.work = first, last, work
        self.buffers = buffers
        self._features, self.precision = group.features, group.features.precision
        table = buffers["bundles"].reshape(-1, len(BUNDLE))[first:last]
        self.ranks = Ranks(group.features, table, first, buffers)
        real = real_dtype(group.features.precision)
        size = scratch_size(group.features, *largest) + SCRATCH_GAP
        given = {
            "scratch": _on_device(aligned([np.zeros(size, real)], real)),
            "which": _on_device(np.arange(first, last, dtype=np.int32)),
            "first_bundle": first,
        }
        self._given = given | filled
        self._everything = given["which"]
        self._launches: dict[bool, tuple[wp.Launch, wp.Launch]] = {}
        self._like = like
        self.prepare(ledger=False)

    def prepare(self, ledger: bool) -> None:
        """Use the kernels with or without the energy ledger from now on."""
        if ledger not in self._launches:
            self._launches[ledger] = self._recorded(ledger)
        self._advance, self._observe = self._launches[ledger]

    def _recorded(self, ledger: bool) -> tuple[wp.Launch, wp.Launch]:
        count = self.last - self.first
        if self._like is not None:
            self._like.prepare(ledger)
            own = {name: self._given[name] for name in ("scratch", "which", "first_bundle")}
            advance, observe = self._like._launches[ledger]
            return _copied(advance, count, own), _copied(observe, count, own)
        advance, observe = kernels(replace(self._features, ledger=ledger))
        return _recorded(advance, count, self._given), _recorded(observe, count, self._given)

    def reach(self, batch: Batch, robots: Sequence[int]) -> Reach:
        """Where controllers find some of its robots."""
        slots, seen, cells = batch.slots, self._given["seen"], []
        columns = self._features.traits.columns(self._features.actuated)
        for robot in robots:
            rows = columns * np.arange(slots.springs[robot]) + 1
            start = batch.bundles[slots.bundle[robot], BUNDLE.index("spring")]
            place = start + rows * slots.width[robot] + slots.lane[robot]
            cells.append(np.stack([place, place]))
        chosen = np.array(robots)
        place = slots.state[chosen] + slots.lane[chosen], slots.width[chosen]
        lanes = slots.lane_indices(chosen, 1)[:, 0]
        views = {name: getattr(seen, f"seen_{name}") for name in ("positions", "velocities")}
        views["states"] = seen.seen_states
        coefficients = self._given["model"].coefficients
        return Reach(views, coefficients, np.stack([*place, lanes], axis=1), cells)

    def stop(self, slots: Slots, robots: np.ndarray, status: int, times: np.ndarray) -> None:
        """Step some robots no more."""
        lanes = slots.lane_indices(robots, 1)[:, 0]
        self.buffers["states"][lanes], self.buffers["state_times"][lanes] = status, times

    def advance(self, first_step: int, last_step: int) -> None:
        """Step all bundles from ``first_step`` to ``last_step``."""
        self._advance.set_param_by_name("first_step", first_step)
        self._advance.set_param_by_name("last_step", last_step)
        self._advance.launch()

    def observe(self, step: int, which: wp.array | None = None) -> None:
        """Write what is seen of some bundles (default all) at ``step``; changes no state."""
        which = self._everything if which is None else which
        if len(which):
            self._observe.set_dim(len(which))
            self._observe.set_param_by_name("which", which)
            self._observe.set_param_by_name("step", step)
            self._observe.launch()


@dataclass
class Tape:
    """What one slice records in one run, and how far it has come.

    Attributes:
        members: Robots of the slice, shape (n,), if energies are asked for.
        recorded: Those whose frames are kept.
        frames: Their positions [m].
        signals: What the controllers of those who have any ask for.
        flowed: How far the springs of those that may break or yield have flowed [m].
        energies: Energies and ledger [J] of the members, (F, n, ENERGIES), if they are asked for.
        audit: Who looks through the energies.
        dt: Step of the run [s].
        pilot: Who sets muscles between the steps, if anybody.
        wearing: As in `Batch`.
        done: Steps done so far.
        taken: Frames taken so far.
    """

    slice: Slice | Crowd
    slots: Slots
    recorded: np.ndarray
    frame_steps: Sequence[int]
    energy: bool
    audit: Audit
    dt: float
    pilot: Pilot | None = None
    wearing: Mapping[int, tuple[np.ndarray, int]] = field(default_factory=dict)
    done: int = 0
    taken: int = 0
    members: np.ndarray = field(init=False)
    frames: Reel = field(init=False)
    signals: Reel = field(init=False)
    flowed: Reel = field(init=False)
    energies: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.frame_steps)
        # Who records nothing need not know whom it steps.
        self.members = self._inside(np.arange(len(self.slots.bundle)) if self.energy else NOBODY)
        self.recorded = self._inside(self.recorded)
        state, sizes = NOBODY, NOBODY
        if len(self.recorded):
            state = self.slots.state_indices(self.recorded)
            sizes = 3 * self.slots.masses[self.recorded]
        self.frames = Reel(count, self.recorded, sizes, state)
        asked = {} if self.pilot is None else self.pilot.outputs
        some = [robot for robot in self.recorded.tolist() if robot in asked]
        self.signals = Reel.of(count, {robot: np.arange(*asked[robot]) for robot in some})
        some = [robot for robot in self.recorded.tolist() if robot in self.wearing]
        self.flowed = Reel.of(count, {robot: flow_places(*self.wearing[robot]) for robot in some})
        self.energies = np.empty((count if self.energy else 0, len(self.members), ENERGIES))
        self._find_lanes()

    def _inside(self, robots: np.ndarray) -> np.ndarray:
        """Those of some robots that the slice steps."""
        if not len(robots):
            return NOBODY
        bundle = self.slots.bundle[robots]
        return robots[(bundle >= self.slice.first) & (bundle < self.slice.last)]

    def _find_lanes(self) -> None:
        self._which = None
        if self.energy:
            self._lanes = self.slots.lane_indices(self.members, ENERGIES)
        elif len(self.recorded):
            bundles = np.unique(self.slots.bundle[self.recorded])
            self._which = _on_device(bundles.astype(np.int32))

    def _close_ranks(self) -> None:
        """Let robots move to where those that were stopped leave a lane."""
        if self.slice.ranks.close(self.slots):
            if len(self.recorded):
                self.frames.move(self.slots.state_indices(self.recorded))
            self._find_lanes()

    def run(self, first: int, last: int, stop: threading.Event) -> None:
        """Step the slice from ``first`` to ``last``, with the frames between."""
        at = first
        frames = self.frame_steps if self.energy or len(self.recorded) else ()
        for index, step in enumerate(frames):
            at = self._advance(first, at, step, stop)
            energies = self._look(step, self._which)
            self._take(index, energies)
            self.taken = index + 1
        at = self._advance(first, at, last, stop)
        if not stop.is_set():
            self._look(last)

    def _advance(self, first: int, at: int, target: int, stop: threading.Event) -> int:
        steps = max(1, int(self.slice.launch_work / max(self.slice.work, 1)))
        while at < target and not stop.is_set():
            until = min(at + steps, target)
            if self.pilot is not None:
                until = min(until, self.pilot.until(at))
            elif isinstance(self.slice, Slice):
                self._close_ranks()
            if self.energy:
                until = min(until, (at // AUDIT_EVERY + 1) * AUDIT_EVERY)
            self.slice.advance(at, until)
            at = until
            self.done = at - first
            if self.energy and at % AUDIT_EVERY == 0 and at < target:
                self._look(at)
        return at

    def _look(self, step: int, which: wp.array | None = None) -> np.ndarray | None:
        """Let what some bundles (default all) show at a step be seen; the members' energies."""
        self.slice.observe(step, which)
        if not self.energy:
            self.audit.show()
            return None
        energies = self.slice.buffers["seen_energies"][self._lanes].astype(np.float64)
        if self.pilot is not None:
            energies[:, ENERGIES - len(ACCOUNTS)] += self.pilot.work[self.members]
        return self.audit.look(self.members, step * self.dt, energies)

    def _take(self, index: int, energies: np.ndarray | None) -> None:
        buffers = self.slice.buffers
        self.frames.take(index, buffers["seen_positions"])
        self.flowed.take(index, buffers["worn"])
        if len(self.signals):
            self.signals.take(index, self.pilot.heard())
        if energies is not None:
            self.energies[index] = energies

    def cut_to(self, frames: int) -> Tape:
        """A tape of the first frames alone; they are complete once they are ``taken``."""
        short = copy.copy(self)
        short.frame_steps = self.frame_steps[:frames]
        for name in ("frames", "signals", "flowed"):
            setattr(short, name, getattr(self, name).cut_to(frames))
        short.energies = self.energies[:frames].copy()
        return short

    def frames_by_robot(self) -> dict[int, np.ndarray]:
        """Frames (F, M, 3) of each recorded robot."""
        shape = (len(self.frame_steps), -1, 3)
        return {robot: flat.reshape(shape) for robot, flat in self.frames.by_robot().items()}


def run_all(tapes: Sequence[Tape], first: int, last: int, threads: int, progress=None) -> None:
    """Run all tapes on a pool of threads; the largest first, so that little is left at the end.

    Those that need all threads for themselves come before, one after the other.

    ``progress`` is called with the fraction done. On an exception, Ctrl-C included, the threads
    stop after their present launch.
    """
    stop = threading.Event()
    tapes = sorted(tapes, key=lambda tape: -tape.slice.work)
    total = (last - first) * sum(tape.slice.work for tape in tapes)
    pending: set[Future] = set()
    try:
        for turn in _turns(tapes):
            pending = {crew(threads).submit(tape.run, first, last, stop) for tape in turn}
            while pending:
                done, pending = wait(pending, timeout=0.1)
                for future in done:
                    future.result()
                if progress is not None and total:
                    progress(sum(tape.done * tape.slice.work for tape in tapes) / total)
    except BaseException:
        stop.set()
        wait(pending)
        raise


def _turns(tapes: Sequence[Tape]) -> list[list[Tape]]:
    """Tapes that run at the same time."""
    others = [tape for tape in tapes if not tape.slice.gang]
    return [[tape] for tape in tapes if tape.slice.gang] + ([others] if others else [])


def _recorded(kernel: wp.Kernel, dim: int, given: Mapping[str, object]) -> wp.Launch:
    """A launch with the given arguments; the others are set before each launch."""
    inputs = [given.get(argument.label, 0) for argument in kernel.adj.args]
    return wp.launch(kernel, dim, inputs=inputs, device="cpu", record_cmd=True)


def _copied(launch: wp.Launch, dim: int, changed: Mapping[str, object]) -> wp.Launch:
    """The same launch with some other arguments."""
    other = copy.copy(launch)
    other.params, other.fwd_args = list(launch.params), list(launch.fwd_args)
    other.set_dim(dim)
    for index, argument in enumerate(launch.kernel.adj.args):
        if argument.label in changed:
            other.set_param_at_index(index, changed[argument.label])
    return other


def _filled(struct, buffers: Mapping[str, np.ndarray]):
    """A struct of the kernels over the flat buffers."""
    instance = struct()
    for name in struct.vars:
        # Most buffers of most batches are empty, as a struct is before anything is set.
        if buffers[name].size:
            setattr(instance, name, _on_device(buffers[name]))
    return instance


def _on_device(values: np.ndarray) -> wp.array:
    """The array itself, as the kernels see it: nothing is copied."""
    dtype = wp.dtype_from_numpy(values.dtype)
    return wp.array(values, dtype=dtype, device="cpu", copy=False)
