"""``warp-springs report FILE [OUT]``: a saved result as one HTML file that tells everything."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["ReportCommand"]


@dataclass(frozen=True)
class ReportCommand:
    """Write the report of a saved result: one HTML file that needs no network and prints well.

    It holds a film, a page in which the robots move, plots of their energies and motion, and every
    parameter. Names and parameters come from the scene that `warp-springs run` left beside the
    result, NAME.toml, if it is there.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """A result that was saved (.npz)."""
    out: Annotated[Positional[Path | None], arg(metavar="OUT")] = None
    """What to write; NAME_report.html beside the file when left out."""

    def run(self, console: Console) -> None:
        """Load, write, and say what was written."""
        import warp_springs as ws
        from warp_springs.config import load_scene
        from warp_springs.view.parameters import parameters

        result = ws.Result.load(self.file)
        scene = self.file.with_suffix(".toml")
        known = {"title": self.file.stem}
        if scene.is_file():
            config = load_scene(scene)
            known = {
                "title": config.name,
                "about": config.about,
                "names": config.names,
                "parameters": parameters(config, result),
                "commands": [
                    f"warp-springs run {scene.name} --out .",
                    f"warp-springs report {self.file.name}",
                ],
            }
        beside = self.file.with_name(f"{self.file.stem}_report.html")
        out = beside if self.out is None else self.out
        with console.status("writing the report") as status:
            path = ws.write_report(result, out, **known, progress=status.update)
        console.print(f"wrote {path}", markup=False, soft_wrap=True)
