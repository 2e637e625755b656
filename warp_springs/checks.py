"""Refusals of bad input, all in one wording: what was given, what is expected, where."""

from __future__ import annotations

import math

__all__ = ["check_choice", "check_number"]


def check_number(
    name: str, value: float, *, above: float | None = None, at_least: float | None = None
) -> None:
    """Refuse anything but a finite number above ``above`` or from ``at_least`` on."""
    bound = f"> {above:g}" if above is not None else f">= {at_least:g}"
    try:
        good = math.isfinite(value) and (value > above if above is not None else value >= at_least)
    except TypeError:
        good = False
    if not good or isinstance(value, bool):
        raise ValueError(f"{name}: got {value!r}, expected a finite number {bound}")


def check_choice(name: str, value: object, choices: tuple[str, ...]) -> None:
    """Refuse anything but one of some words."""
    if value not in choices:
        words = " or ".join(map(repr, choices))
        raise ValueError(f"{name}: got {value!r}, expected {words}")
