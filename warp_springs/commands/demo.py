"""``warp-springs demo NAME``: one of the classroom's demonstrations."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from warp_springs.demos import NAMES

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["DemoCommand"]


@dataclass(frozen=True)
class DemoCommand:
    """Simulate one of the classroom's demonstrations.

    Writes to the output folder: NAME.usdc (an animation for usdview, Blender, Omniverse or a
    phone), NAME.png (a picture of the end), NAME_energies.png (energies over time, and by how much
    the total varies), NAME_parameters.md (every parameter, and what the demonstration shows) and
    NAME.toml (its scene file, for warp-springs run).
    """

    name: Annotated[Positional[str | None], arg(metavar="NAME")] = None
    """Which demonstration: --list names them."""
    out: Path = Path("out")
    """Folder to write to; made if it is missing."""
    set: Annotated[tuple[str, ...], arg(metavar="KEY=VALUE ...", help_behavior_hint="")] = ()
    """Keys of its scene file by their full names, values as in TOML."""
    list: bool = False
    """Name all demonstrations, and do nothing else."""
    toml: bool = False
    """Print the scene file instead: to copy and change."""

    def run(self, console: Console) -> int:
        """Simulate, export, and say what was written."""
        from warp_springs import demos
        from warp_springs.config import parse_settings
        from warp_springs.io.outputs import made_folder

        if self.list or self.name is None:
            print("\n".join(f"{name:<16}{demos.about(name)}" for name in NAMES))
            return 0 if self.list else 2
        if self.name not in NAMES:
            near = difflib.get_close_matches(self.name, NAMES, 1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise ValueError(f"there is no demonstration {self.name!r}{hint}; there are "
                             f"{', '.join(NAMES)}")  # fmt: skip
        if self.toml:
            print(demos.text(self.name), end="")
            return 0
        config = demos.load(self.name, parse_settings(self.set))
        made_folder(self.out)
        if self.name == "slope":
            from warp_springs.demos.slope import demonstrate

            return demonstrate(config, self.out, console)
        return self._simulate(config, console)

    def _simulate(self, config, console: Console) -> int:
        from warp_springs.commands.scenes import print_rows, simulated, write_and_say
        from warp_springs.demos.findings import findings
        from warp_springs.view.parameters import parameters

        result = simulated(config, console)
        print_rows(console, parameters(config, result), title="parameters")
        write_and_say(config, result, self.out, console, findings(config, result))
        return 3 if result.status.any() else 0
