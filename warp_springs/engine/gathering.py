"""Packing for the layouts in which every mass gathers its own springs, as pure NumPy functions.

The robots come as bundles of width one, as ``batch`` packs them, with their masses in the user's
order; see ``kernels.gather`` for crowds, slots, slices and rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warp_springs.engine.crowd_colliding import collision_arrays
from warp_springs.engine.curve import along_curve as place_on_curve
from warp_springs.engine.curve import ranges
from warp_springs.kernels.buffers import ACCOUNTS, BUNDLE
from warp_springs.kernels.gather import GatherFeatures, lane_order

__all__ = ["WEAR", "Bodies", "Lists", "arrays", "half_rest_places", "ranges", "worn_springs"]

#: Masses that are sorted by their number of springs, so that the lists of a slice are of about the
#: same length; few, so that neighbours in space stay neighbours in memory.
WINDOW = 512
#: Slots whose sums are taken together.
CHUNK_SLOTS = 256
#: What stepping changes of springs with limits: where a bundle keeps it, and what whole ones have.
WEAR = {"worn": ("worn", [0.0, 1.0]), "broken_at": ("broken", [np.nan])}


@dataclass(frozen=True)
class Bodies:
    """Bundles of width one, and the T topologies among them.

    Attributes:
        table: Columns of the table of bundles, each of shape (n,).
        buffers: The flat buffers.
        topology: Topology of each bundle, shape (n,).
        leader: A bundle of each topology, shape (T,).
        masses: Number of masses of each topology.
        counts: Number of springs of each topology.
        ends: Ends of the springs of all topologies, numbered through, shape (2, sum of S).
    """

    table: dict[str, np.ndarray]
    buffers: Mapping[str, np.ndarray]
    topology: np.ndarray
    leader: np.ndarray
    masses: np.ndarray
    counts: np.ndarray
    ends: np.ndarray

    @classmethod
    def of(cls, bundles: np.ndarray, buffers: Mapping[str, np.ndarray]) -> Bodies:
        """From rows of the table of bundles."""
        table = dict(zip(BUNDLE, bundles.T, strict=True))
        _, leader, topology = np.unique(table["row"], return_index=True, return_inverse=True)
        masses, counts = table["masses"][leader], table["springs"][leader]
        first = np.cumsum(masses) - masses
        row = table["row"][leader]
        lengths = buffers["rows"][ranges(row + 1, masses)] - buffers["rows"][ranges(row, masses)]
        lower = np.repeat(np.arange(masses.sum()), lengths)
        higher = buffers["partners"][ranges(table["partner"][leader], counts)]
        ends = np.stack([lower, higher + np.repeat(first, counts)])
        return cls(table, buffers, topology.ravel(), leader, masses, counts, ends)

    def values(self, name: str, column: str, of_each: np.ndarray, which=None) -> np.ndarray:
        """The packed numbers of some bundles (default all), end to end."""
        starts = self.table[column]
        if which is not None:
            starts = starts[which]
        return self.buffers[name][ranges(starts, of_each)]


@dataclass(frozen=True)
class Lists:
    """The lists of springs of all topologies, and where every mass of every robot goes.

    Attributes:
        slot: Slot of each mass of each robot, end to end.
        home: The user's number of the mass in each slot, -1 for padding.
        slots: Slots of each robot, shape (n,).
        first: First slot of each robot, shape (n,).
        sites: The table of slices, see ``kernels.gather.SITE``.
        neighbours: Rows of neighbours of all topologies, flat.
        rows: Rows of coefficients of all robots.
        cells: Where the coefficients of both ends of each spring of each robot go.
    """

    slot: np.ndarray
    home: np.ndarray
    slots: np.ndarray
    first: np.ndarray
    sites: np.ndarray
    neighbours: np.ndarray
    rows: int
    cells: np.ndarray

    @classmethod
    def of(cls, bodies: Bodies, features: GatherFeatures, along_curve: bool) -> Lists:
        """Lay out masses and springs; ``along_curve`` keeps neighbours close in memory."""
        width, topology = features.width, bodies.topology
        padded = -(-bodies.masses // width) * width
        start = np.cumsum(padded) - padded
        slot = _slots(bodies, start, along_curve)
        cells, neighbours, first_row, length = _lists(bodies, slot, start, padded, features)

        # The same for every robot: those of one topology share its lists, not its coefficients.
        slices, slots = padded // width, padded[topology]
        first = np.cumsum(slots) - slots
        rows = np.add.reduceat(length, start // width)[topology]
        row_shift = np.cumsum(rows) - rows
        mass_start = np.cumsum(bodies.masses) - bodies.masses
        spring_start = np.cumsum(bodies.counts) - bodies.counts
        masses, counts = bodies.masses[topology], bodies.counts[topology]
        of_mass = ranges(mass_start[topology], masses)
        own_slot = slot[of_mass] + np.repeat(first - start[topology], masses)
        home = np.full(slots.sum(), -1, np.int64)
        home[own_slot] = ranges(0 * masses, masses)
        of_slice = ranges((start // width)[topology], slices[topology])
        robot = np.repeat(np.arange(len(topology)), slices[topology])
        own_row = first_row[of_slice] + (row_shift - first_row[(start // width)[topology]])[robot]
        of_spring = ranges(spring_start[topology], counts)
        lift = (row_shift - first_row[(start // width)[topology]]) * width
        return cls(
            slot=own_slot,
            home=home,
            slots=slots,
            first=first,
            sites=np.stack([robot, first_row[of_slice], own_row, length[of_slice]], axis=1),
            neighbours=neighbours,
            rows=int(rows.sum()),
            cells=cells[:, of_spring] + np.repeat(lift, counts),
        )


def _slots(bodies: Bodies, start: np.ndarray, along_curve: bool) -> np.ndarray:
    """Slot of each mass of each topology."""
    first = np.cumsum(bodies.masses) - bodies.masses
    topology = np.repeat(np.arange(len(first)), bodies.masses)
    number = ranges(0 * first, bodies.masses)
    degree = np.bincount(bodies.ends.ravel(), minlength=len(number))
    rank, window = number, np.zeros(len(number), np.int64)
    if along_curve:
        curve = np.lexsort((number, _curve(bodies, first, topology), topology))
        rank = np.empty(len(number), np.int64)
        rank[curve] = number
        window = rank // WINDOW
    order = np.lexsort((rank, -degree, window, topology))
    slot = np.empty(len(number), np.int64)
    slot[order] = number + np.repeat(start, bodies.masses)
    return slot


def _curve(bodies: Bodies, first: np.ndarray, topology: np.ndarray) -> np.ndarray:
    """Place of each mass along a Z-shaped curve that fills its body's initial bounds."""
    positions = bodies.values("positions", "state", 3 * bodies.masses, bodies.leader)
    positions = positions.reshape(-1, 3).astype(np.float64)
    low = np.minimum.reduceat(positions, first, axis=0)[topology]
    high = np.maximum.reduceat(positions, first, axis=0)[topology]
    extent = (high - low).max(axis=1, keepdims=True)
    share = (positions - low) / np.where(extent > 0.0, extent, 1.0)
    return place_on_curve(share)


