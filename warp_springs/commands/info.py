"""``warp-springs info``: which version this is, and where it runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["InfoCommand"]


@dataclass(frozen=True)
class InfoCommand:
    """Say which version this is, where it runs, and how it uses this processor."""

    def run(self, console: Console) -> None:
        """Print a table."""
        import platform

        import warp as wp
        from rich.table import Table

        import warp_springs as ws
        from warp_springs.kernels.dialect import native_width
        from warp_springs.simulation import usable_cores

        table = Table(show_header=False, box=None)
        for name, value in {
            "warp_springs": ws.__version__,
            "Warp": wp.config.version,
            "Python": platform.python_version(),
            "platform": platform.platform(),
            "device": "cpu",
            "threads": usable_cores(),
            "robots in a bundle, float64": native_width("float64"),
            "robots in a bundle, float32": native_width("float32"),
            "kernel cache": wp.config.kernel_cache_dir,
        }.items():
            table.add_row(name, str(value))
        console.print(table)
