"""Crowds: robots that gather their springs, as slices that a run steps and looks at.

A crowd is made of consecutive bundles of width one that take the same step. How it is stepped is
its layout: ``Threads`` (flat, on a CPU), ``Launches`` (flat, on a GPU) or ``Blocks``.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import warp as wp

from warp_springs.batch import Batch, Group
from warp_springs.engine.buffers import aligned
from warp_springs.engine.crowd_slice import Crowd
from warp_springs.engine.layouts import block_size
from warp_springs.kernels.block import BLOCK, block
from warp_springs.kernels.buffers import BUNDLE
from warp_springs.kernels.features import CHECK_EVERY
from warp_springs.kernels.flat_launches import launches
from warp_springs.kernels.flat_threads import threads
from warp_springs.kernels.gather import (
    GatherFeatures,
)

__all__ = ["Blocks", "Crowd", "Launches", "Threads", "crowds"]

#: Threads have this many slices each, or they would wait more than they work.
SLICES_PER_THREAD = 16


def crowds(
    group: Group, batch: Batch, buffers: Mapping[str, np.ndarray], device: wp.Device, cores: int
) -> Iterator[Crowd]:
    """The crowds of a group."""
    table = batch.bundles[group.first : group.first + group.count]
    kinds = [BUNDLE.index(name) for name in ("level", "substeps", "masses")]
    level, substeps, masses = table[:, kinds].T
    alike = np.stack([level, substeps, 0 * level])
    kind = kind_of(group.layout, device)
    if kind is Blocks:
        alike[2] = [block_size(group.features.precision, m) for m in masses.tolist()]
    elif kind is Threads:
        alike[2] = np.arange(len(level))  # one body after the other, each by all threads
    edges = np.flatnonzero((np.diff(alike, axis=1) != 0).any(axis=0)) + 1
    edges = [0, *edges.tolist(), group.count]
    for first, last in itertools.pairwise(edges):
        yield kind(group, group.first + first, group.first + last, batch, buffers, device, cores)


def kind_of(layout: str, device: wp.Device) -> type[Crowd]:
    """How a layout is carried out on a device."""
    if layout == "block":
        return Blocks
    return Threads if device.is_cpu else Launches


class Threads(Crowd):
    """One body that several CPU threads step together."""

    layout = "threads"

    def _make(self) -> None:
        slices = self._lists.sites[:, 3]
        count = max(1, min(self._cores, len(slices) // SLICES_PER_THREAD))
        load = np.cumsum(slices + 4)  # moving a mass costs about as much as four springs
        edges = np.searchsorted(load, np.arange(1, count) * (load[-1] / count)) + 1
        self._count = count
        self._given |= {
            "edges": self._array(np.array([0, *edges, len(slices)], np.int32)),
            "gates": self._array(aligned([np.zeros(64, np.int32)], np.dtype(np.int32))),
            "give_way": _give_way(),
            "threads": count,
        }
        self._pool = ThreadPoolExecutor(count)

    def _record(self, features: GatherFeatures) -> list[wp.Launch]:
        recorded = []
        for thread in range(self._count):
            self._given["thread"] = thread
            recorded.append(self._recorded(threads(features), 1))
        return recorded

    def _go(self, recorded: list[wp.Launch], first: int, last: int) -> None:
        for launch in recorded:
            launch.set_param_by_name("first_step", first)
            launch.set_param_by_name("last_step", last)
        others = [self._pool.submit(launch.launch) for launch in recorded[1:]]
        recorded[0].launch()
        for other in others:
            other.result()


class Launches(Crowd):
    """Bodies of any number on a GPU, a pass a launch; on a CPU too, one thread, to verify."""

    layout = "launches"
    launch_work = 1e10
    gang = False

    def _make(self) -> None:
        self._clock = self._array(np.zeros(1, np.int64))
        self._given["clock"] = self._clock
        self._graphs: dict[int, wp.Graph] = {}

    def _record(self, features: GatherFeatures) -> tuple[list, list, wp.Launch]:
        kernels = launches(features)
        sizes = self._sizes(features)
        return (
            [self._recorded(kernel, sizes[over]) for kernel, over in kernels.steps],
            [self._recorded(kernel, sizes[over]) for kernel, over in kernels.check],
            self._recorded(kernels.tick, 1),
        )

    def _go(self, recorded, first: int, last: int) -> None:
        self._clock.fill_(first)
        while first < last:
            until = min(last, (first // CHECK_EVERY + 1) * CHECK_EVERY)
            if self.device.is_cuda and until - first == CHECK_EVERY:
                wp.capture_launch(self._graph(recorded))
            else:
                self._issue(recorded, first, until)
            first = until

    def _issue(self, recorded, first: int, last: int) -> None:
        """The launches of some steps, one after the other, and of the clock."""
        steps, check, tick = recorded
        for step in range(first, last):
            for launch in (check if step % CHECK_EVERY == 0 else []) + steps:
                launch.set_param_by_name("offset", step - first)
                launch.launch()
        tick.set_param_by_name("steps", last - first)
        tick.launch()

    def _graph(self, recorded) -> wp.Graph:
        """The steps from one check to the next, captured."""
        key = id(recorded)
        if key not in self._graphs:
            with wp.ScopedCapture(self.device) as capture:
                self._issue(recorded, 0, CHECK_EVERY)
            self._graphs[key] = capture.graph
        return self._graphs[key]


class Blocks(Crowd):
    """Robots that fit a block, several small ones to each."""

    layout = "block"

    def _make(self) -> None:
        self._size = block_size(self.features.precision, int(self._lists.slots.max()))
        # Blocks on a CPU share their memory of a block: one launch at a time.
        self.gang = self.device.is_cpu
        self.launch_work = 2e6 if self.device.is_cpu else 1e10
        self._table = _blocks(self._lists.slots, self._lists.first, self._size, self.features.width)
        self._given["blocks"] = self._array(self._table.ravel())

    def _side(self, step: int) -> int:
        return 0

    def _record(self, features: GatherFeatures) -> wp.Launch:
        before = wp.config.enable_cpu_blocks
        wp.config.enable_cpu_blocks = True  # asked for while a launch is made, not later
        try:
            dim = (len(self._table), self._size)
            return self._recorded(block(features, self._size), dim, self._size)
        finally:
            wp.config.enable_cpu_blocks = before

    def _go(self, recorded: wp.Launch, first: int, last: int) -> None:
        recorded.set_param_by_name("first_step", first)
        recorded.set_param_by_name("last_step", last)
        recorded.launch()


def _blocks(slots: np.ndarray, first: np.ndarray, size: int, width: int) -> np.ndarray:
    """The table of blocks: consecutive robots, as many as fit."""
    blocks: list[list[int]] = []
    for robot, (count, start) in enumerate(zip(slots.tolist(), first.tolist(), strict=True)):
        if not blocks or (blocks[-1][1] * width + count > size):
            blocks.append([start // width, 0, robot, 0])
        blocks[-1][1] += count // width
        blocks[-1][3] += 1
    return np.array(blocks, np.int32).reshape(-1, len(BLOCK))


@functools.cache
def _give_way() -> int:
    """Address of the system's function that lets another thread run, 0 if there is none."""
    try:
        library = ctypes.windll.kernel32 if os.name == "nt" else ctypes.CDLL(None)
        function = library.SwitchToThread if os.name == "nt" else library.sched_yield
        return ctypes.cast(function, ctypes.c_void_p).value or 0
    except (AttributeError, OSError):
        return 0
