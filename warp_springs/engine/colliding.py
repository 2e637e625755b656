"""What of a body can collide: its triangles, their edges, and who belongs together."""

from __future__ import annotations

import numpy as np

from warp_springs.kernels.contact import GRIP, GRIPS
from warp_springs.robot import Robot
from warp_springs.scene import Collisions

__all__ = ["PACKED_COLLISIONS", "busiest", "collision_buffers", "collision_counts", "no_grips"]

#: Buffers of collisions, and the columns of the table of bundles that say where.
PACKED_COLLISIONS = {
    "triangles": "triangle",
    "edges": "edge",
    "bodies": "body",
    "near_rows": "near_row",
    "nears": "near",
    "pair_lists": "pair_list",
    "grip_partners": "grip_partner",
    "grips": "grip",
    "listed_positions": "listed",
    "contacts": "contact",
}

#: The part of the median length of its springs that surfaces keep as distance.
THICKNESS = 0.04
#: Pairs that the list of candidates has room for, for each feature that may collide.
ROOM = 24


def surface_edges(robot: Robot) -> np.ndarray:
    """Edges of the triangles of a body, each once, shape (E, 2); its springs if it has no faces."""
    if len(robot.faces) == 0:
        return np.asarray(robot.springs)
    sides = np.concatenate([robot.faces[:, [0, 1]], robot.faces[:, [1, 2]], robot.faces[:, [2, 0]]])
    return np.unique(np.sort(sides, axis=1), axis=0)


def company(robot: Robot) -> tuple[int, int]:
    """How many pairs touch at once where a corner meets a corner, or the middle of an edge.

    Each corner meets the triangles around the other, and all edges of one meet all of the other. An
    edge has the triangles on both sides, and meets all edges of the corner. The busiest corners of
    the robot or world are counted, as if they met their like.
    """
    masses = robot.n_masses
    triangles = np.bincount(robot.faces.ravel(), minlength=masses)
    edges = np.bincount(surface_edges(robot).ravel(), minlength=masses)
    t, e = int(triangles.max(initial=0)), int(edges.max(initial=0))
    return max(1, 2 * t + e * e), max(1, 2 + e)


def busiest(robot: Robot) -> float:
    """Pairs that may push one mass at once, each by its weight: at most about so many.

    At a corner that meets its like, see `company`; or where a mesh lies on a coarser one: on the
    triangles around a mass, a third of the masses that fit there at the distance of the shortest
    edge; on the edges, half of three that cross them at every such distance.
    """
    edges, masses = surface_edges(robot), robot.n_masses
    corners, beside = company(robot)
    if len(edges) == 0:
        return float(corners)
    lengths = np.linalg.norm(robot.positions[edges[:, 1]] - robot.positions[edges[:, 0]], axis=1)
    finer = min(masses, lengths.max() / max(lengths.min(), np.finfo(float).tiny))
    triangles = np.bincount(robot.faces.ravel(), minlength=1).max()
    lying = 1.0 + triangles * min(finer**2 / 2, masses) / 3 + (beside - 2) * 1.5 * finer
    return max(float(corners), lying)


def no_grips(features: int, grips: int) -> np.ndarray:
    """For each feature its partners in friction, none, and whether it needed them, not."""
    return np.tile(np.repeat(np.array([-1, 0], np.int32), grips), features)


def collision_counts(robot: Robot) -> dict[str, int]:
    """Columns of the table of bundles that count."""
    edges, triangles = len(surface_edges(robot)), len(robot.faces)
    features = robot.n_masses + triangles + edges
    return {"triangles": triangles, "edges": edges, "capacity": ROOM * features}


def collision_buffers(
    robot: Robot, bodies: np.ndarray, collisions: Collisions
) -> dict[str, np.ndarray]:
    """The buffers of the collisions of one robot, or of one world.

    Args:
        robot: All bodies as one.
        bodies: The body of each mass, shape (M,).
        collisions: How they collide.
    """
    edges, masses = surface_edges(robot), robot.n_masses
    ends = np.concatenate([robot.springs, robot.springs[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    rows = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=masses))])
    median = float(np.median(robot.lengths)) if robot.n_springs else 0.0
    thickness = collisions.thickness or THICKNESS * median
    features = masses + len(robot.faces) + len(edges)
    pairs = np.zeros(1 + features + 2 * ROOM * features, np.int32)
    pairs[0] = -1  # not looked up yet
    pairs[1 : 1 + features] = np.arange(features)
    contact = (
        thickness,
        collisions.stiffness,
        collisions.static_friction,
        collisions.kinetic_friction,
        collisions.damping,
        float(collisions.within),
        *company(robot),
    )
    return {
        "triangles": robot.faces.ravel(),
        "edges": edges.ravel(),
        "bodies": bodies,
        "near_rows": rows,
        "nears": ends[:, 1],
        "pair_lists": pairs,
        "grip_partners": no_grips(features, GRIPS),
        "grips": np.zeros(GRIP * GRIPS * features),
        "listed_positions": np.zeros(3 * masses),
        "contacts": np.array(contact),
    }
