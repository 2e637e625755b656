"""Which machine this is."""

from __future__ import annotations

import platform
from pathlib import Path

import numpy as np
import warp as wp

import warp_springs
from warp_springs.simulation import usable_cores

__all__ = ["machine", "processor"]


def processor() -> str:
    """The name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def machine(device: str) -> dict[str, str | int]:
    """What a speed depends on: device, processor, cores, system and versions."""
    return {
        "device": wp.get_device(device).name,
        "processor": processor(),
        "cores": usable_cores(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "warp_springs": warp_springs.__version__,
        "warp": wp.config.version,
        "numpy": np.__version__,
    }
