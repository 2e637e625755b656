"""Thousands of mass-spring soft robots stepped in parallel with NVIDIA Warp.

import warp_springs as ws

cube = ws.shapes.cube().moved((0, 0, 0.5)).spinning((3, -2, 4))
result = ws.Simulation([cube] * 1000, ws.Scene()).run(duration=2.0, fps=30, record=[0])
ws.export_usd(result, "cube.usdc")
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from warp_springs import materials, sensors, shapes
from warp_springs.body.control import Controller, Growth
from warp_springs.body.elements import Elements, Push, Tether, Timetable
from warp_springs.body.variants import Variants
from warp_springs.body.waveform import Waveform
from warp_springs.energy import Energy
from warp_springs.engine.layouts import device_named
from warp_springs.materials import Material
from warp_springs.result import Result
from warp_springs.robot import Robot
from warp_springs.scene import Collisions, Ground, Scene, Water, damping_rate
from warp_springs.simulation import Simulation
from warp_springs.stability import Limits, Status, stable_dt
from warp_springs.startup import one_line, quiet
from warp_springs.surfaces import (
    Box,
    Circle,
    HeightField,
    Line,
    Plane,
    Sphere,
    height_map,
    hills,
    rough_terrain,
)

__all__ = [
    "Box",
    "Camera",
    "Circle",
    "Collisions",
    "Controller",
    "Document",
    "Elements",
    "Energy",
    "Ground",
    "Growth",
    "HeightField",
    "Limits",
    "Line",
    "LiveLine",
    "LiveServer",
    "Material",
    "Plane",
    "Push",
    "Result",
    "Robot",
    "Scene",
    "Simulation",
    "Sphere",
    "Status",
    "Tether",
    "Timetable",
    "Variants",
    "Water",
    "Waveform",
    "config",
    "damping_rate",
    "device_named",
    "export_html",
    "export_usd",
    "height_map",
    "hills",
    "html_page",
    "materials",
    "one_line",
    "plots",
    "quiet",
    "read_mesh",
    "render",
    "rough_terrain",
    "sensors",
    "shapes",
    "stable_dt",
    "write_mesh",
    "write_report",
]

try:
    __version__ = version("warp-springs")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0+unknown"

# Names whose modules need pydantic, pxr, matplotlib, meshio or Pillow: loaded on first use.
_LAZY = {
    "config": ("warp_springs.config", None),
    "Camera": ("warp_springs.view.pictures.camera", "Camera"),
    "Document": ("warp_springs.view.pages.document", "Document"),
    "LiveLine": ("warp_springs.view.pages.live", "LiveLine"),
    "LiveServer": ("warp_springs.view.pages.live", "LiveServer"),
    "export_html": ("warp_springs.view.pages.player", "export_html"),
    "export_usd": ("warp_springs.io.usd.export", "export_usd"),
    "html_page": ("warp_springs.view.pages.player", "html_page"),
    "plots": ("warp_springs.view.plots", None),
    "read_mesh": ("warp_springs.io.mesh.read", "read_mesh"),
    "render": ("warp_springs.view.pictures.picture", "render"),
    "write_mesh": ("warp_springs.io.mesh.write", "write_mesh"),
    "write_report": ("warp_springs.view.pages.report", "write_report"),
}


def __getattr__(name: str):
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _LAZY[name]
    found = import_module(module)
    return getattr(found, attribute) if attribute else found


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
