"""How the robots of a configuration are stepped."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator

from warp_springs.config.section import Section

__all__ = ["SimulationConfig"]


class SimulationConfig(Section):
    """How motion is computed."""

    dt: float | Literal["auto"] = "auto"
    """Time step [s], or "auto": for each robot half a millisecond, halved until it is stable."""
    precision: Literal["float64", "float32", "mixed"] = "float64"
    """Of the arithmetic; mixed keeps positions as sums of two."""
    integrator: Literal["chin4", "leapfrog", "euler"] = "chin4"
    """Fourth order, second order, or the classroom's."""
    layout: Literal["auto", "lanes", "block", "flat"] = "auto"
    """How robots are laid out for the processor."""
    device: str = "cpu"
    """Where it is computed."""
    threads: int | None = Field(None, ge=1)
    """Processor cores to use, all when left out. The results do not depend on it."""

    @field_validator("dt", mode="before")
    @classmethod
    def _is_a_step(cls, value: Any) -> Any:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if value != "auto" and not (number and value > 0.0):
            raise ValueError("expected a number of seconds above 0, or 'auto'")
        return value
