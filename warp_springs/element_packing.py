"""Elements of robots as the flat arrays that the kernels read, as pure NumPy functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_springs.elements import NONE, Elements
from warp_springs.kernels.traits import PLAIN, Traits
from warp_springs.robot import Robot
from warp_springs.variants import Variants

__all__ = [
    "PACKED_ELEMENTS",
    "SHARED_ELEMENTS",
    "element_buffers",
    "element_counts",
    "element_fields",
    "element_lists",
    "traits_of",
]

#: Buffers with values of each robot, and the columns of the table of bundles that say where.
PACKED_ELEMENTS = {
    "outer_values": "outer",
    "outer_windows": "window",
    "skins": "skin",
    "bonds": "bond",
}
#: Buffers with lists that robots of one structure share, likewise.
SHARED_ELEMENTS = {"outer_masses": "outer_list"}


def traits_of(elements: Elements) -> Traits:
    """What the kernel of a robot with these elements must be able to do."""
    if elements is NONE:
        return PLAIN
    return Traits(
        outer=bool(elements.pushes or elements.tethers),
        skin=elements.contact is not None,
        bound=len(elements.bonds) > 0,
    )


def element_fields(
    robots: Sequence[Robot] | Variants, dense: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Arrays, axis 0 the robot, of the elements of robots of one structure.

    Among them the positions and velocities of ``dense``, put on the robots' constraints.
    """
    first = robots[0]
    if first.elements is NONE:
        return {}
    if isinstance(robots, Variants):
        body, n = _fields(first.elements, first), len(robots)
        found = {
            name: robots.array(name)
            if name in robots.stacked
            else np.broadcast_to(value, (n, *value.shape))
            for name, value in body.items()
        }
    else:
        parts = [_fields(robot.elements, robot) for robot in robots]
        found = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
    if len(first.elements.bonds):
        x, v = dense["positions"], dense["velocities"]
        if isinstance(robots, Variants):
            put = first.elements.bonds.put(x, v)
        else:
            each = [r.elements.bonds.put(*state) for r, *state in zip(robots, x, v, strict=True)]
            put = [np.stack(values) for values in zip(*each, strict=True)]
        found["positions"], found["velocities"] = put
    return found


def _fields(elements: Elements, robot: Robot) -> dict[str, np.ndarray]:
    """The arrays of one robot."""
    found = dict(elements.arrays)
    forces, points, windows = [], [], []
    for push in elements.pushes:
        forces += [(*push.force, 0.0, 0.0)] * len(push.masses)
        windows += [(push.start, push.end)] * len(push.masses)
    for tether in elements.tethers:
        points.append((*tether.point, tether.stiffness, tether.rest_length))
        windows.append((tether.start, tether.end))
    if windows:
        found["outer"] = np.array(forces + points)
        found["windows"] = np.array(windows)
    if len(elements.bonds):
        bonds = elements.bonds
        table = np.tile([1.0, 1.0, 1.0, *[0.0] * 7], (robot.n_masses, 1))
        p = bonds.projectors
        corner = (p[:, 1, 2], p[:, 0, 2], p[:, 0, 1])
        diagonal = (p[:, 0, 0], p[:, 1, 1], p[:, 2, 2])
        columns = (*diagonal, *corner, *bonds.points.T, bonds.radii)
        table[bonds.masses] = np.stack(columns, axis=1)
        found["bond_table"] = table
    return found


def element_lists(elements: Elements) -> dict[str, np.ndarray]:
    """Lists that all robots of one structure share."""
    pushed = [mass for push in elements.pushes for mass in push.masses]
    tethered = [tether.mass for tether in elements.tethers]
    return {"outer_masses": np.array(pushed + tethered, np.int32)}


def element_counts(elements: Elements) -> dict[str, int]:
    """Columns of the table of bundles that count."""
    return {
        "pushes": sum(len(push.masses) for push in elements.pushes),
        "tethers": len(elements.tethers),
    }


def element_buffers(fields: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Values of the buffers of ``PACKED_ELEMENTS`` for a strip, its robots end to end."""
    found = {}
    if "outer" in fields:
        found |= {"outer_values": fields["outer"], "outer_windows": fields["windows"]}
    if "contact" in fields:
        skin = fields["contact"]
        found["skins"] = np.where(np.isnan(skin), -1.0, skin)
    if "bond_table" in fields:
        found["bonds"] = fields["bond_table"]
    return found
