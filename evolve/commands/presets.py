"""``evolve presets``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Presets"]


@dataclass(frozen=True)
class Presets:
    """List the packaged presets: name, fixed body or evolving body, what each evolves.

    To read one or to start a file of your own from it, run it for a generation and look at the
    run.toml in its folder.
    """

    def __call__(self, console: Console) -> int:
        """Print a line for each."""
        from evolve.toml import load, preset_names

        configs = [load(name) for name in preset_names()]
        width = max(len(config.name) for config in configs)
        for config in configs:
            kind = "fixed body" if config.fixed_body else "evolving body"
            print(f"{config.name:<{width}}  {kind:<13}  {config.about}")
        return 0
