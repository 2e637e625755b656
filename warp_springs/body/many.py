"""Many robots from arrays laid end to end: checked, frozen and cut into robots at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from warp_springs.body.elements import NONE
from warp_springs.body.fields import FIELDS, check_masses_named, checked, filled
from warp_springs.robot import Robot, made

__all__ = ["many"]


def many(counts: Mapping[str, np.ndarray], fields: Mapping[str, Any], omega: float) -> list[Robot]:
    """N robots of arrays with the rows of one robot after those of the other.

    Args:
        counts: Rows of each robot by what they belong to, ``"mass"``, ``"spring"``, ``"face"``:
            arrays of shape (N,).
        fields: The fields of a robot, each for all of them; springs and faces counted within the
            robot. Those that may be left out may be left out here, but not the rest lengths.
        omega: Angular frequency of the actuation [rad/s], of all.

    Returns:
        What ``Robot`` makes of the rows of each, in a twentieth of the time.

    Raises:
        ValueError: An array is malformed.
    """
    ends = {per: np.cumsum(rows).tolist() for per, rows in counts.items()}
    flat = {}
    for name, field in FIELDS.items():
        if field.per == "robot":
            continue
        shape = (ends[field.per][-1], *field.row)
        given = fields.get(name)
        flat[name] = (
            filled(name, shape) if given is None else checked(name, given, shape, spread=False)
        )
    for name, per in (("springs", "spring"), ("faces", "face")):
        check_masses_named(name, flat[name], np.repeat(counts["mass"], counts[per]))
    omega = checked("omega", omega, ()).item()
    robots, last = [], dict.fromkeys(ends, 0)
    for stops in zip(*ends.values(), strict=True):
        to = dict(zip(ends, stops, strict=True))
        values = {name: flat[name][last[FIELDS[name].per] : to[FIELDS[name].per]] for name in flat}
        robots.append(made(values | {"omega": omega, "materials": ()}, NONE))
        last = to
    return robots
