"""The `gemelo` command: finds the command in the table and runs it. There is no daemon."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from services.cli.commands import COMMANDS, GROUPS
from services.cli.errors import CommandError, ExitCode
from services.cli.parser import Options, build

ABOUT = "The twin's command line: move the arm, and see everything that is said about it."
EPILOG = "The deployment is deploy/local.toml, or the file that $GEMELO_CONFIG names."


def parse(arguments: Sequence[str]) -> Options:
    """The options of one command line; ends the process with a sentence if it cannot be understood."""
    return build(COMMANDS, GROUPS, ABOUT, EPILOG, arguments).parse_args(arguments)


def run(arguments: Sequence[str] | None = None) -> ExitCode:
    """Runs one command line, by default that of the process; prints every failure as one sentence on stderr."""
    options = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        code: ExitCode = options.command.load("run")(options)
        sys.stdout.flush()
        return code
    except CommandError as error:
        print(f"gemelo: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        return ExitCode.CANCELLED
    except BrokenPipeError:
        # The reader (as `head`) has enough; without this the interpreter complains again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.OK


def main() -> None:
    """The console script."""
    sys.exit(run())


if __name__ == "__main__":
    main()
