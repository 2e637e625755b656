"""``warp-springs info``: which version this is and where it runs, or what a file holds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

__all__ = ["InfoCommand"]

Row = tuple[str, str]


@dataclass(frozen=True)
class InfoCommand:
    """Say what a file holds: a robot or a result (.npz), a scene (.toml), or a mesh.

    Without a file, say which version this is, where it runs, and how it uses this processor.
    """

    file: Annotated[Positional[Path | None], arg(metavar="FILE")] = None
    """A saved robot or result, a scene file, or a mesh of any format that ws.read_mesh reads."""
    scale: str = "1"
    """Of a mesh: metres in a unit of the file, or mm, cm, in, ..."""

    def run(self, console: Console) -> None:
        """Print a table."""
        from warp_springs.commands.scenes import print_rows

        print_rows(console, _machine() if self.file is None else self._of_file())

    def _of_file(self) -> list[Row]:
        if self.file.is_dir():
            raise IsADirectoryError(f"{self.file}: this is a folder, expected a file")
        if not self.file.is_file():
            raise FileNotFoundError(f"{self.file}: there is no such file")
        readers: dict[str, Callable[[Path], list[Row]]] = {".toml": _scene, ".npz": _saved}
        return readers.get(self.file.suffix.lower(), self._mesh)(self.file)

    def _mesh(self, path: Path) -> list[Row]:
        import warp_springs as ws
        from warp_springs.view.parameters import figures

        try:
            scale: float | str = float(self.scale)
        except ValueError:
            scale = self.scale
        body = ws.read_mesh(path, scale=scale)
        rows = [("holds", f"a mesh, {path.suffix}"), *figures(body)]
        if body.volume > 0.0:
            rows.append(("volume", f"{body.volume:.4g} m³"))
        return rows


def _machine() -> list[Row]:
    import platform

    import warp as wp

    import warp_springs as ws
    from warp_springs.kernels.dialect import native_width
    from warp_springs.simulation import usable_cores

    return [
        ("warp_springs", ws.__version__),
        ("Warp", wp.config.version),
        ("Python", platform.python_version()),
        ("platform", platform.platform()),
        ("devices", ", ".join(map(str, wp.get_devices()))),
        ("threads", str(usable_cores())),
        ("robots in a bundle, float64", str(native_width("float64"))),
        ("robots in a bundle, float32", str(native_width("float32"))),
        ("kernel cache", str(wp.config.kernel_cache_dir)),
    ]


def _scene(path: Path) -> list[Row]:
    from warp_springs.config import load_scene
    from warp_springs.view.parameters import figures

    config = load_scene(path)
    robots = config.build_robots()
    rows = [("holds", "a scene"), ("name", config.name), ("about", config.about)]
    rows += [("robots", f"{len(robots):,}"), ("springs", f"{sum(r.n_springs for r in robots):,}")]
    rows.append(("duration", f"{config.simulation.duration:g} s"))
    simulation = config.make_simulation()
    rows.append(("steps", f"from {simulation.robot_dt.min():.3g} s on"))
    rows += [(f"{config.names[0]}: {name}", value) for name, value in figures(robots[0])]
    return rows


def _saved(path: Path) -> list[Row]:
    """A robot or a result, whichever the file says that it is."""
    import warp_springs as ws
    from warp_springs.io.robots import FORMAT
    from warp_springs.io.trees import format_of
    from warp_springs.view.parameters import figures, outcome

    if format_of(path) == FORMAT:
        robot = ws.Robot.load(path)
        elements = repr(robot.elements).partition("(")[2].rstrip(")")
        rows = [("holds", "a robot"), *figures(robot)]
        return [*rows, ("elements", elements)] if elements else rows
    result = ws.Result.load(path)
    rows = [("holds", "a result"), ("robots", f"{len(result):,}")]
    if len(result.times):
        some = "1 robot" if len(result.recorded) == 1 else f"{len(result.recorded):,} robots"
        frames = f"{len(result.times):,} of {some}"
        rows.append(("frames", f"{frames}, {result.times[0]:g} s to {result.times[-1]:g} s"))
    method = f"{result.integrator}, {result.precision}, step {result.dt:g} s, {result.device}"
    rows += [("method", method), *outcome(result)]
    return rows + [(f"robot 0: {name}", value) for name, value in figures(result.robots[0])]
