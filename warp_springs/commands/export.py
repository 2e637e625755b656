"""``warp-springs export FILE [OUT]``: an animation of a saved result as OpenUSD."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from warp_springs.commands.progress import progress

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["ExportCommand"]


@dataclass(frozen=True)
class ExportCommand:
    """Write the robots of a saved result as an OpenUSD animation.

    It opens in usdview, Blender, Omniverse, three.js and on phones. Several robots stand on a grid;
    the stage has a floor, the obstacles, pushes as arrows, lights, and two cameras: one that sees
    everything and one that goes along.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """A result that was saved (.npz)."""
    out: Annotated[Positional[Path | None], arg(metavar="OUT")] = None
    """What to write: .usdc (binary), .usda (text) or .usdz (package, for phones); FILE with .usdc
    when left out."""
    robots: tuple[int, ...] | None = None
    """Indices of the robots; all that were recorded when left out."""
    names: tuple[str, ...] | None = None
    """One name for each robot; robot_0007 when left out."""
    color: Literal["stress", "material"] = "stress"
    """What the colour of a bar says."""
    geometry: Literal["auto", "skel", "points", "mesh"] = "auto"
    """A skeleton and meshes bound to it (small files, every viewer), points and curves (very large
    bodies), or meshes with moving vertices. By itself: the first, above 1,000 masses the second."""
    springs: Literal["auto", "all", "surface"] = "auto"
    """Which springs: all, or those at the surface. By itself: all, of bodies above 1,000 masses
    those at the surface."""
    grid: bool = True
    """Whether several robots stand on a grid; otherwise where they were simulated."""
    spacing: float | None = None
    """Distance of the cells of the grid [m]; by itself as much as keeps robots apart."""

    def run(self, console: Console) -> None:
        """Load, write, and say what was written."""
        import warp_springs as ws

        result = ws.Result.load(self.file)
        out = self.file.with_suffix(".usdc") if self.out is None else self.out
        with progress(console, "writing") as done:
            path = ws.export_usd(
                result,
                out,
                robots=self.robots,
                names=self._names(result.recorded),
                color=self.color,
                geometry=self.geometry,
                springs=self.springs,
                grid=self.grid,
                spacing=self.spacing,
                progress=done,
            )
        console.print(f"wrote {path}", markup=False, soft_wrap=True)

    def _names(self, recorded: tuple[int, ...]) -> dict[int, str] | None:
        if self.names is None:
            return None
        shown = recorded if self.robots is None else self.robots
        if len(self.names) != len(shown):
            raise ValueError(f"--names: got {len(self.names)}, expected one for each robot shown "
                             f"({len(shown)})")  # fmt: skip
        return dict(zip(shown, self.names, strict=True))
