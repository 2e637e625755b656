"""What ``run`` and ``demo`` have in common: simulating a scene file with everything to see."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warp_springs.commands.progress import progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from warp_springs.config import SceneFile
    from warp_springs.result import Result
    from warp_springs.simulation import Simulation

__all__ = ["print_rows", "simulated", "write_and_say"]


def simulated(
    config: SceneFile,
    console: Console,
    watch: Callable[[Simulation, float], None] | None = None,
) -> Result:
    """Simulate a scene file with a bar that shows the progress; `watch` as in `SceneFile.run`."""
    from rich.markup import escape

    console.print(
        f"[bold]{escape(config.name)}[/]  {escape(config.about)}", highlight=False, soft_wrap=True
    )
    with progress(console, "simulating") as advance:
        return config.run(advance, watch)


def write_and_say(
    config: SceneFile,
    result: Result,
    folder: Path,
    console: Console,
    findings: Sequence[tuple[str, str]] = (),
) -> list[Path]:
    """Write the files of a run, print what came of it and where everything is."""
    from warp_springs.view.outputs import write_outputs
    from warp_springs.view.parameters import outcome

    with console.status("writing"):
        paths = write_outputs(config, result, folder, findings)
    print_rows(console, [*findings, *outcome(result)])
    print("wrote")
    for path in paths:
        print(f"  {path}")
    sys.stdout.flush()
    return paths


def print_rows(console: Console, rows: list[tuple[str, str]], title: str | None = None) -> None:
    """Print a table with two columns."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(escape(name), escape(value))
    console.print(table, highlight=False)
