"""Elements of robots as the flat arrays that the kernels read, as pure NumPy functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_springs.body.elements import NONE, Elements
from warp_springs.body.variants import Variants
from warp_springs.kernels.traits import PLAIN, Traits
from warp_springs.robot import Robot

__all__ = [
    "PACKED_ELEMENTS",
    "SHARED_ELEMENTS",
    "element_buffers",
    "element_counts",
    "element_fields",
    "element_lists",
    "spring_columns",
    "traits_of",
]

#: Buffers with values of each robot, and the columns of the table of bundles that say where.
PACKED_ELEMENTS = {
    "outer_values": "outer",
    "outer_windows": "window",
    "skins": "skin",
    "bonds": "bond",
    "spring_omegas": "own_omega",
    "spring_oscillators": "turning",
    "schedules": "schedule",
    "worn": "worn",
    "broken_at": "broken",
}
#: Buffers with lists that robots of one structure share, likewise.
SHARED_ELEMENTS = {"outer_masses": "outer_list", "spring_starts": "spring_list", "times": "time"}


def traits_of(elements: Elements) -> Traits:
    """What the kernel of a robot with these elements must be able to do."""
    if elements is NONE:
        return PLAIN
    return Traits(
        outer=bool(elements.pushes or elements.tethers),
        skin=elements.contact is not None,
        bound=len(elements.bonds) > 0,
        harmonics=0 if elements.harmonics is None else elements.harmonics.shape[1],
        own_omegas=elements.omegas is not None,
        curved=any(x is not None for x in (elements.slope, elements.cubic, elements.hinges)),
        hinges=0 if elements.hinges is None else elements.hinges.shape[1],
        dashpots=elements.dashpot is not None,
        limits=elements.breaks is not None or elements.yields is not None,
        timetable=elements.timetable is not None,
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
    if "dashpot" in found:
        i, j = first.springs.T
        w = 1.0 / dense["masses"]
        critical = 2.0 * np.sqrt(dense["stiffness"] / (w[:, i] + w[:, j]))
        found["damping"] = found["dashpot"] * critical  # N s/m
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
    if elements.timetable is not None:
        found["factors"], found["offsets"] = elements.timetable.factors, elements.timetable.offsets
    return found


def element_lists(elements: Elements) -> dict[str, np.ndarray]:
    """Lists that all robots of one structure share."""
    pushed = [mass for push in elements.pushes for mass in push.masses]
    tethered = [tether.mass for tether in elements.tethers]
    table = elements.timetable
    return {
        "outer_masses": np.array(pushed + tethered, np.int32),
        "times": np.zeros(0) if table is None else np.append(table.times, table.period),
    }


def element_counts(elements: Elements) -> dict[str, int]:
    """Columns of the table of bundles that count."""
    return {
        "pushes": sum(len(push.masses) for push in elements.pushes),
        "tethers": len(elements.tethers),
        "times": 0 if elements.timetable is None else len(elements.timetable.times),
    }


def element_buffers(
    fields: dict[str, np.ndarray], order: np.ndarray | slice, spans: np.ndarray
) -> dict[str, np.ndarray]:
    """Values of the buffers of ``PACKED_ELEMENTS`` for a strip, its robots end to end.

    ``order`` sorts its springs, ``spans`` are the drifts of its robots [s], shape (n,).
    """
    found = {}
    if "outer" in fields:
        found |= {"outer_values": fields["outer"], "outer_windows": fields["windows"]}
    if "contact" in fields:
        skin = fields["contact"]
        found["skins"] = np.where(np.isnan(skin), -1.0, skin)
    if "bond_table" in fields:
        found["bonds"] = fields["bond_table"]
    stiffness = fields["stiffness"][order]
    each = len(stiffness) // max(len(spans), 1)
    if "omegas" in fields:
        given, common = fields["omegas"][order], np.repeat(fields["omega"], each)
        omegas = np.where(np.isnan(given), common, given)
        turn = omegas * np.repeat(spans, each)
        found["spring_omegas"] = omegas
        start = np.stack([0.0 * turn, 0.0 * turn + 1.0, np.cos(turn), np.sin(turn)], axis=1)
        found["spring_oscillators"] = start
    if "factors" in fields:
        half = 0.5 * stiffness[:, None] * fields["offsets"][order]
        found["schedules"] = np.stack([fields["factors"][order], half], axis=-1)
    if "breaks" in fields or "yields" in fields:
        found["worn"] = np.tile([0.0, 1.0], (len(stiffness), 1))
        found["broken_at"] = np.full(len(stiffness), np.nan)
    return found


def spring_columns(fields: dict[str, np.ndarray], order: np.ndarray | slice) -> np.ndarray:
    """What follows the coefficients of the sorted springs, shape (total, ...); see the kernels."""
    k = fields["stiffness"][order]
    none = np.zeros_like(k)
    columns = []
    if "harmonics" in fields:
        half, (size, phase) = 0.5 * k[:, None], np.moveaxis(fields["harmonics"][order], -1, 0)
        parts = np.stack([half * size * np.cos(phase), half * size * np.sin(phase)], axis=-1)
        columns += list(parts.reshape(len(k), -1).T)
    if {"slope", "cubic", "hinges"} & fields.keys():
        columns.append(fields["slope"][order] if "slope" in fields else none + 1.0)
        columns.append(fields["cubic"][order] / k if "cubic" in fields else none)
        if "hinges" in fields:
            columns += list(fields["hinges"][order].reshape(len(k), -1).T)
    if "dashpot" in fields:
        columns.append(fields["damping"][order])
    if {"breaks", "yields"} & fields.keys():
        for name in ("breaks", "yields"):
            columns.append(fields[name][order] if name in fields else none + np.inf)
    return np.stack(columns, axis=1) if columns else np.zeros((len(k), 0))
