"""Packing: robots in, one flat buffer for each quantity out.

Robots are grouped by what their kernel must be able to do and by their topology; W of them share a
bundle, one in each SIMD lane (see ``kernels.lanes`` and ``engine.grouping``). What a robot's kernel
can do is decided by the robot alone, never by its neighbours, so its bits do not depend on its
batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warp_springs.body.elements import NONE
from warp_springs.body.variants import Variants
from warp_springs.engine.buffers import aligned, aligned_empty, is_buffer, lane_major
from warp_springs.engine.colliding import PACKED_COLLISIONS, collision_buffers, collision_counts
from warp_springs.engine.curve import ranges
from warp_springs.engine.element_packing import (
    PACKED_ELEMENTS,
    SHARED_ELEMENTS,
    element_buffers,
    element_counts,
    element_lists,
    spring_columns,
    traits_of,
)
from warp_springs.engine.grouping import Grouping
from warp_springs.engine.method import Method
from warp_springs.engine.packing import (
    Strip,
    coefficients,
    largest,
    local_frames,
    longest_springs,
    not_finite,
    rests,
    row_pairs,
    sort_rows,
)
from warp_springs.engine.slots import Slots
from warp_springs.kernels.buffers import BUNDLE, dtype_of, real_dtype
from warp_springs.kernels.features import Features
from warp_springs.robot import Robot
from warp_springs.scene import Scene
from warp_springs.stability import Status

__all__ = ["Batch", "Group", "Slots"]

#: Buffers that are packed; all others are made by the simulation.
PACKED = (
    "rows",
    "partners",
    "pairs",
    "inverse_masses",
    "coefficients",
    "omegas",
    "reaches2",
    "positions",
    "velocities",
    "low_positions",
    "low_velocities",
    "origins",
    "quanta",
    "oscillators",
    "states",
    *PACKED_ELEMENTS,
    *SHARED_ELEMENTS,
    *PACKED_COLLISIONS,
)


#: Springs whose coefficients are worked out at a time.
PIECE = 1 << 16

#: What lanes of a bundle of different robots hold where one has no mass: far above the ground.
NOBODY = {"positions": (0.0, 0.0, 1e6)}


@dataclass(frozen=True)
class Group:
    """Consecutive bundles that one kernel steps.

    Attributes:
        features: What the kernel must be able to do.
        first: First bundle.
        count: Number of bundles.
        layout: ``"lanes"``, ``"block"`` or ``"flat"``; all but the first take bundles of width one.
    """

    features: Features
    first: int
    count: int
    layout: str


class Batch:
    """Flat buffers for N robots, ready for the kernels.

    Args:
        robots: The robots.
        scene: Their world.
        method: How they are stepped.
        layout_of: The layout of a robot with so many masses.
        bodies: For robots that are worlds of several: the body of each mass, shape (M,).

    Attributes:
        slots: Where each robot lives.
        groups: Runs of bundles, one kernel each.
        bundles: The table of bundles, shape (B, len(BUNDLE)), int64.
        arrays: The flat buffers of ``PACKED``, by name, on 64-byte boundaries.
        substeps: Contact sub-steps of each robot, shape (N,).
        levels: Halvings of the step of the run for each robot, shape (N,).
        wearing: For each robot whose springs may break, where they are in the buffer of the times
            when they broke, shape (S,), and its lane.
        robots: The robots.
        rounding: Energy that rounding alone may give each robot [J], shape (N,).
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        scene: Scene,
        method: Method,
        layout_of: Callable[[int], str] = lambda masses: "lanes",
        bodies: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        self.robots, self._bodies = robots, bodies or {}
        self._scene, self._method = scene, method
        self._parts: dict[str, list[np.ndarray]] = {name: [] for name in PACKED}
        self._sizes = dict.fromkeys(PACKED, 0)
        self._tables: list[np.ndarray] = []
        self.groups: list[Group] = []
        self.rounding = np.zeros(len(robots))
        self.wearing: dict[int, tuple[np.ndarray, int]] = {}
        self._rows: list[tuple[np.ndarray, np.ndarray]] = []  # robots, and places of their masses
        self._slot = np.zeros((len(robots), 3), np.int64)  # bundle, lane, width
        self._grouping = Grouping(robots, scene, method, layout_of)
        self.levels, self.substeps = self._grouping.levels, self._grouping.substeps

        # An absurd robot may overflow here; its status will say so.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for kind, strips in self._grouping.strips().items():
                first = len(self)
                width, actuated, layout, _ = kind
                for strip in strips:
                    self._pack(strip, width, actuated)
                features = self._grouping.features(kind)
                self.groups.append(Group(features, first, len(self) - first, layout))
            self._finish()

    def __len__(self) -> int:
        """Number of bundles."""
        return sum(map(len, self._tables)) if self._tables else 0

    def _pack(self, strip: Strip, width: int, actuated: bool) -> None:
        """Append a strip: its robots' places, its bundles' descriptions and its arrays."""
        n, method = len(strip.ids), self._method
        self._grouping.decide(strip)
        levels = self.levels[strip.ids]
        within = np.arange(n)
        self._slot[strip.ids] = np.stack(
            [len(self) + within // width, within % width, np.full(n, width)], axis=1
        )
        order, row, partner = sort_rows(strip)
        elements = {}
        if strip.elements is not NONE:
            elements = element_buffers(strip.fields, order, method.spans(levels))
        columns, springs, invalid = self._spring_tables(strip, width, order, actuated)
        self._tables.append(self._describe(strip, width, columns, elements))
        self._append("coefficients", springs)
        if strip.union is not None:
            row, partner = strip.union.rows, strip.union.partners
            self._rows.append((strip.ids, strip.union.mass_row))
        elif width > 1:
            self._append("pairs", row_pairs(row, partner))
        self._append("rows", row)
        self._append("partners", partner)
        fields, one = strip.fields, np.ones(n, np.int64)
        turn = fields["omega"] * method.spans(levels)
        oscillators = np.stack([0.0 * turn, 0.0 * turn + 1.0, np.cos(turn), np.sin(turn)], axis=1)
        per_robot = {  # values, and how many rows of them each robot has
            "inverse_masses": (1.0 / fields["masses"], strip.masses),
            "omegas": (fields["omega"], one),
            "positions": (fields["positions"], strip.masses),
            "velocities": (fields["velocities"], strip.masses),
            "oscillators": (oscillators, one),
        }
        real = real_dtype(method.precision)
        if method.precision == "mixed":
            origins, quanta, local = local_frames(strip)
            per_robot |= {
                "positions": (local, strip.masses),
                "low_positions": (rests(local, real), strip.masses),
                "low_velocities": (rests(fields["velocities"], real), strip.masses),
                "origins": (origins, one),
                "quanta": (quanta, one),
            }
        # A mass too large for the precision would come out as one without an inverse.
        invalid |= largest(fields["masses"], strip.masses) > np.finfo(real).max
        for name, (values, rows) in per_robot.items():
            cast = values.astype(dtype_of(name, method.precision), copy=False)
            invalid |= not_finite(cast, rows)
            if strip.union is not None and rows is strip.masses:
                nothing = np.array(NOBODY.get(name, (0.0,) * (cast.size // len(cast))), cast.dtype)
                self._append(name, strip.union.lanes_of(cast, rows, False, nothing))
            else:
                self._append(name, lane_major(cast, n, width))
        self._pack_elements(strip, width, elements, order, row)
        if self._scene.collisions is not None:
            robot = self.robots[int(strip.ids[0])]
            bodies = self._bodies.get(int(strip.ids[0]), np.zeros(robot.n_masses, np.int32))
            for name, values in collision_buffers(robot, bodies, self._scene.collisions).items():
                self._append(name, values.astype(dtype_of(name, method.precision)))
        # A stiffness that vanishes would be divided by.
        vanished = fields["stiffness"].astype(real, copy=False) == 0.0
        if vanished.any():
            invalid |= largest(vanished, strip.counts) > 0.0
        longest = longest_springs(strip)
        elastic = largest(fields["stiffness"], strip.counts) * strip.counts * longest**2
        self.rounding[strip.ids] = np.finfo(real).eps * elastic
        reach = np.where(longest > 0.0, method.limits.stretch * longest, np.inf)
        for name, values in {
            "reaches2": reach**2,
            "states": self._birth(strip, invalid),
        }.items():
            lanes = lane_major(values.astype(dtype_of(name, method.precision)), n, width)
            if name == "states" and strip.union is not None and n % width:
                lanes[n % width - width :] = Status.INVALID  # nobody's lanes
            self._append(name, lanes)

    def _birth(self, strip: Strip, invalid: np.ndarray) -> np.ndarray:
        """Status of each robot before its first step, shape (n,)."""
        refused = self._grouping.refused[strip.ids]
        return np.select([invalid, refused], [Status.INVALID, Status.UNSTABLE_STEP], Status.OK)

    def _spring_tables(
        self, strip: Strip, width: int, order: np.ndarray | slice, actuated: bool
    ) -> tuple[int, np.ndarray, np.ndarray]:
        """The coefficients of the springs, a few bundles at a time, which fit the cache.

        Returns:
            How many a spring has; all of them, lane by lane; and which robots they are not finite
            for, shape (n,).
        """
        if strip.union is not None:
            table = coefficients(strip.fields, order, actuated)
            cast = table.astype(real_dtype(self._method.precision), copy=False)
            nothing = np.zeros(table.shape[1], cast.dtype)
            lanes = strip.union.lanes_of(cast, strip.counts, True, nothing)
            return table.shape[1], lanes, not_finite(cast, strip.counts)
        n, start = len(strip.ids), np.append(0, np.cumsum(strip.counts))
        # Where each robot's lane ends; those of a bundle are of the same size.
        ends = start if width == 1 else -(-np.arange(n + 1) // width) * width * start[1]
        bundles = max(1, PIECE // max(int(strip.counts.max()) * width, 1))
        invalid = np.zeros(n, bool)
        columns = traits_of(strip.elements).columns(actuated)
        lanes = aligned_empty(columns * int(ends[-1]), real_dtype(self._method.precision))
        for first in range(0, n, bundles * width):
            last = min(first + bundles * width, n)
            part = slice(start[first], start[last])
            part = part if isinstance(order, slice) else order[part]
            table = coefficients(strip.fields, part, actuated)
            if strip.elements is not NONE:
                table = np.concatenate([table, spring_columns(strip.fields, part)], axis=1)
            cast = table.astype(real_dtype(self._method.precision), copy=False)
            if strip.elements is NONE:  # limits may be infinite
                invalid[first:last] = not_finite(cast, strip.counts[first:last])
            here = lanes[columns * ends[first] : columns * ends[last]]
            lane_major(cast, last - first, width, here)
        return columns, lanes, invalid

    def _pack_elements(
        self,
        strip: Strip,
        width: int,
        elements: dict[str, np.ndarray],
        order: np.ndarray | slice,
        row: np.ndarray,
    ) -> None:
        """Append the arrays of the elements of a strip."""
        if strip.elements is NONE:
            return
        for name, values in elements.items():
            cast = values.astype(dtype_of(name, self._method.precision))
            self._append(name, lane_major(cast, len(strip.ids), width))
        if "worn" in elements:
            self._keep_places(strip, width, order)
        lists = element_lists(strip.elements)
        lists["spring_starts"] = np.repeat(np.arange(len(row) - 1), np.diff(row)).astype(np.int32)
        for name, values in lists.items():
            self._append(name, values)

    def _keep_places(self, strip: Strip, width: int, order: np.ndarray | slice) -> None:
        """Remember where springs that may break are, in the order of the user's springs."""
        springs = len(strip.springs)
        place = np.argsort(
            np.arange(springs)[order] if isinstance(order, slice) else order[:springs]
        )
        end = self._sizes["broken_at"]  # just appended
        bundles = -(-len(strip.ids) // width)
        for k, robot in enumerate(strip.ids.tolist()):
            start = end - (bundles - k // width) * springs * width
            self.wearing[robot] = start + place * width + k % width, k % width

    def _describe(
        self, strip: Strip, width: int, columns: int, elements: dict[str, np.ndarray]
    ) -> np.ndarray:
        """The rows of the table of bundles for a strip."""
        masses, counts, union = strip.masses[::width], strip.counts[::width], strip.union
        if union is not None:
            masses, counts = union.masses, union.springs
        shared = strip.shared
        blocks = {
            "state": ("positions", 3 * masses * width),
            "mass": ("inverse_masses", masses * width),
            "spring": ("coefficients", columns * counts * width),
            "lane": ("omegas", np.full(len(masses), width)),
            "row": ("rows", 0 * masses if shared else masses + 1),
            "partner": ("partners", 0 * counts if shared else counts),
            "pair": ("pairs", 0 * counts),
        }
        # Each bundle of a strip has as many values of its elements.
        sizes = {name: values.size // len(strip.ids) for name, values in elements.items()}
        for name, column in PACKED_ELEMENTS.items():
            blocks[column] = (name, np.full(len(masses), sizes.get(name, 0) * width))
        for name, column in (SHARED_ELEMENTS | PACKED_COLLISIONS).items():
            blocks[column] = (name, 0 * masses)
        table = {
            column: self._sizes[buffer] + np.cumsum(sizes) - sizes
            for column, (buffer, sizes) in blocks.items()
        }
        table |= {"masses": masses, "springs": counts}
        counts = element_counts(strip.elements)
        if self._scene.collisions is not None:
            counts |= collision_counts(self.robots[int(strip.ids[0])])
        else:
            counts |= dict.fromkeys(("triangles", "edges", "capacity"), 0)
        for column, count in counts.items():
            table[column] = np.full(len(masses), count)
        leaders = strip.ids[::width]
        table["substeps"] = self.substeps[leaders]
        table["level"] = self.levels[leaders]
        table["division"] = 2 ** self.levels[leaders]
        return np.stack([table[column] for column in BUNDLE], axis=1).astype(np.int64)

    def _append(self, name: str, values: np.ndarray) -> None:
        self._parts[name].append(values)
        self._sizes[name] += values.size

    def _finish(self) -> None:
        """Join the parts and look up where each robot went."""
        self.bundles = np.concatenate(self._tables)
        self.arrays = {name: self._joined(name, parts) for name, parts in self._parts.items()}
        self._parts.clear()
        bundle, lane, width = np.ascontiguousarray(self._slot.T)
        description = dict(zip(BUNDLE, self.bundles[bundle].T, strict=True))
        fixed = isinstance(self.robots, Variants)
        each = [self.robots.body] if fixed else self.robots
        masses = np.array([robot.n_masses for robot in each])
        springs = np.array([robot.n_springs for robot in each])
        if fixed:
            masses, springs = (np.repeat(count, len(bundle)) for count in (masses, springs))
        first = np.cumsum(masses) - masses
        rows = ranges(np.zeros_like(masses), masses)
        for robots, own in self._rows:  # in bundles of more masses
            rows[ranges(first[robots], masses[robots])] = own
        self.slots = Slots(
            bundle=bundle,
            lane=lane,
            width=width,
            state=description["state"],
            first_lane=description["lane"],
            masses=masses,
            springs=springs,
            first=first,
            rows=rows,
        )

    def _joined(self, name: str, parts: list[np.ndarray]) -> np.ndarray:
        """The parts of a buffer in one array, aligned as vector loads need."""
        dtype = dtype_of(name, self._method.precision)
        # What was made for its lanes may be the buffer itself, if there is one strip.
        if len(parts) == 1 and is_buffer(parts[0], dtype):
            return parts[0]
        return aligned(parts, dtype)
