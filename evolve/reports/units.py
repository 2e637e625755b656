"""Figures and their units in words; what has no unit gets no empty brackets."""

from __future__ import annotations

__all__ = ["in_units", "titled", "with_unit"]


def titled(words: str, unit: str) -> str:
    """What a figure is, with its unit: "best speed [m/s]"."""
    return f"{words} [{unit}]" if unit else words


def with_unit(figure: str, unit: str) -> str:
    """A figure with its unit: "0.48 m/s"."""
    return f"{figure} {unit}" if unit else figure


def in_units(words: str, unit: str) -> str:
    """Words about figures, with what they are measured in: "means in m/s"."""
    return f"{words} in {unit}" if unit else words
