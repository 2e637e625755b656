"""The shell: ``warp-springs COMMAND``; each command stands in a module of ``commands``."""

from __future__ import annotations

import sys

from warp_springs.commands.bench import BenchCommand
from warp_springs.commands.demo import DemoCommand
from warp_springs.commands.info import InfoCommand
from warp_springs.commands.render import RenderCommand

__all__ = ["COMMANDS", "main"]

COMMANDS = {
    "bench": BenchCommand,
    "demo": DemoCommand,
    "info": InfoCommand,
    "render": RenderCommand,
}


def main() -> None:
    """Entry point of ``warp-springs``: exit code 0, 1 (failed), 2 (bad usage) or 130 (Ctrl-C)."""
    import tyro
    from rich.console import Console

    command = tyro.extras.subcommand_cli_from_dict(
        COMMANDS,
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
