"""Encodings: how a genome becomes a robot.

An encoding is one file and one line in `ENCODINGS`; its name there is its name in a run's
configuration.
"""

from __future__ import annotations

from evolve.encodings.base import ArrayGenomes, Encoding, EncodingSettings
from evolve.encodings.direct import DirectEncoding, DirectSettings

__all__ = [
    "ENCODINGS",
    "ArrayGenomes",
    "DirectEncoding",
    "DirectSettings",
    "Encoding",
    "EncodingSettings",
]

ENCODINGS: dict[str, type[Encoding]] = {"direct": DirectEncoding}
"""Name in the configuration -> class."""
