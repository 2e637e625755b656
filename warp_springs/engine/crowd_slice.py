"""Robots that gather their springs: their buffers on a device, and what a run asks of them.

The ways of stepping them are in ``crowd``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import warp as wp

from warp_springs.batch import Batch, Slots
from warp_springs.engine.buffers import aligned
from warp_springs.engine.control import Reach
from warp_springs.engine.gathering import (
    WEAR,
    Bodies,
    Lists,
    arrays,
    half_rest_places,
    ranges,
    worn_springs,
)
from warp_springs.kernels.buffers import BUNDLE, SEEN, real_dtype, structs
from warp_springs.kernels.crowd_collisions import FEATURE
from warp_springs.kernels.gather import (
    CHUNK,
    LOOKS,
    GatherFeatures,
    gather_structs,
    run_type,
    slice_width,
)
from warp_springs.kernels.law import CONSTANTS
from warp_springs.kernels.look import look

__all__ = ["Crowd"]

#: Threads of a GPU that fit the tree of one robot's features.
TEAM = 256


class Crowd:
    """Bundles ``first`` to ``last - 1``, with arrays of their own on the device.

    Attributes:
        work: Spring evaluations of one step.
        launch_work: Spring evaluations of one launch, so that Ctrl-C is answered.
        gang: Whether it needs all threads for itself.
    """

    layout: str
    launch_work = 1e8
    gang = True

    def __init__(self, group, first, last, batch, buffers, device, cores) -> None:
        self.first, self.last, self.buffers, self.device = first, last, buffers, device
        self.place, self.precision = device, group.features.precision
        rows = batch.bundles[first:last]
        about = dict(zip(BUNDLE, rows[0], strict=True))
        self._division = int(about["division"])
        names = [field.name for field in fields(group.features) if field.name != "width"]
        lanes = {name: getattr(group.features, name) for name in names}
        width = slice_width(self.layout, group.features.precision)
        self.features = GatherFeatures(width=width, layout=self.layout, **lanes)
        self._lists = Lists.of(
            bodies := Bodies.of(rows, buffers), self.features, along_curve=group.layout == "flat"
        )
        self._robots, self._slots = last - first, len(self._lists.home)
        springs, masses = rows[:, BUNDLE.index("springs")], rows[:, BUNDLE.index("masses")]
        self._worn_in = {
            name: ranges(rows[:, BUNDLE.index(column)], len(nothing) * springs)
            for name, (column, nothing) in (WEAR if self.features.traits.limits else {}).items()
        }
        self.work = int((springs + 2 * masses).sum()) * self._division
        self._given = {
            "slots": self._slots,
            "robots": self._robots,
            "team": 1 if self.device.is_cpu else TEAM,
            "run": self._run(batch, about),
            **self._structs(arrays(bodies, self._lists, self.features)),
        }
        self._seen_in = {
            name: slice(*self._range(rows, name, len(buffers[name]), len(buffers["omegas"])))
            for name in SEEN
        }
        self._given |= self._looking()
        self._wanted: dict[int, wp.array] = {}
        self._kernels: dict[bool, object] = {}
        self._cores = cores
        self._make()

    # What a layout does in its own way.

    def _make(self) -> None:
        """Make what does not depend on the ledger."""

    def _record(self, features: GatherFeatures) -> object:
        """Record the launches of a step, or of all steps."""
        raise NotImplementedError

    def _go(self, recorded: object, first: int, last: int) -> None:
        """Make the crowd's own steps ``first`` to ``last - 1``."""
        raise NotImplementedError

    def _side(self, step: int) -> int:
        """Buffer that holds the positions at the crowd's own step."""
        return step & 1

    # What all do.

    def prepare(self, ledger: bool) -> None:
        """Use the kernels with or without the energy ledger from now on, and open it anew."""
        if ledger not in self._kernels:
            features = replace(self.features, ledger=ledger)
            kernels, over = look(features)
            sizes = self._sizes(features)
            looks = [self._recorded(k, sizes[name]) for k, name in zip(kernels, over, strict=True)]
            self._kernels[ledger] = self._record(features), looks
        self._advance, self._look = self._kernels[ledger]
        for name in ("ledgers", "good_ledgers"):
            getattr(self._given["state"], name).zero_()

    def _sizes(self, features: GatherFeatures) -> dict[str, int]:
        """What a kernel may be launched over."""
        return {
            "slots": self._slots,
            "sites": self._slots // (features.width if features.vector else 1),
            "chunks": len(self._given["model"].chunks) // len(CHUNK),
            "robots": self._robots,
            "teams": self._robots * self._given["team"],
            "features": self._count_features(),
        }

    def reach(self, batch: Batch, robots: Sequence[int]) -> Reach:
        """Where controllers find some of its robots."""
        slots, seen, cells = batch.slots, self._given["seen"], []
        counts = batch.bundles[self.first : self.last, BUNDLE.index("springs")]
        starts, every = np.cumsum(counts) - counts, half_rest_places(self._lists, self.features)
        for robot in robots:
            bundle = slots.bundle[robot] - self.first
            cells.append(every[:, starts[bundle] : starts[bundle] + counts[bundle]])
        chosen = np.array(robots)
        place = slots.state[chosen] - self._seen_in["seen_positions"].start
        lanes = slots.first_lane[chosen] - self._seen_in["seen_states"].start
        views = {name: getattr(seen, f"seen_{name}") for name in ("positions", "velocities")}
        views["states"] = seen.seen_states
        table = np.stack([place, np.ones_like(place), lanes], axis=1)
        return Reach(views, self._given["model"].coefficients, table, cells)

    def stop(self, slots: Slots, robots: np.ndarray, status: int, times: np.ndarray) -> None:
        """Step some robots no more."""
        state, here = self._given["state"], slots.bundle[robots] - self.first
        for array, values in ((state.states, status), (state.state_times, times)):
            known = array.numpy()
            known[here] = values
            array.assign(known)

    def advance(self, first_step: int, last_step: int) -> None:
        """Step all robots from ``first_step`` to ``last_step`` of the run."""
        self._go(self._advance, first_step * self._division, last_step * self._division)

    def observe(self, step: int, which: wp.array | None = None) -> None:
        """Write what is seen of some bundles (default all) at ``step``; changes no state."""
        if which is not None and len(which) == 0:
            return
        own = step * self._division
        for launch in self._look:
            launch.set_param_by_name("side", self._side(own))
            launch.set_param_by_name("step", own)
            launch.set_param_by_name("wanted", self._chosen(which))
            launch.launch()
        for name, here in self._worn_in.items():
            values, columns = getattr(self._given["state"], name).numpy(), len(WEAR[name][1])
            self.buffers[name][here] = worn_springs(values, columns, self._lists, self.features)
        if not self.device.is_cpu:
            for name, here in self._seen_in.items():
                self.buffers[name][here] = getattr(self._given["seen"], name).numpy()

    def _chosen(self, which: wp.array | None) -> wp.array:
        """For each robot whether it is looked at."""
        key = 0 if which is None else which.ptr
        if key not in self._wanted:
            wanted = np.ones(self._robots, np.int32)
            if which is not None:
                wanted[:] = 0
                wanted[which.numpy() - self.first] = 1
                self._wanted = {k: v for k, v in self._wanted.items() if k == 0}
            self._wanted[key] = self._array(wanted)
        return self._wanted[key]

    def _run(self, batch: Batch, about: dict[str, int]):
        """The constants of the steps."""
        constants = self.buffers["constants"].reshape(-1, len(CONSTANTS))[about["level"]]
        run = run_type(self.features.precision)()
        for name, value in zip(CONSTANTS, constants.tolist(), strict=True):
            setattr(run, name, value)
        run.exact_dt, run.substeps = constants[0], int(about["substeps"])
        return run

    def _count_features(self) -> int:
        """How many triangles, edges and masses can collide."""
        if not self.features.traits.colliding:
            return 0
        return len(self._given["model"].features) // len(FEATURE)

    def _structs(self, packed: dict[str, np.ndarray]) -> dict[str, object]:
        """The structs of arrays, filled."""
        filled = {}
        kinds = gather_structs(self.features.precision, self.features.traits.colliding)
        structs_of = zip(("model", "state"), kinds, strict=True)
        for label, struct in structs_of:
            filled[label] = struct()
            for name, field in struct.vars.items():
                values = (
                    packed.get(name, np.zeros(0))
                    .astype(wp.dtype_to_numpy(field.type.dtype))
                    .ravel()
                )
                setattr(filled[label], name, self._array(aligned([values], values.dtype)))
        return filled

    @staticmethod
    def _range(rows: np.ndarray, name: str, size: int, lanes: int) -> tuple[int, int]:
        """Where the robots of the crowd are in a buffer of what is seen."""
        column = {c: rows[:, i] for i, c in enumerate(BUNDLE)}
        if name in ("seen_positions", "seen_velocities"):
            return int(column["state"].min()), int((column["state"] + 3 * column["masses"]).max())
        columns = size // lanes
        return columns * int(column["lane"].min()), columns * (int(column["lane"].max()) + 1)

    def _looking(self) -> dict[str, object]:
        """What a look writes: on a CPU into the buffers themselves."""
        precision = self.features.precision
        seen = structs(precision).seen()
        for name, here in self._seen_in.items():
            setattr(seen, name, self._array(self.buffers[name][here]))
        chunks = len(self._given["model"].chunks) // len(CHUNK)
        return {
            "seen": seen,
            "shown": self._array(aligned([np.zeros(4 * self._slots)], real_dtype(precision))),
            "parts": wp.zeros(LOOKS * self._slots, dtype=wp.float64, device=self.device),
            "sums": wp.zeros(LOOKS * chunks, dtype=wp.float64, device=self.device),
        }

    def _array(self, values: np.ndarray) -> wp.array:
        """The array on the device; on a CPU the very same memory."""
        dtype = wp.dtype_from_numpy(values.dtype)
        return wp.array(values, dtype=dtype, device=self.device, copy=not self.device.is_cpu)

    def _recorded(self, kernel: wp.Kernel, dim, block_dim: int | None = None) -> wp.Launch:
        """A launch with the arguments that do not change."""
        inputs = [self._given.get(argument.label, 0) for argument in kernel.adj.args]
        inputs = [
            wp.zeros(1, dtype=argument.type.dtype, device=self.device)
            if isinstance(argument.type, wp.array) and value == 0
            else value
            for argument, value in zip(kernel.adj.args, inputs, strict=True)
        ]
        return wp.launch(
            kernel, dim, inputs=inputs, device=self.device, record_cmd=True, block_dim=block_dim
        )
