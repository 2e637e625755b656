"""What the page shows, as a header of plain values and one compressed block of arrays."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_springs.checks import check_number
from warp_springs.io.usd.layout import Track, chosen_robots, placed, track
from warp_springs.stability import Status
from warp_springs.surfaces import Sphere
from warp_springs.view import appearance
from warp_springs.view.palette import material_palette
from warp_springs.view.pictures.solids import obstacle_mesh

if TYPE_CHECKING:
    from warp_springs.result import Result

STEPS_PER_BAR = 64
"""Steps of the grid that positions are rounded to, in a bar's radius."""
LEVELS = 63
"""Shades of a colour on either side of neutral."""
_NO_ACTUATION = 1e-9
"""Share of a rest length below which a change is only rounding."""
_ARROW = 0.5
"""Length of the arrow of the largest push in diameters of its robot."""
_ENDLESS = 1e9
"""Instead of infinity, which JSON has not [s]."""
ENERGIES = ("kinetic", "gravity", "spring", "ground", "residual")
"""The energies that the page plots."""


class Block:
    """Arrays one after the other, compressed as one."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, array: ArrayLike, dtype: str) -> dict[str, Any]:
        """Append an array; returns where the page finds it."""
        values = np.ascontiguousarray(array, dtype=np.dtype(dtype).newbyteorder("<"))
        data = values.tobytes()
        place = {"type": dtype, "start": self._size, "count": values.size}
        self._parts.append(data)
        self._size += len(data)
        return place

    def text(self) -> str:
        """All of it, compressed, as base64."""
        packed = gzip.compress(b"".join(self._parts), compresslevel=9, mtime=0)
        return base64.b64encode(packed).decode()


def described(
    result: Result,
    robots: Iterable[int] | None,
    names: Mapping[int, str],
    notes: Mapping[int, Mapping[str, Any]],
    grid: bool,
    spacing: float | None,
) -> tuple[dict[str, Any], str]:
    """The header and the block of arrays of a page; arguments as in `html_page`."""
    if spacing is not None:
        check_number("spacing", spacing, above=0.0)
    indices = chosen_robots(result, robots)
    for what, given in (("names", names), ("custom_data", notes)):
        if strangers := sorted(set(given) - set(indices)):
            raise ValueError(f"{what}: robot {strangers[0]} is not shown")
    tracks = [track(result, index) for index in indices]
    on_grid = grid and len(tracks) > 1
    offsets = placed(tracks, spacing) if on_grid else np.zeros((len(tracks), 3))
    # Balls rest on the floor: it lies below z = 0 by the radius of the largest.
    largest = max(item.ball for item in tracks)
    if on_grid:
        offsets[:, 2] += [item.ball - largest for item in tracks]
    block = Block()
    palette, labels = material_palette([item.robot for item in tracks])
    header = {
        "times": [round(float(t), 6) for t in result.times],
        "floor": None if result.scene.ground is None else -largest,
        "water": None if result.scene.water is None else result.scene.water.level,
        "tile": appearance.tile_size(
            [np.linalg.norm(item.high[0] - item.low[0]) for item in tracks]
        ),
        "levels": LEVELS,
        "colors": _colors(),
        "solids": _solids(result, tracks, offsets, block),
        "materials": [{"name": name, "color": list(color)} for name, color in palette],
        "robots": [
            {
                "name": str(names.get(item.index, f"robot {item.index}")),
                "facts": _facts(result, item, notes.get(item.index, {})),
                "material": block.add(label, "u2"),
                **_body(item, block),
                **_motion(result, item, offset, block),
                **_plots(result, item, block),
                "pushes": _pushes(item),
                "tethers": _tethers(item, offset),
            }
            for item, offset, label in zip(tracks, offsets, labels, strict=True)
        ],
    }
    return header, block.text()


def _body(item: Track, block: Block) -> dict[str, Any]:
    """What does not change in time."""
    robot = item.robot
    bar, ball = appearance.drawn_radii(robot.lengths)
    index = "u2" if robot.n_masses <= 65_535 else "u4"
    return {
        "masses": robot.n_masses,
        "springs": robot.n_springs,
        "bar": bar,
        "ball": ball,
        "held": robot.elements.bonds.masses.tolist(),
        "gone": [[s, int(item.gone[s])] for s in np.flatnonzero(np.isfinite(item.gone)).tolist()],
        "ends": block.add(robot.springs, index),
        "corners": block.add(robot.faces, index),
    }


def _motion(result: Result, item: Track, offset: NDArray, block: Block) -> dict[str, Any]:
    """Positions, boxes and colours of every frame, each as the change since the frame before."""
    robot = item.robot
    frames = np.asarray(result.frames(item.index))[item.source]
    low, high = item.box
    center = 0.5 * (low + high)
    bar, _ = appearance.drawn_radii(robot.lengths)
    quantum = max(bar / STEPS_PER_BAR, float((high - low).max()) / 65_000)
    steps = np.rint((frames - center) / quantum).astype(np.int64)
    motion = _changes(steps.reshape(len(frames), -1), np.uint16)
    planes = np.stack([motion & 0xFF, motion >> 8])  # alike bytes side by side compress better
    tension = result.tension_frames(item.index)[item.source]
    scale = appearance.stress_scale(tension)
    middles = np.einsum("fmi,m->fi", frames, robot.masses) / robot.mass + offset
    return {
        "center": (center + offset).tolist(),
        "quantum": quantum,
        "motion": block.add(planes, "u1"),
        "stress": block.add(_changes(_levels(tension / scale), np.int8), "i1"),
        "stressScale": scale,
        "boxes": block.add(np.hstack([item.low, item.high]) + np.tile(offset, 2), "f4"),
        "middles": block.add(middles, "f4"),
        "reach": {"low": (low + offset).tolist(), "high": (high + offset).tolist()},
        "height": block.add(middles[:, 2] - offset[2], "f4"),
        "speed": block.add(_speed(middles, result.times), "f4"),
        **_actuation(result, item, block),
    }


def _actuation(result: Result, item: Track, block: Block) -> dict[str, Any]:
    """By how much springs are told to be longer or shorter, as a share of their rest length."""
    rest = item.robot.rest_length
    told = item.robot.rest_length_at(item.times) - rest
    asked = result.rest_length_change(item.index, item.source, yielded=False)
    told = told if asked is None else told + asked
    share = np.divide(told, rest, where=rest > 0.0, out=np.zeros_like(told))
    scale = float(np.abs(share).max(initial=0.0))
    if scale < _NO_ACTUATION:
        return {"actuation": None, "actuationScale": 0.0}
    # Spring by spring: what a spring does in time is smooth, and so compresses best.
    changes = _changes(_levels(share / scale), np.int8).T
    return {"actuation": block.add(changes, "i1"), "actuationScale": scale}


def _plots(result: Result, item: Track, block: Block) -> dict[str, Any]:
    """The energies of every frame [J]."""
    if result.energy is None:
        return {}
    return {
        f"energy_{name}": block.add(getattr(result.energy, name)[item.index], "f4")
        for name in ENERGIES
    }


def _pushes(item: Track) -> list[dict[str, Any]]:
    """The external forces on a robot; the largest is an arrow half as long as the robot."""
    pushes = [push for push in item.robot.elements.pushes if any(push.force)]
    largest = max((np.linalg.norm(push.force) for push in pushes), default=1.0)
    return [
        {
            "masses": list(push.masses),
            "start": push.start,
            "end": min(push.end, _ENDLESS),
            "arrow": (_ARROW * item.robot.diameter / largest * np.array(push.force)).tolist(),
        }
        for push in pushes
    ]


def _tethers(item: Track, offset: NDArray) -> list[dict[str, Any]]:
    """The temporary springs that hold a robot to points in space."""
    return [
        {
            "mass": tether.mass,
            "point": (np.array(tether.point) + offset).tolist(),
            "start": tether.start,
            "end": min(tether.end, _ENDLESS),
        }
        for tether in item.robot.elements.tethers
    ]


def _solids(result: Result, tracks: list[Track], offsets: NDArray, block: Block) -> list[dict]:
    """The obstacles, around every robot: each has a world of its own."""
    boxes = np.stack([item.box for item in tracks])
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    solids = []
    for obstacle in result.scene.obstacles:
        points, triangles = obstacle_mesh(obstacle, box)
        center = list(obstacle.center) if isinstance(obstacle, Sphere) else None
        mesh = block.add(points[triangles], "f4")
        solids.append({"mesh": mesh, "at": offsets.tolist(), "center": center})
    return solids


def _facts(result: Result, item: Track, notes: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the page says about a robot: (label, words)."""
    robot = item.robot
    facts = [(str(name), _words(value)) for name, value in notes.items() if value is not None]
    facts += [
        ("masses", f"{robot.n_masses:,}"),
        ("springs", f"{robot.n_springs:,}"),
        ("weight", f"{robot.mass:.3g} kg"),
        ("diameter", f"{robot.diameter:.3g} m"),
    ]
    if robot.is_actuated and robot.omega:
        facts.append(("cycle", f"{2.0 * np.pi / abs(robot.omega):.3g} s"))
    status = Status(int(result.status[item.index]))
    if status:
        facts.insert(0, ("stopped", f"{status.name} at {result.status_time[item.index]:.3g} s"))
    return facts


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _colors() -> dict[str, Any]:
    """Colours that the page paints with, linear RGB."""
    names = {
        "neutral": appearance.NEUTRAL,
        "tension": appearance.TENSION,
        "compression": appearance.COMPRESSION,
        "longer": appearance.LONGER,
        "shorter": appearance.SHORTER,
        "mass": appearance.MASS,
        "held": appearance.HELD,
        "water": appearance.WATER,
        "skin": appearance.SKIN,
        "groundLight": appearance.GROUND_LIGHT,
        "groundDark": appearance.GROUND_DARK,
        "sky": appearance.SKY,
        "zenith": appearance.ZENITH,
        "push": appearance.PUSH,
        "obstacle": appearance.OBSTACLE,
    }
    return {name: list(color) for name, color in names.items()}


def _levels(share: NDArray) -> NDArray[np.int64]:
    """Shares in -1 ... 1 as whole numbers in -LEVELS ... LEVELS; what is not finite is 0."""
    share = np.nan_to_num(share, nan=0.0, posinf=0.0, neginf=0.0)
    return np.rint(np.clip(share, -1.0, 1.0) * LEVELS).astype(np.int64)


def _changes(values: NDArray[np.int64], dtype: type) -> NDArray:
    """Every row less the one before it; sums of them wrap to the same values."""
    return np.diff(values, axis=0, prepend=0).astype(dtype)


def _speed(middles: NDArray, times: NDArray) -> NDArray:
    """Speed of the centre of mass [m/s] from its places (F, 3) [m], shape (F,)."""
    if len(times) < 2:
        return np.zeros(len(times))
    return np.linalg.norm(np.gradient(middles, times, axis=0), axis=1)
