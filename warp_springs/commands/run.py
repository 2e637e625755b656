"""``warp-springs run SCENE.toml``."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["RunCommand"]

ANYWHERE = "127.0.0.1:0"


@dataclass(frozen=True)
class RunCommand:
    """Simulate a scene file: robots, world, simulation and recording in one TOML file.

    Writes what its table [record] asks for: by default NAME.npz (the result, for ws.Result.load),
    NAME.usdc (animation), NAME.png (the end), NAME_energies.png; and always NAME_parameters.md
    (every parameter, and what came of it) and NAME.toml (the scene with all its defaults). Exits
    with 3 if a robot had to be stopped.

    Begin with a copy of a demonstration: warp-springs demo bouncing-cube --toml > scene.toml
    All keys: warp-springs run --keys

    Any key can be set, for example
    warp-springs run scene.toml --set robot.body.edge=0.2 scene.damping=1 record.fps=30
    """

    scene: Annotated[Positional[Path | None], arg(metavar="SCENE.toml")] = None
    """The scene."""
    out: Path = Path("out")
    """Folder to write to; made if it is missing."""
    set: Annotated[tuple[str, ...], arg(metavar="KEY=VALUE ...", help_behavior_hint="")] = ()
    """Keys of the scene by their full names, values as in TOML."""
    live: FlagCreatePairsOff[bool] = False
    """Serve a page with the frames so far and a curve while it runs, to this machine only; its
    address is printed."""
    live_at: Annotated[str, arg(metavar="ADDRESS:PORT")] = ANYWHERE
    """Where to serve it; port 0 takes one that is free."""
    keys: bool = False
    """Print all keys with their defaults and what they mean instead."""

    def run(self, console: Console) -> int:
        """Simulate, write, and say what was written."""
        from warp_springs.commands.live import watching
        from warp_springs.commands.scenes import simulated, write_and_say
        from warp_springs.config import SceneFile, load_scene, parse_settings, reference
        from warp_springs.io.outputs import made_folder
        from warp_springs.view.pages.live import LiveServer

        if self.keys:
            print(reference(SceneFile), end="")
            return 0
        if self.scene is None:
            print("warp-springs run: SCENE.toml is missing; --help explains", file=sys.stderr)
            return 2
        config = load_scene(self.scene, parse_settings(self.set))
        place = LiveServer.place(self.live_at)
        if self.live_at != ANYWHERE and not self.live:
            raise ValueError(f"--live-at {self.live_at} goes with --live")
        made_folder(self.out)
        with watching(config, place, console) if self.live else nullcontext() as watch:
            result = simulated(config, console, watch)
        write_and_say(config, result, self.out, console)
        return 3 if result.status.any() else 0
