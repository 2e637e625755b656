"""Packing of what collides in a crowd: features, the tree of their boxes, who gathers from whom."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_springs.engine.colliding import no_grips
from warp_springs.engine.curve import along_curve, ranges
from warp_springs.kernels.contact import CROWD_GRIPS, GRIP, NUMBERS
from warp_springs.kernels.crowd_collisions import MEETING, ROOM

if TYPE_CHECKING:
    from warp_springs.engine.gathering import Bodies, Lists

__all__ = ["collision_arrays"]


def collision_arrays(bodies: Bodies, lists: Lists) -> dict[str, np.ndarray]:
    """What the kernels read and write for collisions, by name; see ``kernels.gather``."""
    table, buffers, n = bodies.table, bodies.buffers, len(bodies.topology)
    masses = bodies.masses[bodies.topology]
    mass_start = np.cumsum(masses) - masses
    counts = np.zeros((4, n), np.int64)  # features, nodes, rows of neighbours, neighbours
    meetings, rows, leaves = np.zeros((n, len(MEETING)), np.int64), [], []
    near = {"near_rows": [], "nears": []}
    for i in range(n):
        m = int(masses[i])
        corners = _corners(table, buffers, i, m)
        here = slice(mass_start[i], mass_start[i] + m)
        slot = np.append(lists.slot[here] - lists.first[i], -1)
        body = _part(buffers["bodies"], table["body"][i], m)
        x = _part(buffers["positions"], table["state"][i], 3 * m).reshape(-1, 3)
        first = counts[:, i].copy()
        leaf, size = _leaves(_order(x.astype(np.float64), body, corners), corners)
        of_leaf = np.full(size, -1)
        of_leaf[leaf] = first[0] + np.arange(len(leaf))
        near_row = _part(buffers["near_rows"], table["near_row"][i], m + 1)
        near["near_rows"].append(near_row)
        near["nears"].append(_part(buffers["nears"], table["near"][i], int(near_row[-1])))
        sizes = [len(corners), 2 * size, m + 1, int(near_row[-1])]
        if i + 1 < n:
            counts[:, i + 1] = first + sizes
        triangles = table["triangles"][i]
        meetings[i] = [first[0], m, triangles, first[1], size, first[2], first[3], len(corners)]
        about = [np.full(len(corners), i), (corners >= 0).sum(axis=1)]
        rows.append(np.column_stack([*about, slot[corners], body[corners[:, 0]], leaf, corners]))
        leaves.append(of_leaf)
    features = np.concatenate(rows)
    nodes = 2 * sum(map(len, leaves))
    return {
        "features": features,
        "meetings": meetings,
        "leaf_features": np.concatenate(leaves),
        "near_rows": np.concatenate(near["near_rows"]),
        "nears": np.concatenate(near["nears"]),
        "contacts": buffers["contacts"][ranges(table["contact"], np.full(n, len(NUMBERS)))],
        **_gathered(features, lists),
        "boxes": np.zeros(6 * nodes),
        "partners": np.zeros(ROOM * len(features), np.int32),
        "partner_counts": np.zeros(len(features), np.int32),
        "fitted_positions": np.full(4 * len(lists.home), np.nan),  # not yet
        "stale": np.zeros(n, np.int32),
        "touched": np.zeros(len(features), np.int32),
        "grip_partners": no_grips(len(features), CROWD_GRIPS),
        "grips": np.zeros(GRIP * CROWD_GRIPS * len(features)),
        "feature_forces": np.zeros(12 * len(features)),
    }


def _part(buffer: np.ndarray, start: int, count: int) -> np.ndarray:
    return buffer[start : start + count]


def _corners(table: dict, buffers, i: int, masses: int) -> np.ndarray:
    """The masses of each feature of a robot, as the user counts them, -1 for none, (n, 3)."""
    triangles, edges = int(table["triangles"][i]), int(table["edges"][i])
    corners = np.full((masses + triangles + edges, 3), -1, np.int64)
    corners[:masses, 0] = np.arange(masses)
    faces = _part(buffers["triangles"], table["triangle"][i], 3 * triangles)
    corners[masses : masses + triangles] = faces.reshape(-1, 3)
    sides = _part(buffers["edges"], table["edge"][i], 2 * edges)
    corners[masses + triangles :, :2] = sides.reshape(-1, 2)
    return corners


def _order(x: np.ndarray, body: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Features as the leaves of a tree: bodies together, neighbours in space together."""
    low, high = x.min(axis=0), x.max(axis=0)
    share = (x - low) / np.where(high > low, high - low, 1.0)
    there = corners >= 0
    middle = (share[corners] * there[:, :, None]).sum(axis=1) / there.sum(axis=1)[:, None]
    count = np.bincount(body)
    middles = [np.bincount(body, part) / np.maximum(count, 1) for part in share.T]
    of_body = along_curve(np.stack(middles, axis=1))[body[corners[:, 0]]]
    return np.lexsort((along_curve(middle), body[corners[:, 0]], of_body))


def _leaves(order: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, int]:
    """The leaf of each feature, and how many leaves a tree has, a power of two.

    Masses, triangles and edges have a quarter of it each, since they only look for another kind, or
    for edges: ``kernels.crowd_collisions`` begins at that quarter.
    """
    kind = np.array([0, 0, 2, 1])[(corners >= 0).sum(axis=1)]
    quarter = 1 << int(np.bincount(kind).max() - 1).bit_length()
    leaf = np.empty(len(order), np.int64)
    for number in range(3):
        own = order[kind[order] == number]
        leaf[own] = number * quarter + np.arange(len(own))
    return leaf, 4 * quarter


def _gathered(features: np.ndarray, lists: Lists) -> dict[str, np.ndarray]:
    """For the mass in each slot its features, and which corner of each it is."""
    feature, corner = np.nonzero(features[:, 2:5] >= 0)
    slot = features[feature, 2 + corner] + lists.first[features[feature, 0]]
    order = np.argsort(slot, kind="stable")
    counts = np.bincount(slot, minlength=len(lists.home))
    return {
        "touch_rows": np.append(0, np.cumsum(counts)),
        "touches": (3 * feature + corner)[order],
    }
