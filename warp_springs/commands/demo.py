"""``warp-springs demo NAME``: one of the classroom's demonstrations."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import Positional

if TYPE_CHECKING:
    from rich.console import Console

    from warp_springs.demos import Demo
    from warp_springs.result import Result

__all__ = ["DemoCommand"]

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
    from warp_springs.view import plots

    figure = plots.figure(9.0, 7.0)
    above, below = figure.subplots(2, 1, height_ratios=(3, 2))
    plots.energies(above, result)
    plots.height(below, result)
    figure.savefig(path)
