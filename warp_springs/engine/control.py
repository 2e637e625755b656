"""Pilots: the controllers of one piece of a batch, run between its steps."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warp_springs.body.control import Controller, Growth
from warp_springs.body.variants import Variants
from warp_springs.kernels.buffers import ENERGIES
from warp_springs.kernels.control import BRAIN, TABLES, control, control_struct
from warp_springs.kernels.law import CONSTANTS
from warp_springs.kernels.obstacles import obstacle_tables
from warp_springs.robot import Robot
from warp_springs.sensors import KINDS

if TYPE_CHECKING:
    from warp_springs.batch import Batch
    from warp_springs.scene import Scene

__all__ = ["Pilot", "Reach", "pilots"]

#: Steps of the activations in the time of a response, at least.
_FINENESS = 8
#: Energies that a change of rest lengths changes: kinetic, by the half kick that belongs to the
#: step before, and that of the springs.
_CHANGED = (0, 2)


@dataclass(frozen=True)
class Pace:
    """When controllers read, and how their muscles follow.

    Attributes:
        every: Steps from one reading to the next.
        follow: Steps from one change of the activations to the next, a part of ``every``.
        left: Part of the difference from the output that is left after that time.
        mean: The same on average over that time.
    """

    every: int
    follow: int
    left: float
    mean: float


def pace(controller: Controller, dt: float) -> Pace:
    """The pace of a controller at a step of ``dt``: its rate, rounded to whole steps."""
    every, response = max(1, round(1.0 / (controller.rate * dt))), controller.response
    if response == 0.0:
        return Pace(every, every, 0.0, 0.0)
    turns = min(every, math.ceil(_FINENESS / (controller.rate * response)))
    follow = round(every / turns)
    time = follow * dt / response
    return Pace(turns * follow, follow, math.exp(-time), -math.expm1(-time) / time)


@dataclass(frozen=True)
class Reach:
    """Where a piece of a batch shows its robots to controllers and keeps its springs.

    Attributes:
        seen: Positions, velocities and states that a look writes, on the device.
        coefficients: Those of all springs, on the device.
        place: Where positions of each robot start, their stride, and its lane, shape (n, 3).
        cells: For each robot, where ``h`` of its sorted springs is kept, (n, 2, S).
    """

    seen: Mapping[str, wp.array]
    coefficients: wp.array
    place: np.ndarray
    cells: Sequence[np.ndarray]


def pilots(pieces: Sequence, batch: Batch, scene: Scene, constants: np.ndarray, dt: float) -> list:
    """For each piece its `Pilot`, or ``None`` where no robot has a controller."""
    robots = batch.robots
    if isinstance(robots, Variants):
        some = bool(robots.body.elements.controllers)
    else:
        some = any(robot.elements.controllers for robot in robots)
    if not some:
        return [None] * len(pieces)
    return [_pilot(piece, batch, scene, constants, dt) for piece in pieces]


def _pilot(piece, batch: Batch, scene: Scene, constants: np.ndarray, dt: float) -> Pilot | None:
    inside = (batch.slots.bundle >= piece.first) & (batch.slots.bundle < piece.last)
    loops = _Loops(batch.robots)
    members = [i for i in np.flatnonzero(inside).tolist() if loops.of(i)]
    return Pilot(piece, members, batch, loops, scene, constants, dt) if members else None


class _Loops:
    """The controllers of each robot, and its weights, without making every variant of a body."""

    def __init__(self, robots: Sequence[Robot]) -> None:
        self._robots = robots
        self._shared = isinstance(robots, Variants)

    def of(self, index: int) -> tuple[Controller, ...]:
        """The controllers of a robot, the weights perhaps those of another variant."""
        robot = self._robots.body if self._shared else self._robots[index]
        return robot.elements.controllers

    def weights(self, index: int, controller: Controller) -> np.ndarray:
        """The weights of one of them."""
        stacked = self._robots.stacked if self._shared else {}
        return stacked["weights"][index] if "weights" in stacked else controller.weights

    def body(self, index: int) -> Robot:
        """The robot that has the springs of a robot, in their order."""
        return self._robots.body if self._shared else self._robots[index]

    def values(self, index: int, name: str) -> np.ndarray:
        """An array of a robot."""
        if self._shared:
            return self._robots.array(name)[index]
        return getattr(self._robots[index], name)


class Pilot:
    """The controllers of a piece: read, think, set muscles, every so many steps.

    Attributes:
        outputs: Robot -> where its outputs begin and end among those of all.
        work: What they put into the robots so far [J], shape (N,), where the ledger is open.
    """

    def __init__(self, piece, members, batch: Batch, loops: _Loops, scene, constants, dt) -> None:
        self._piece, self._dt = piece, dt
        self.work = np.zeros(len(batch.slots.bundle))
        self._ledger = False
        reach = piece.reach(batch, members)
        tables = _Tables(loops, members, reach, dt)
        filled = tables.arrays()
        obstacles, heights = obstacle_tables(scene)
        filled |= {"constants": constants[: len(CONSTANTS)]}
        filled |= {"obstacles": obstacles, "heights": heights}
        self._tables = control_struct()()
        for name, kind in TABLES.items():
            values = np.ascontiguousarray(filled[name], kind).ravel()
            array = wp.array(values, dtype=wp.dtype_from_numpy(np.dtype(kind)), device=piece.place)
            setattr(self._tables, name, array)
        count = len(scene.obstacles) + (scene.ground is not None) if scene.obstacles else 0
        ground = scene.ground is not None and not count
        kernel = control(piece.precision, ground, count)
        self._lanes = batch.slots.lane_indices(np.array(members), ENERGIES)
        self._members = np.array(members)
        self.outputs, self._averages = tables.outputs, np.concatenate(tables.averages)
        self._groups = []
        for pace, rows in tables.grouped().items():
            chosen = self._chosen(kernel, reach, tables.brains[rows], pace)
            bundles = np.unique(batch.slots.bundle[tables.owner[rows]]).astype(np.int32)
            which = wp.array(bundles, dtype=wp.int32, device="cpu")
            self._groups.append((pace, chosen, which))

    def _chosen(self, kernel: wp.Kernel, reach: Reach, brains: np.ndarray, pace: Pace) -> wp.Launch:
        """The launch of the controllers of one pace."""
        tables = control_struct()()
        for name in TABLES:
            setattr(tables, name, getattr(self._tables, name))
        device = self._piece.place
        tables.brains = wp.array(brains.ravel(), dtype=wp.int64, device=device)
        seen = [reach.seen[name] for name in ("positions", "velocities", "states")]
        inputs = [tables, *seen, 0.0, False, pace.left, pace.mean]
        return wp.launch(
            kernel,
            len(brains),
            inputs=inputs,
            outputs=[reach.coefficients],
            device=device,
            record_cmd=True,
        )

    def open(self, ledger: bool) -> None:
        """Keep the ledger of the work of the muscles from now on, or not."""
        self._ledger = ledger
        self.work[:] = 0.0

    def until(self, step: int) -> int:
        """Set the muscles whose time has come at a step; the step when the next will be due."""
        for pace, launch, which in self._groups:
            if step % pace.follow == 0:
                self._run(step, step % pace.every == 0, launch, which)
        return min((step // pace.follow + 1) * pace.follow for pace, _, _ in self._groups)

    def _run(self, step: int, reading: bool, launch: wp.Launch, which: wp.array) -> None:
        if reading or self._ledger:
            self._piece.observe(step, which)
        before = self._energies() if self._ledger else 0.0
        launch.set_param_by_name("now", step * self._dt)
        launch.set_param_by_name("reads", reading)
        launch.launch()
        if self._ledger:
            self._piece.observe(step, which)
            self.work[self._members] += self._energies() - before

    def _energies(self) -> np.ndarray:
        """What may change, of each robot [J]."""
        seen = self._piece.buffers["seen_energies"][self._lanes]
        return seen[:, _CHANGED].astype(np.float64).sum(axis=1)

    def heard(self) -> np.ndarray:
        """What muscles do of the outputs of all controllers, those of a robot at its `outputs`."""
        return self._tables.activations.numpy()[self._averages]

    def signals(self) -> dict[int, np.ndarray]:
        """The same of each robot, end to end."""
        signals = self.heard()
        return {robot: signals[a:b].copy() for robot, (a, b) in self.outputs.items()}


class _Tables:
    """The tables of the kernel, filled controller by controller."""

    def __init__(self, loops: _Loops, members: Sequence[int], reach: Reach, dt: float) -> None:
        self._dt = dt
        self._parts: dict[str, list[np.ndarray]] = defaultdict(list)
        self._sizes: dict[str, int] = defaultdict(int)
        self._shared: dict[tuple, tuple[int, int]] = {}
        self._ranks: dict[bytes, np.ndarray] = {}
        self._kept: list[Controller] = []  # an id is its owner's only while the owner lives
        self.outputs: dict[int, tuple[int, int]] = {}
        self.averages: list[np.ndarray] = []  # of each controller, where they are kept
        rows, self._controllers, owner = [], [], []
        for index, place, cells in zip(members, reach.place, reach.cells, strict=True):
            start = self._sizes["signals"]
            for controller in loops.of(index):
                rows.append(self._row(loops, index, controller, place, cells))
                self._controllers.append(controller)
                owner.append(index)
            self.outputs[index] = start, self._sizes["signals"]
        self.brains = np.array(rows, np.int64)
        self.owner = np.array(owner)

    def grouped(self) -> dict[Pace, list[int]]:
        """Rows of the table of controllers, by their pace, the hastiest first."""
        found = defaultdict(list)
        for row, controller in enumerate(self._controllers):
            found[pace(controller, self._dt)].append(row)
        return {key: found[key] for key in sorted(found, key=lambda p: (p.every, p.follow, p.left))}

    def arrays(self) -> dict[str, np.ndarray]:
        """All tables by name."""
        found = {name: np.zeros(0) for name in TABLES} | {"brains": self.brains}
        return found | {name: np.concatenate(parts) for name, parts in self._parts.items()}

    def _add(self, name: str, values: np.ndarray) -> int:
        """Append values; where they begin."""
        start = self._sizes[name]
        self._parts[name].append(np.asarray(values).ravel())
        self._sizes[name] += np.size(values)
        return start

    def _row(self, loops, index, controller: Controller, place, cells) -> list[int]:
        """The row of the table of controllers for one of a robot's."""
        body, lengths = loops.body(index), loops.values(index, "rest_length")
        key = (id(controller), body.topology, lengths.tobytes())
        if key not in self._shared:
            self._kept.append(controller)
            self._shared[key] = self._sense(controller, body, lengths)
        sensor, frame = self._shared[key]
        muscles = np.array(controller.muscles)
        rank = self._rank(body)[muscles]
        outputs = np.broadcast_to(np.array(controller.outputs).T, (2, len(muscles)))
        table = np.stack([*outputs, cells[0][rank], cells[1][rank]], axis=1)
        activation = self._add("activations", np.zeros(2 * controller.n_outputs))
        self.averages.append(activation + controller.n_outputs + np.arange(controller.n_outputs))
        half = 0.5 * loops.values(index, "stiffness")[muscles]
        rest = half * lengths[muscles]
        hidden, growth = controller.hidden, controller.growth
        scratch = 2 * hidden + (0 if growth is None else controller.n_outputs)
        row = {
            "place": place[0],
            "width": place[1],
            "lane": place[2],
            "masses": body.n_masses,
            "frame": frame,
            "sensor": sensor,
            "sensors": len(controller.sensors),
            "readings": controller.n_readings,
            "hidden": hidden,
            "recurrent": controller.recurrent,
            "outputs": controller.n_outputs,
            "weight": self._add("weights", loops.weights(index, controller)),
            "memory": self._add("memories", np.zeros(scratch)),
            "reading": self._add("readings", np.zeros(controller.n_readings)),
            "signal": self._add("signals", np.zeros(controller.n_outputs)),
            "activation": activation,
            "muscle": self._add("muscles", table) // 4,
            "muscles": len(muscles),
            "growth": -1 if growth is None else self._growth(controller, growth),
        }
        self._add("strengths", np.stack([rest, rest * controller.reach], axis=1))
        return [int(row[name]) for name in BRAIN]

    def _growth(self, controller: Controller, growth: Growth) -> int:
        """Append how the outputs of a controller grow; where it begins."""
        step = growth.speed * pace(controller, self._dt).every * self._dt
        return self._add("growths", [step, growth.limit, growth.budget])

    def _sense(self, controller: Controller, body: Robot, rest: np.ndarray) -> tuple[int, int]:
        """Append the sensors and the frame of a controller; where they begin."""
        start = self._sizes["sensors"] // 3
        for sensor in controller.sensors:
            of = np.array(sensor.of, np.int64)
            spring = sensor.kind == "length"
            sites = body.springs[of] if spring else np.stack([of, of], axis=1)
            lengths = rest[of] if spring else np.zeros(len(of))
            first = self._add("lengths", lengths)
            self._add("sites", sites)
            self._add("sensors", [KINDS.index(sensor.kind), first, len(of)])
            self._add("places", [*sensor.place, *sensor.motion, sensor.full])
        return start, self._add("frames", controller.frame)

    def _rank(self, body: Robot) -> np.ndarray:
        """Place of each spring among the sorted ones."""
        if body.topology not in self._ranks:
            lower, higher = np.sort(body.springs, axis=1).T
            self._ranks[body.topology] = np.argsort(np.lexsort((higher, lower)))
        return self._ranks[body.topology]