def _lists(bodies: Bodies, slot, start, padded, features: GatherFeatures):
    """Cells of both ends of each spring, (2, S); the neighbours of all cells; first row and length
    of each slice."""
    width, together = features.width, features.together
    here, there = slot[bodies.ends].ravel(), slot[bodies.ends[::-1]].ravel()
    degree = np.bincount(here, minlength=padded.sum())
    length = -(-degree.reshape(-1, width).max(axis=1) // together) * together
    first_row = np.cumsum(length) - length

    ordered = np.argsort(here, kind="stable")  # by slot, then in the order of the springs
    rank = np.empty(len(here), np.int64)
    rank[ordered] = ranges(0 * degree, degree)
    row = first_row[here // width] + rank - rank % together
    cells = row * width + (here % width) * together + rank % together

    # Everybody is his own neighbour, until told otherwise.
    own = np.repeat(ranges(0 * padded, padded), together).reshape(len(length), -1)
    neighbours = 4 * np.repeat(own, length // together, axis=0).ravel()
    base = np.tile(np.repeat(start, bodies.counts), 2)
    neighbours[cells] = 4 * (there - base)
    return cells.reshape(2, -1), neighbours.astype(np.int32), first_row, length


def arrays(bodies: Bodies, lists: Lists, features: GatherFeatures) -> dict[str, np.ndarray]:
    """What the kernels read and write, by name: ``kernels.gather.MODEL`` and ``STATE``, flat."""
    table, n = bodies.table, len(bodies.topology)
    masses, one = bodies.masses[bodies.topology], np.ones(n, np.int64)
    chunks, first_chunk, chunk_count = _chunks(lists)
    robots = [
        lists.first,
        masses,
        table["state"] - table["state"].min(),
        table["lane"] - table["lane"].min(),
        first_chunk,
        chunk_count,
        np.cumsum(table["times"] + 1) - (table["times"] + 1),
        table["times"],
        np.full(n, table["times"].max()),
    ]
    positions = bodies.values("positions", "state", 3 * masses).reshape(-1, 3)
    quads = np.zeros((len(lists.home), 4), positions.dtype)
    quads[lists.slot, :3] = positions
    quads[lists.slot, 3] = bodies.values("inverse_masses", "mass", masses)

    def by_lane(name: str, column: str = "state", columns: int = 3) -> np.ndarray:
        values = bodies.values(name, column, columns * masses).reshape(-1, columns)
        return _by_lane(values, lists, features)

    mixed, traits = {}, features.traits
    coefficients = _coefficients(bodies, lists, features)
    own = {"obstacles": bodies.buffers["obstacles"], "heights": bodies.buffers["heights"]}
    if traits.skin:
        own["skins"] = by_lane("skins", "skin")
    if traits.bound:
        own["bonds"] = by_lane("bonds", "bond", 10)
    if traits.outer:
        own |= _outer(bodies, lists, features)
    own |= _of_ends(bodies, lists, features)
    if traits.dashpots:
        own["rates"] = own["middle_rates"] = np.zeros(4 * len(lists.home))
    if features.precision == "mixed":
        for name in ("low_positions", "low_velocities"):
            mixed[name] = mixed[f"good_{name}"] = by_lane(name)
        mixed["quanta"] = bodies.values("quanta", "lane", one)
        mixed["origins"] = bodies.buffers["origins"][ranges(3 * table["lane"], 3 * one)]
        mixed["shifts"] = np.zeros(3 * n)
    if traits.colliding:
        own |= collision_arrays(bodies, lists)
    waves = bodies.buffers["oscillators"][ranges(4 * table["lane"], 4 * one)].reshape(n, 4)
    return {
        "robots": np.stack(robots, axis=1),
        "slices": lists.sites,
        "chunks": chunks,
        "neighbours": lists.neighbours,
        "coefficients": coefficients,
        "homes": _homes(lists, features),
        "omegas": bodies.values("omegas", "lane", one),
        "turns": waves[:, 2:],
        "reaches2": bodies.values("reaches2", "lane", one),
        "positions": np.stack([quads, quads]),
        "velocities": by_lane("velocities"),
        "good_positions": by_lane("positions"),
        "good_velocities": by_lane("velocities"),
        "rests": np.zeros(max(1, features.obstacles) * len(lists.home)),
        "ledgers": np.zeros(len(ACCOUNTS) * len(lists.home)),
        "good_ledgers": np.zeros(len(ACCOUNTS) * len(lists.home)),
        "oscillators": np.stack([waves[:, :2], waves[:, :2]]),
        "states": bodies.values("states", "lane", one),
        "state_times": np.zeros(n),
        "flags": np.zeros(2 * n, np.int32),
        **mixed,
        **own,
    }


def _by_lane(values: np.ndarray, lists: Lists, features: GatherFeatures) -> np.ndarray:
    """Values (masses, n) as [slice][n][lane]; padding is zero."""
    width = features.width
    table = np.zeros((len(lists.home) // width, values.shape[1], width), values.dtype)
    lane = np.array(lane_order(features))[lists.slot % width]
    table[lists.slot // width, :, lane] = values
    return table


def _outer(bodies: Bodies, lists: Lists, features: GatherFeatures) -> dict[str, np.ndarray]:
    """Pushes and tethers of each mass, in rows for each slice, as the springs are."""
    table, width = bodies.table, features.width
    counts = table["pushes"] + table["tethers"]
    masses = bodies.masses[bodies.topology]
    mass = bodies.buffers["outer_masses"][ranges(table["outer_list"], counts)]
    slot = lists.slot[mass + np.repeat(np.cumsum(masses) - masses, counts)]
    is_tether = ranges(0 * counts, counts) >= np.repeat(table["pushes"], counts)
    each = bodies.buffers["outer_values"][ranges(table["outer"], 5 * counts)].reshape(-1, 5)
    each = np.concatenate([each, is_tether[:, None]], axis=1)
    windows = bodies.buffers["outer_windows"][ranges(table["window"], 2 * counts)].reshape(-1, 2)

    per_slot = np.bincount(slot, minlength=len(lists.home))
    length = per_slot.reshape(-1, width).max(axis=1)
    first_row = np.cumsum(length) - length
    rank = np.empty(len(slot), np.int64)
    rank[np.argsort(slot, kind="stable")] = ranges(0 * per_slot, per_slot)
    row, lane = first_row[slot // width] + rank, np.array(lane_order(features))[slot % width]
    found = {"outer_sites": np.stack([first_row, length], axis=1)}
    for name, values in {"outer_values": each, "outer_windows": windows}.items():
        found[name] = np.zeros((length.sum(), values.shape[1], width))
        found[name][row, :, lane] = values
    return found


def _homes(lists: Lists, features: GatherFeatures) -> np.ndarray:
    """The user's number of the mass of each slot, lane by lane."""
    home = lists.home.reshape(-1, features.width)
    table = np.empty_like(home)
    table[:, lane_order(features)] = home
    return table


def _coefficients(bodies: Bodies, lists: Lists, features: GatherFeatures) -> np.ndarray:
    """Coefficients of both ends of all springs; see ``_by_end``."""
    columns = features.traits.columns(features.actuated)
    values = bodies.values("coefficients", "spring", columns * bodies.counts[bodies.topology])
    nothing = np.zeros(columns)
    nothing[0] = 1.0  # a spring that does not pull
    if features.traits.limits:
        nothing[-2:] = np.inf
    return _by_end(values, nothing, lists, features)


def _of_ends(bodies: Bodies, lists: Lists, features: GatherFeatures) -> dict[str, np.ndarray]:
    """What the ends of springs have besides their coefficients; see ``_by_end``."""
    counts, traits, found = bodies.counts[bodies.topology], features.traits, {}

    def add(name: str, column: str, nothing: list[float]) -> None:
        values = bodies.values(name, column, len(nothing) * counts)
        found[name] = _by_end(values, np.array(nothing), lists, features)

    if traits.own_omegas:
        add("spring_omegas", "own_omega", [0.0])
        add("spring_oscillators", "turning", [0.0, 1.0, 1.0, 0.0])
    if traits.limits:
        for name, (column, nothing) in WEAR.items():
            add(name, column, nothing)
    if traits.timetable:
        found["times"] = bodies.values("times", "time", bodies.table["times"] + 1)
        schedules = _schedules(bodies)
        nothing = np.tile([1.0, 0.0], schedules.shape[1] // 2)
        found["schedules"] = _by_end(schedules, nothing, lists, features)
    return found


def _schedules(bodies: Bodies) -> np.ndarray:
    """The schedules of all springs, with room for the longest one's times, (sum of S, 2 T)."""
    times, counts = bodies.table["times"], bodies.counts[bodies.topology]
    first = np.cumsum(counts) - counts
    table = np.zeros((counts.sum(), 2 * times.max()))
    for length in np.unique(times):
        which = np.flatnonzero(times == length)
        values = bodies.values("schedules", "schedule", 2 * length * counts[which], which)
        table[ranges(first[which], counts[which]), : 2 * length] = values.reshape(-1, 2 * length)
    return table


def _by_end(
    values: np.ndarray, nothing: np.ndarray, lists: Lists, features: GatherFeatures
) -> np.ndarray:
    """Values (sum of S, n) at both ends of each spring: [row][n][lane] for registers, else
    [row][slot][n]; ``nothing`` (n,) where there is no spring."""
    width, columns = features.width, len(nothing)
    table = np.tile(nothing.astype(values.dtype), (lists.rows * width, 1))
    for cells in lists.cells:
        table[cells] = values.reshape(-1, columns)
    if not features.vector:
        return table
    lanes = np.empty((lists.rows, columns, width), values.dtype)
    lanes[:, :, lane_order(features)] = table.reshape(-1, width, columns).transpose(0, 2, 1)
    return lanes


def worn_springs(
    values: np.ndarray, columns: int, lists: Lists, features: GatherFeatures
) -> np.ndarray:
    """The values of each spring, from those of its ends: what ``_by_end`` laid out, flat."""
    width = features.width
    if features.vector:
        lanes = values.reshape(lists.rows, columns, width)[:, :, lane_order(features)]
        values = lanes.transpose(0, 2, 1)
    return values.reshape(-1, columns)[lists.cells[0]].ravel()


def half_rest_places(lists: Lists, features: GatherFeatures) -> np.ndarray:
    """Where ``h`` of both ends of each spring is among the coefficients, (2, S), see above."""
    width, columns = features.width, features.traits.columns(features.actuated)
    if not features.vector:
        return columns * lists.cells + 1
    row, slot = np.divmod(lists.cells, width)
    return (row * columns + 1) * width + np.array(lane_order(features))[slot]


def _chunks(lists: Lists) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The table of chunks; first chunk and number of chunks of each robot."""
    count = -(-lists.slots // CHUNK_SLOTS)
    first = np.cumsum(count) - count
    robot = np.repeat(np.arange(len(count)), count)
    inner = CHUNK_SLOTS * ranges(0 * count, count)
    size = np.minimum(CHUNK_SLOTS, lists.slots[robot] - inner)
    return np.stack([robot, lists.first[robot] + inner, size], axis=1), first, count
