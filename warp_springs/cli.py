"""The shell: ``warp-springs COMMAND``; each command stands in a module of ``commands``."""

from __future__ import annotations

import sys
from typing import Annotated, Union

from warp_springs.commands.bench import BenchCommand
from warp_springs.commands.demo import DemoCommand
from warp_springs.commands.export import ExportCommand
from warp_springs.commands.info import InfoCommand
from warp_springs.commands.render import RenderCommand
from warp_springs.commands.report import ReportCommand
from warp_springs.commands.run import RunCommand

__all__ = ["COMMANDS", "main"]

Command = (
    BenchCommand
    | DemoCommand
    | ExportCommand
    | InfoCommand
    | RenderCommand
    | ReportCommand
    | RunCommand
)

COMMANDS: dict[str, type[Command]] = {
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
    from rich.console import Console

    command = _parse(sys.argv[1:])
    from warp_springs.startup import one_line, quiet

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
        print(f"warp-springs: {one_line(error)}", file=sys.stderr)
        sys.exit(1)


def _parse(arguments: list[str]) -> Command:
    """Read the command line; helps and complains as asked for, and exits then."""
    import tyro
    from tyro.conf import subcommand

    if arguments and arguments[0] in COMMANDS:
        name, *rest = arguments
        return tyro.cli(COMMANDS[name], prog=f"warp-springs {name}", args=rest)
    # One line for each command here, all about it in its own help.
    choices = [
        Annotated[command, subcommand(name, description=command.__doc__.partition("\n")[0])]
        for name, command in COMMANDS.items()
    ]
    return tyro.cli(
        Union[tuple(choices)],  # noqa: UP007 (built at run time)
        prog="warp-springs",
        description="Step thousands of mass-spring soft robots in parallel, and look at them.",
        args=arguments or ["--help"],
    )


if __name__ == "__main__":
    main()
