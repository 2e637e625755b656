"""The shell: ``warp-springs demo NAME --out DIR`` and ``warp-springs info``."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import Positional

if TYPE_CHECKING:
    from rich.console import Console

    from warp_springs.demos import Demo
    from warp_springs.result import Result

__all__ = ["main"]

DemoName = Literal["bouncing-cube", "breathing-cube", "ten-cubes", "tetrahedron"]


@dataclass(frozen=True)
class DemoCommand:
    """Simulate one of the classroom's demonstrations.

    Writes to the output folder: NAME.usdc (an animation for usdview, Blender, Omniverse or a
    phone), NAME.png (a picture of the end), NAME_energy.png (energies over time) and
    NAME_parameters.json (every parameter).
    """

    name: Positional[DemoName]
    """Which demonstration."""
    out: Path = Path("out")
    """Folder to write to; made if it is missing."""

    def run(self, console: Console) -> None:
        """Simulate, export, and say what was written."""
        from rich.progress import Progress

        from warp_springs.demos import DEMOS

        demo = DEMOS[self.name]
        self.out.mkdir(parents=True, exist_ok=True)
        console.print(f"{self.name}: {demo.summary}")
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("simulating", total=1.0)
            result = demo.run(lambda done: bar.update(task, completed=done))
        _print_parameters(console, demo)
        _print_outcome(console, result)
        for path in self._write(demo, result):
            console.print(f"wrote {path}", soft_wrap=True)

    def _write(self, demo: Demo, result: Result) -> list[Path]:
        import warp_springs as ws

        paths = [self.out / f"{self.name}{end}" for end in (".usdc", ".png", "_energy.png")]
        ws.export_usd(result, paths[0])
        ws.render(result, paths[1])
        _energy_figure(result, paths[2])
        parameters = self.out / f"{self.name}_parameters.json"
        parameters.write_text(json.dumps(demo.parameters(), indent=2, default=str) + "\n")
        return [*paths, parameters]


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


def _print_parameters(console: Console, demo: Demo) -> None:
    from rich.table import Table

    table = Table("parameter", "value", title="parameters", title_justify="left")
    for name, value in demo.parameters().items():
        table.add_row(name, str(value))
    console.print(table)


def _print_outcome(console: Console, result: Result) -> None:
    from warp_springs.stability import Status

    total = result.energy.total[0]
    change = abs(total - total[0]).max() / abs(total[0])
    speed = result.spring_evaluations / result.wall_time / 1e6
    states = ", ".join(sorted({Status(code).name for code in result.status.tolist()}))
    console.print(f"status: {states}")
    console.print(f"total energy of robot 0: largest change {change:.1e} of its initial value")
    console.print(f"{result.end_time:g} s in {result.wall_time:.2f} s, {speed:,.0f} M springs/s")


def _energy_figure(result: Result, path: Path) -> None:
    from matplotlib.figure import Figure

    from warp_springs.view import plots

    figure = Figure(figsize=(9, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    plots.energies(above, result)
    plots.height(below, result)
    above.set_xlabel("")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Entry point of ``warp-springs``: exit code 0, 1 (failed), 2 (bad usage) or 130 (Ctrl-C)."""
    import tyro
    from rich.console import Console

    command = tyro.extras.subcommand_cli_from_dict(
        {"demo": DemoCommand, "info": InfoCommand},
        prog="warp-springs",
        description="Step thousands of mass-spring soft robots in parallel, and look at them.",
    )
    from warp_springs.startup import quiet

    try:
        quiet()
        command.run(Console())
    except KeyboardInterrupt:
        sys.exit(130)
    except (OSError, ValueError, RuntimeError) as error:
        print(f"warp-springs: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
