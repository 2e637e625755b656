"""Configurations: scenes, robots and simulations as TOML files, checked when they are read.

Each table of a file is a pydantic model; unknown keys and bad values are refused with one line
that names the file and the key.
"""

from warp_springs.config.bodies import SHAPES, AnyBody, AnyShape, BodyConfig
from warp_springs.config.files import MOST_SHOWN, OUTPUTS, RecordConfig, SceneFile, load_scene
from warp_springs.config.reference import reference
from warp_springs.config.robots import RobotConfig
from warp_springs.config.scenes import GroundConfig, SceneConfig
from warp_springs.config.section import Section, Triple, one_of
from warp_springs.config.simulation import SimulationConfig
from warp_springs.config.text import (
    ConfigError,
    dump,
    parse,
    parse_settings,
    read_text,
    suggest,
    tables,
    validate,
)

__all__ = [
    "MOST_SHOWN",
    "OUTPUTS",
    "SHAPES",
    "AnyBody",
    "AnyShape",
    "BodyConfig",
    "ConfigError",
    "GroundConfig",
    "RecordConfig",
    "RobotConfig",
    "SceneConfig",
    "SceneFile",
    "Section",
    "SimulationConfig",
    "Triple",
    "dump",
    "load_scene",
    "one_of",
    "parse",
    "parse_settings",
    "read_text",
    "reference",
    "suggest",
    "tables",
    "validate",
]
