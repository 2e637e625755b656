"""All parameters of a simulation and what came of it, as a table that a person can read."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_springs.robot import Robot
from warp_springs.stability import Status, stable_dt

if TYPE_CHECKING:
    from warp_springs.config import SceneFile
    from warp_springs.result import Result

__all__ = ["as_markdown", "energy_change", "figures", "of_result", "outcome", "parameters"]

Row = tuple[str, str]

UNITS = {
    "gravity": "m/s²",
    "damping": "1/s",
    "drag": "kg/m",
    "wind": "m/s",
    "stiffness": "N/m",
    "duration": "s",
    "dt": "s",
    "fps": "1/s",
    "edge": "m",
    "radius": "m",
    "length": "m",
    "width": "m",
    "height": "m",
    "bounds": "m",
    "spacing": "m",
    "mass": "kg",
    "mass_per_vertex": "kg",
    "position": "m",
    "positions": "m",
    "velocity": "m/s",
    "spin": "rad/s",
    "omega": "rad/s",
    "phase": "rad",
    "angle": "rad",
    "wave": "rad/m",
    "force": "N",
    "start": "s",
    "end": "s",
    "density": "kg/m³",
    "modulus": "Pa",
    "section": "m²",
    "level": "m",
    "thickness": "m",
    "layer": "m",
    "offset": "m",
    "center": "m",
    "size": "m",
    "point": "m",
    "rest_length": "m",
    "box": "m",
    "cubic": "N/m³",
    "stretch": "m",
    "area": "m²",
    "times": "s",
    "period": "s",
    "offsets": "m",
    "place": "m",
    "motion": "m/s",
    "rate": "1/s",
    "heights": "m",
    "lowest": "m",
    "highest": "m",
    "origin": "m",
}
"""Units of the keys of a configuration."""
FIELDS = {
    "masses": "kg",
    "stiffness": "N/m",
    "rest_length": "m",
    "amplitude": "m",
    "phase": "rad",
}
"""Arrays of a robot whose range is told."""
MOST_ROBOTS = 12
"""Different robots beyond which the table tells no more."""
_DIMENSIONLESS = ("water.density", "collisions.damping")


def parameters(config: SceneFile, result: Result) -> list[Row]:
    """Every parameter of a scene file, and the figures of the robots that it makes."""
    from warp_springs.config import tables

    data = {k: v for k, v in tables(config).items() if k not in ("name", "about")}
    return [*_flat(data, ()), *_of_run(result, config.names)]


def of_result(result: Result, names: Mapping[int, str]) -> list[Row]:
    """Every parameter that a result itself knows: its world, its robots, how it was stepped."""
    scene = dataclasses.asdict(result.scene)
    return [*_flat(_plain({"scene": scene}), ()), *_of_run(result, names)]


def _plain(value: Any) -> Any:
    """Tuples and arrays as lists, and without what a scene lacks."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (tuple, list, np.ndarray)):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _of_run(result: Result, names: Mapping[int, str]) -> list[Row]:
    """The robots of a run, and how it was stepped."""
    from warp_springs import __version__

    return [
        *_robots(result, names),
        ("integrator", result.integrator),
        ("precision", result.precision),
        ("device", result.device),
        ("step", f"{result.dt:g} s, halved where a robot needs it"),
        ("steps", f"{result.steps:,}"),
        ("warp_springs", __version__),
    ]


def outcome(result: Result) -> list[Row]:
    """What came of a run: statuses, energies, speed."""
    names, counts = np.unique([Status(s).name for s in result.status], return_counts=True)
    rows = [("status", ", ".join(f"{n} {c}" for n, c in zip(names, counts, strict=True)))]
    if result.energy is not None:
        change, residual = energy_change(result)
        rows.append(("total energy varies by", f"{change:.2g} % of its largest value"))
        rows.append(("energy the ledger cannot explain", f"{residual:.2g} % of the largest total"))
    speed = result.spring_evaluations / max(result.wall_time, 1e-9) / 1e6
    rows.append(("simulated", f"{result.end_time - result.start_time:g} s"))
    rows.append(("took", f"{result.wall_time:.2f} s, {speed:,.0f} M springs/s"))
    return rows


def energy_change(result: Result) -> tuple[float, float]:
    """Range of the total energy, and the largest residual, of the worst robot [% of its total]."""
    total, residual = result.energy.total, result.energy.residual
    with np.errstate(invalid="ignore", divide="ignore"):
        whole = np.abs(total).max(axis=1)
        change = (total.max(axis=1) - total.min(axis=1)) / whole
        error = np.abs(residual).max(axis=1) / whole
    finite = np.isfinite(change) & np.isfinite(error)
    if not finite.any():
        return np.nan, np.nan
    return 100.0 * float(change[finite].max()), 100.0 * float(error[finite].max())


def as_markdown(title: str, about: str, *tables: Sequence[Row]) -> str:
    """Tables with two columns under a title, as Markdown."""
    lines = [f"# {title}", "", about, ""]
    for rows in tables:
        lines += ["| | |", "|---|---|", *(f"| {_cell(a)} | {_cell(b)} |" for a, b in rows), ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _flat(data: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[Row]:
    """The leaves of nested tables by their dotted keys."""
    for key, value in data.items():
        here = (*path, key)
        if isinstance(value, Mapping):
            yield from _flat(value, here)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for index, item in enumerate(value):
                yield from _flat(item, (*here, str(index)))
        elif value != []:
            dotted = ".".join(here)
            unit = "" if dotted.endswith(_DIMENSIONLESS) else UNITS.get(key, "")
            numeric = not isinstance(value, (str, bool))
            yield dotted, f"{_text(value)} {unit}".strip() if numeric else _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        shown = ", ".join(map(_text, value[:24]))
        return f"({shown})" if len(value) <= 24 else f"({shown}, ... {len(value)} in all)"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _robots(result: Result, names: Mapping[int, str]) -> Iterator[Row]:
    """The figures of each different robot."""
    told: dict[bytes, str] = {}
    for index, robot in enumerate(result.robots):
        key = robot.topology + robot.stiffness.tobytes() + robot.phase.tobytes()
        if key in told or len(told) == MOST_ROBOTS:
            continue
        told[key] = name = names.get(index, f"robot {index}")
        for what, value in figures(robot):
            yield f"{name}: {what}", value
        yield f"{name}: stable step", f"{stable_dt(robot, result.scene, result.integrator):.3g} s"


def figures(robot: Robot) -> Iterator[Row]:
    """What a robot is, in figures: counts, mass, size, ranges of its fields, materials."""
    yield "masses, springs, faces", f"{robot.n_masses:,}, {robot.n_springs:,}, {len(robot.faces):,}"
    yield "mass", f"{robot.mass:g} kg"
    yield "size", " x ".join(f"{v:.4g}" for v in np.ptp(robot.bounds, axis=0)) + " m"
    for name, unit in FIELDS.items():
        values = getattr(robot, name)
        if len(values) and (name != "phase" or robot.is_actuated):
            label = "mass of a point" if name == "masses" else name.replace("_", " ")
            yield label, f"{_range(values)} {unit}"
    if robot.is_actuated:
        yield "omega", f"{robot.omega:g} rad/s, a cycle of {2.0 * np.pi / abs(robot.omega):.4g} s"
    for number, material in enumerate(robot.materials):
        share = int((robot.material == number).sum())
        yield f"material {material.name}", f"{share:,} springs"


def _range(values: np.ndarray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if np.isclose(low, high, rtol=1e-12, atol=0.0) else f"{low:g} to {high:g}"
