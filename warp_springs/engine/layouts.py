"""Which layout steps which robot: by what it is and where it runs, never by its neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import warp as wp

__all__ = ["LAYOUTS", "block_size", "check_layout", "choose", "device_named"]

LAYOUTS = ("auto", "lanes", "block", "flat")

#: Masses from which on several threads on one body beat one thread on several (measured, see
#: benchmarks/huge.py).
LARGE = 1025
#: Threads of a block, for robots of up to as many masses. With more, a thread would not have the
#: registers it needs (see benchmarks/cuda_static.py).
BLOCK_SIZES = {"float32": (256, 512), "mixed": (256, 384), "float64": (256, 320)}


def device_named(name: object) -> wp.Device:
    """The device of that name.

    Raises:
        ValueError: There is none on this machine.
    """
    wp.init()
    known = [device.alias for device in wp.get_devices()]
    try:
        return wp.get_device(str(name))
    except (RuntimeError, ValueError):
        raise ValueError(
            f"device: got {str(name)!r}, expected one of this machine's: {', '.join(known)}"
        ) from None


def check_layout(layout: str, device: wp.Device, precision: str, masses: Sequence[int]) -> None:
    """Refuse a layout that the device does not have, or a robot that does not fit.

    Raises:
        ValueError: As said.
    """
    if layout == "lanes" and not device.is_cpu:
        raise ValueError(f"layout: 'lanes' is for a CPU, the device is {device.alias!r}")
    largest = BLOCK_SIZES[precision][-1]
    for index, count in enumerate(masses):
        if layout == "block" and count > largest:
            raise ValueError(
                f"layout: robots[{index}] has {count} masses, "
                f"'block' expects {largest} or fewer in {precision}"
            )


def choose(layout: str, device: wp.Device, precision: str, masses: int) -> str:
    """The layout of a robot with so many masses."""
    if layout != "auto":
        return layout
    if device.is_cpu:
        return "flat" if masses >= LARGE else "lanes"
    return "block" if masses <= BLOCK_SIZES[precision][-1] else "flat"


def block_size(precision: str, masses: int) -> int:
    """Threads of the blocks for robots of so many masses."""
    return next(size for size in BLOCK_SIZES[precision] if masses <= size)
