"""Which features of two balls are near each other? The tree of ``warp_springs`` and Warp's own.

Everybody gets the same positions, on one thread: the boxes of all masses, triangles and edges are
made anew, and for every feature all of another body that it may meet within the same reach are
listed. ``wp.Bvh`` is once built anew and once refitted; ``wp.HashGrid`` holds the middles of the
boxes and is asked for all within reach and the size of the largest box. All must find the same
pairs.
"""

import functools
import time
from collections.abc import Callable

import numpy as np
import warp as wp

import warp_springs as ws
from warp_springs.engine.colliding import surface_edges
from warp_springs.kernels.crowd_collisions import MARGIN

__all__ = ["compare"]

#: Room for the partners of a feature in the lists of all.
ROOM = 32
REPEATS = 7


@wp.kernel
def make_boxes(
    points: wp.array(dtype=wp.vec3),
    corners: wp.array2d(dtype=wp.int32),
    lows: wp.array(dtype=wp.vec3),
    highs: wp.array(dtype=wp.vec3),
    middles: wp.array(dtype=wp.vec3),
):
    f = wp.tid()
    low = points[corners[f, 0]]
    high = points[corners[f, 0]]
    for c in range(1, 3):
        low = wp.min(low, points[corners[f, c]])
        high = wp.max(high, points[corners[f, c]])
    lows[f] = low
    highs[f] = high
    middles[f] = 0.5 * (low + high)


@wp.func
def keep(
    f: int,
    g: int,
    found: int,
    kinds: wp.array(dtype=wp.int32),
    bodies: wp.array(dtype=wp.int32),
    partners: wp.array2d(dtype=wp.int32),
):
    """The number of partners, with g if it may meet f."""
    if kinds[f] + kinds[g] != 4 or bodies[f] == bodies[g]:
        return found
    if found < ROOM:
        partners[f, found] = g
    return found + 1


@wp.kernel
def ask_tree(
    tree: wp.uint64,
    lows: wp.array(dtype=wp.vec3),
    highs: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    kinds: wp.array(dtype=wp.int32),
    bodies: wp.array(dtype=wp.int32),
    partners: wp.array2d(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    f = wp.tid()
    wide = wp.vec3(reach, reach, reach)
    query = wp.bvh_query_aabb(tree, lows[f] - wide, highs[f] + wide)
    found = wp.int32(0)
    g = wp.int32(0)
    while wp.bvh_query_next(query, g):
        found = keep(f, g, found, kinds, bodies, partners)
    counts[f] = found


@wp.kernel
def ask_grid(
    grid: wp.uint64,
    lows: wp.array(dtype=wp.vec3),
    highs: wp.array(dtype=wp.vec3),
    middles: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    radius: wp.float32,
    kinds: wp.array(dtype=wp.int32),
    bodies: wp.array(dtype=wp.int32),
    partners: wp.array2d(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    f = wp.tid()
    found = wp.int32(0)
    wide = wp.vec3(reach, reach, reach)
    low = lows[f] - wide
    high = highs[f] + wide
    for g in wp.hash_grid_query(grid, middles[f], radius):
        above = wp.min(highs[g] - low)
        below = wp.min(high - lows[g])
        if above >= 0.0 and below >= 0.0:
            found = keep(f, g, found, kinds, bodies, partners)
    counts[f] = found


def compare(robots: list[ws.Robot]) -> dict:
    """Time of making all lists once, each way [µs], for bodies that touch."""
    scene = ws.Scene(gravity=(0, 0, 0), ground=None, collisions=ws.Collisions(within=False))
    simulation = ws.Simulation(
        robots, scene, 1e-6, world="together", layout="flat", precision="float32", threads=1
    )
    simulation.run(2e-6)
    ours, count = _ours(simulation)
    world, members = simulation.robots[0], simulation.members[0]
    body = np.repeat(np.arange(len(members)), [place.stop - place.start for _, place in members])
    others = _others(world, body, simulation)
    row = {"faces": len(world.faces), "pairs": count // 2, "own tree [µs]": 1e6 * _best(ours)}
    for name, (make, counts) in others.items():
        row[f"{name} [µs]"] = 1e6 * _best(make)
        if int(counts.numpy().sum()) != count:
            raise SystemExit(f"{name} found {counts.numpy().sum()} pairs, not {count}")
    own = row["own tree [µs]"]
    row |= {f"{name} / own": row[f"{name} [µs]"] / own for name in others}
    return row


def _best(make: Callable[[], None]) -> float:
    """The shortest of some runs [s]; the first one compiles."""
    seconds = []
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        make()
        seconds.append(time.perf_counter() - started)
    return min(seconds[1:])


def _ours(simulation: ws.Simulation) -> tuple[Callable[[], None], int]:
    """What makes the lists of the simulation anew, and how many partners they hold."""
    (crowd,) = simulation._slices
    state = crowd._given["state"]
    steps = {launch.kernel.key: launch for launch in crowd._look}
    for launch in (steps["fit"], steps["list"]):
        launch.set_param_by_name("wanted", crowd._chosen(None))
        launch.set_param_by_name("side", 0)

    def make() -> None:
        state.stale.fill_(1)
        steps["fit"].launch()
        steps["list"].launch()

    make()
    return make, int(state.partner_counts.numpy().sum())


def _others(world: ws.Robot, body: np.ndarray, simulation: ws.Simulation) -> dict:
    """What makes the lists by Warp's own means, and the counts that it leaves."""
    edges = surface_edges(world)
    masses = np.repeat(np.arange(world.n_masses), 3).reshape(-1, 3)
    corners = np.concatenate([masses, world.faces, edges[:, [0, 1, 1]]]).astype(np.int32)
    sizes = [len(masses), len(world.faces), len(edges)]
    kinds = np.repeat(np.array([1, 3, 2], np.int32), sizes)
    n = len(corners)
    points = wp.array(world.positions.astype(np.float32), dtype=wp.vec3)
    table, lows, highs, middles = wp.array(corners), *(wp.zeros(n, wp.vec3) for _ in range(3))
    reach = float(simulation._buffers["contacts"][0]) * (1 + MARGIN)
    about = [wp.array(kinds), wp.array(body[corners[:, 0]].astype(np.int32))]
    boxes = functools.partial(
        wp.launch, make_boxes, n, inputs=[points, table], outputs=[lows, highs, middles]
    )
    boxes()
    tree = wp.Bvh(lows, highs)
    size = float(np.linalg.norm(highs.numpy() - lows.numpy(), axis=1).max())
    grid = wp.HashGrid(64, 64, 64)
    radius = size + 3**0.5 * reach

    def lists() -> list[wp.array]:
        return [wp.zeros((n, ROOM), dtype=wp.int32), wp.zeros(n, dtype=wp.int32)]

    built, refitted, gridded = lists(), lists(), lists()

    def ask(by: wp.Bvh, found: list[wp.array]) -> None:
        wp.launch(ask_tree, n, inputs=[by.id, lows, highs, reach, *about], outputs=found)

    def build() -> None:
        boxes()
        ask(wp.Bvh(lows, highs), built)

    def refit() -> None:
        boxes()
        tree.refit()
        ask(tree, refitted)

    def hash_all() -> None:
        boxes()
        grid.build(middles, radius)
        given = [grid.id, lows, highs, middles, reach, radius, *about]
        wp.launch(ask_grid, n, inputs=given, outputs=gridded)

    return {
        "wp.Bvh built": (build, built[1]),
        "wp.Bvh refitted": (refit, refitted[1]),
        "wp.HashGrid": (hash_all, gridded[1]),
    }
