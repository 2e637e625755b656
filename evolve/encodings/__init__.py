"""Encodings: how a genome becomes a robot.

An encoding is one file and one line in `ENCODINGS`; its name there is its name in a run's
configuration.
"""

from __future__ import annotations

from evolve.encodings.actuation import ActuationSettings, FixedBody
from evolve.encodings.arena import ArenaEncoding, ArenaSettings
from evolve.encodings.base import ArrayGenomes, Encoding, EncodingSettings
from evolve.encodings.controller import ControllerEncoding, ControllerSettings
from evolve.encodings.cppn import CppnEncoding, CppnSettings
from evolve.encodings.cppn_body import CppnBodyEncoding, CppnBodySettings
from evolve.encodings.direct import DirectEncoding, DirectSettings
from evolve.encodings.expression import ExpressionEncoding, ExpressionSettings
from evolve.encodings.fourier import FourierEncoding, FourierSettings
from evolve.encodings.grammar import GrammarEncoding, GrammarSettings
from evolve.encodings.growth import GrowthEncoding, GrowthSettings
from evolve.encodings.harmonics import HarmonicsEncoding, HarmonicsSettings
from evolve.encodings.lsystem import LsystemEncoding, LsystemSettings
from evolve.encodings.morphology import MorphologyEncoding, MorphologySettings
from evolve.encodings.neural import NeuralEncoding, NeuralSettings
from evolve.encodings.regions import RegionsEncoding, RegionsSettings
from evolve.encodings.sprout import SproutEncoding, SproutSettings
from evolve.encodings.voxels import VoxelsEncoding, VoxelsSettings
from warp_springs import config as configs

__all__ = [
    "ENCODINGS",
    "ActuationSettings",
    "ArenaEncoding",
    "ArenaSettings",
    "ArrayGenomes",
    "ControllerEncoding",
    "ControllerSettings",
    "CppnBodyEncoding",
    "CppnBodySettings",
    "CppnEncoding",
    "CppnSettings",
    "DirectEncoding",
    "DirectSettings",
    "Encoding",
    "EncodingSettings",
    "ExpressionEncoding",
    "ExpressionSettings",
    "FixedBody",
    "FourierEncoding",
    "FourierSettings",
    "GrammarEncoding",
    "GrammarSettings",
    "GrowthEncoding",
    "GrowthSettings",
    "HarmonicsEncoding",
    "HarmonicsSettings",
    "LsystemEncoding",
    "LsystemSettings",
    "MorphologyEncoding",
    "MorphologySettings",
    "NeuralEncoding",
    "NeuralSettings",
    "RegionsEncoding",
    "RegionsSettings",
    "SproutEncoding",
    "SproutSettings",
    "VoxelsEncoding",
    "VoxelsSettings",
]

ENCODINGS: dict[str, type[Encoding]] = {
    "direct": DirectEncoding,
    "regions": RegionsEncoding,
    "harmonics": HarmonicsEncoding,
    "fourier": FourierEncoding,
    "expression": ExpressionEncoding,
    "neural": NeuralEncoding,
    "cppn": CppnEncoding,
    "voxels": VoxelsEncoding,
    "morphology": MorphologyEncoding,
    "cppn_body": CppnBodyEncoding,
    "controller": ControllerEncoding,
    "arena": ArenaEncoding,
    "lsystem": LsystemEncoding,
    "grammar": GrammarEncoding,
    "growth": GrowthEncoding,
    "sprout": SproutEncoding,
}
"""Name in the configuration -> class."""

# An arena holds robots of any other encoding.
ArenaSettings.model_rebuild(
    _types_namespace={
        "AnyRobot": configs.one_of(
            (cls.Settings for cls in ENCODINGS.values() if cls is not ArenaEncoding), "type"
        )
    }
)
