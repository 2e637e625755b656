"""``warp-springs render FILE OUT``: a picture or a film of a saved result."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from warp_springs.commands.progress import progress

if TYPE_CHECKING:
    from rich.console import Console

    from warp_springs.result import Result

__all__ = ["RenderCommand"]

_OWN = ("file", "out", "again")


@dataclass(frozen=True)
class RenderCommand:
    """Draw a picture (.png) or a film (.mp4, .webp) of the robots of a saved result.

    A film shows at least three cycles of the muscles: where fewer were recorded, the robots are
    simulated again from their start for as long as that takes.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """A result that was saved (.npz)."""
    out: Annotated[Positional[Path], arg(metavar="OUT")]
    """What to write: .png, .mp4 (needs the extra "video") or .webp."""
    robots: tuple[int, ...] | None = None
    """Indices of the robots; all that were recorded when left out."""
    frame: int = -1
    """Which recorded frame a picture shows, negative from the last."""
    size: tuple[int, int] = (1280, 720)
    """Width and height in pixels."""
    layout: Literal["grid", "panel", "world"] | None = None
    """Several robots side by side in one world, each in a tile with its own camera, or where they
    are. By itself: what suits the scene."""
    color: Literal["stress", "material", "actuation", "plain"] = "stress"
    """What the colour of a bar says."""
    skin: str = "yes"
    """Faces: yes, no, or their colour "#rrggbb"."""
    bars: bool = True
    """Whether to draw the springs."""
    balls: bool = True
    """Whether to draw the masses."""
    thickness: float = 1.0
    """Of bars and spheres, in units of the usual one."""
    azimuth: float | None = None
    """Where the camera stands around the vertical, degrees from +x towards +y."""
    elevation: float | None = None
    """How high the camera stands above the horizon, degrees."""
    labels: tuple[str, ...] | None = None
    """One text for each robot."""
    caption: str | None = None
    """A text in the upper left corner."""
    legend: bool = False
    """Whether to say in the lower right corner what the colours mean."""
    fps: float = 30.0
    """Pictures per second of a film."""
    speed: float = 1.0
    """Seconds of the run per second of the film: 0.25 is slow motion."""
    start: float | None = None
    """Where in the run a film starts [s]."""
    duration: float | None = None
    """How much of the run it shows [s]; all when left out."""
    follow: bool = True
    """Whether the camera goes along with the robots."""
    turns: float = 0.0
    """How often the camera goes around them in the whole film."""
    clock: bool = True
    """Whether a film shows the time of the run."""
    device: str = "cpu"
    """Warp device that draws: cpu or cuda:0."""
    threads: int | None = None
    """Threads that draw on a CPU; one for each core when left out."""
    again: bool = True
    """Whether to simulate again where fewer than three cycles were recorded."""

    def run(self, console: Console) -> None:
        """Load, draw, and say what was written."""
        import warp_springs as ws

        result = ws.Result.load(self.file)
        command = self
        if self.out.suffix.lower() != ".png" and self.again and self.duration is None:
            result, command = self._three_cycles(console, result)
        given = {f.name: getattr(command, f.name) for f in fields(self) if f.name not in _OWN}
        given["skin"] = {"yes": True, "no": False}.get(self.skin, self.skin)
        with progress(console, "drawing") as done, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the number of cycles has been settled here
            path = ws.render(result, self.out, progress=done, **given)
        console.print(f"wrote {path}", markup=False, soft_wrap=True)

    def _three_cycles(self, console: Console, result: Result) -> tuple[Result, RenderCommand]:
        """The result, or a longer one of the robots that are shown if it holds too few cycles."""
        import warp_springs as ws
        from warp_springs.view.look import LEAST_CYCLES

        shown = self.robots if self.robots is not None else result.recorded
        shown = [i for i in (shown or range(len(result))) if -len(result) <= i < len(result)]
        bodies = [result.robots[i] for i in shown]
        cycles = [2 * math.pi / abs(b.omega) for b in bodies if b.is_actuated and b.omega]
        needed = LEAST_CYCLES * max(cycles, default=0.0)
        start = self.start or 0.0
        if not needed and len(result.times) > 1:  # nothing has cycles: a film shows what there is
            return result, self
        held = result.times[-1] - result.times[0] - start if len(result.times) else 0.0
        if held >= needed * (1 - 1e-6) and len(result.times) > 1:
            return result, self
        duration = start + max(needed, 1.0 if held <= 0.0 else held)
        console.print(
            f"{self.file} holds {held:.3g} s and {LEAST_CYCLES} cycles take {needed:.3g} s: "
            f"simulating {duration:.3g} s",
            soft_wrap=True,
        )
        how = {"dt": result.dt, "precision": result.precision, "integrator": result.integrator}
        simulation = ws.Simulation(bodies, result.scene, **how)
        with progress(console, "simulating") as done:
            longer = simulation.run(duration, fps=self.fps, progress=done)
        return longer, replace(self, robots=None)
