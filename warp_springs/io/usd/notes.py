"""What a stage says of itself in its custom data: parameters, versions, statuses, fitness."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_springs import __version__

if TYPE_CHECKING:
    from warp_springs.io.usd.layout import Track
    from warp_springs.result import Result

_MOST_VALUES = 1024
"""Numbers of an array of the scene that are written out: a terrain's heights are in its mesh."""


def provenance(result: Result) -> dict[str, Any]:
    """The version and every parameter of the simulation."""
    parameters = {
        "version": __version__,
        "dt": result.dt,
        "integrator": result.integrator,
        "precision": result.precision,
        "device": result.device,
        "startTime": float(result.times[0]),
        "endTime": float(result.times[-1]),
        "scene": _plain(result.scene),
    }
    return usd_dict(parameters, "result")


def facts(result: Result, item: Track, scale: float) -> dict[str, Any]:
    """What the file itself says of a robot; the scale [N] is that of its stress colours."""
    from warp_springs.stability import Status

    robot, status = result.robots[item.index], Status(int(result.status[item.index]))
    found = {
        "index": item.index,
        "status": status.name,
        "stressScale": scale,
        "masses": robot.n_masses,
        "springs": robot.n_springs,
        "mass": robot.mass,
        "omega": robot.omega,
    }
    if status:
        found["statusTime"] = float(result.status_time[item.index])
    if item.held_frames:
        found["heldFrames"] = item.held_frames
    return found


def usd_dict(data: Mapping[str, Any], where: str) -> dict[str, Any]:
    """A dict of what USD can hold; None is left out.

    Raises:
        ValueError: A key is no string, or a value is not finite or of a type that USD has not.
    """
    converted = {}
    for key, value in data.items():
        if not isinstance(key, str) or not key:
            raise ValueError(f"{where}: got the key {key!r}, expected a name")
        if value is not None:
            converted[key] = _usd_value(value, f"{where}[{key!r}]")
    return converted


def _usd_value(value: Any, where: str) -> Any:
    if isinstance(value, Mapping):
        return usd_dict(value, where)
    if isinstance(value, str):
        return str(value)
    array = np.asarray(value)
    if array.ndim > 1 or array.dtype.kind not in "biufU":
        raise ValueError(
            f"{where}: got {value!r}, expected a number, a string, a boolean, a flat sequence of "
            "one of these, or a dict"
        )
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"{where}: got {value!r}, expected finite numbers")
    if array.dtype.kind in "iu" and (np.abs(array.astype(np.float64)) >= 2.0**63).any():
        raise ValueError(f"{where}: got {value!r}, expected integers of at most 63 bits")
    return array.item() if array.ndim == 0 else _vt_array(array)


def _vt_array(array: np.ndarray) -> Any:
    """A flat array as USD's own type: metadata of a layer take no lists."""
    from pxr import Vt

    kinds = {"f": Vt.DoubleArray, "i": Vt.Int64Array, "u": Vt.Int64Array, "b": Vt.BoolArray}
    return kinds.get(array.dtype.kind, Vt.StringArray)(array.tolist())


def _plain(value: Any) -> Any:
    """Data classes as dicts with their kind, sequences of them as dicts by number."""
    if dataclasses.is_dataclass(value):
        fields = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, tuple) and any(map(dataclasses.is_dataclass, value)):
        return {f"{i:03d}": _plain(item) for i, item in enumerate(value)}
    if isinstance(value, np.ndarray):
        shape = {"shape": list(value.shape)}
        return shape if value.size > _MOST_VALUES else shape | {"values": value.ravel()}
    return None if isinstance(value, tuple) and not value else value
