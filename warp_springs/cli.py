"""The shell: ``warp-springs COMMAND``; each command stands in a module of ``commands``."""

from __future__ import annotations

import sys

from warp_springs.commands.bench import BenchCommand
from warp_springs.commands.demo import DemoCommand
from warp_springs.commands.export import ExportCommand
from warp_springs.commands.info import InfoCommand
from warp_springs.commands.render import RenderCommand
from warp_springs.commands.report import ReportCommand
from warp_springs.commands.run import RunCommand

__all__ = ["COMMANDS", "main"]

COMMANDS = {
    "bench": BenchCommand,
    "demo": DemoCommand,
    "export": ExportCommand,
    "info": InfoCommand,
    "render": RenderCommand,
    "report": ReportCommand,
    "run": RunCommand,
}


def main() -> None:
    """Entry point of ``warp-springs``.

    Exit code 0, 1 (failed), 2 (bad usage), 3 (a robot was stopped) or 130 (Ctrl-C).
    """
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
        sys.exit(command.run(Console()) or 0)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # Whoever read our output has gone: there is nobody left to tell.
        sys.stdout = None
        sys.exit(1)
    except (OSError, ValueError, RuntimeError) as error:
        print(f"warp-springs: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
