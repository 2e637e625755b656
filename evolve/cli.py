"""The shell: ``evolve COMMAND``; each command stands in a module of ``evolve.commands``."""

from __future__ import annotations

import sqlite3
import sys
from collections.abc import Sequence
from typing import Annotated, Union

import tyro
from tyro.conf import subcommand

from evolve.commands.export import Export
from evolve.commands.lineage import Lineage
from evolve.commands.presets import Presets
from evolve.commands.results import Digest, Report
from evolve.commands.run import Resume, Run
from evolve.commands.shared import INTERRUPTED
from evolve.errors import RunError

__all__ = ["main"]

FAILURES = (RunError, ValueError, OSError, RuntimeError, MemoryError, sqlite3.Error)
"""What may happen to a person; anything else is our own mistake and shows where it was made."""

Command = Presets | Run | Resume | Report | Export | Lineage | Digest

COMMANDS: dict[str, type[Command]] = {
    "presets": Presets,
    "run": Run,
    "resume": Resume,
    "report": Report,
    "export": Export,
    "lineage": Lineage,
    "digest": Digest,
}


def main(argv: Sequence[str] | None = None) -> None:
    """Entry point of `evolve`.

    Exits with 0, with 1 after an error (one line on stderr), with 2 when the command line makes no
    sense, with 130 after Ctrl-C.
    """
    sys.exit(_run(_parse(list(sys.argv[1:] if argv is None else argv))))


def _parse(arguments: list[str]) -> Command:
    """Read the command line; helps and complains as asked for, and exits then."""
    if arguments and arguments[0] in COMMANDS:
        name, *rest = arguments
        return tyro.cli(COMMANDS[name], prog=f"evolve {name}", args=rest)
    # One line for each command here, all about it in its own help.
    choices = [
        Annotated[command, subcommand(name, description=command.__doc__.partition("\n")[0])]
        for name, command in COMMANDS.items()
    ]
    return tyro.cli(
        Union[tuple(choices)],  # noqa: UP007 (built at run time)
        prog="evolve",
        description="Evolve soft robots. Begin with: evolve run walker",
        args=arguments or ["--help"],
    )


def _run(command: Command) -> int:
    """Run a command; errors become one line."""
    from rich.console import Console

    try:
        return command(Console())
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has gone: there is nobody left to tell.
        sys.stdout = None
        return 1
    except FAILURES as error:
        from warp_springs import one_line

        print(f"evolve: {one_line(error)}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    main()
