"""The `gemelo` command. Each command imports what it needs when it runs; there is no daemon."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from services.cli import (
    arm_commands,
    bus_commands,
    collision_commands,
    device_commands,
    jog_commands,
    kinematic_commands,
    scene_commands,
    system_commands,
)
from services.cli.exits import CommandError, ExitCode
from services.cli.parser import Options, Parser, build

ABOUT = "The twin's command line: move the arm, and see everything that is said about it."
EPILOG = "The deployment is deploy/local.toml, or the file that $GEMELO_CONFIG names."
COMMANDS = (
    *arm_commands.COMMANDS, *jog_commands.COMMANDS, *kinematic_commands.COMMANDS, *device_commands.COMMANDS,
    *bus_commands.COMMANDS, *scene_commands.COMMANDS, *collision_commands.COMMANDS, *system_commands.COMMANDS,
)  # fmt: skip
GROUPS = {
    **device_commands.GROUPS,
    **scene_commands.GROUPS,
    **collision_commands.GROUPS,
    **bus_commands.GROUPS,
    **system_commands.GROUPS,
}


def parser() -> Parser:
    return build(COMMANDS, GROUPS, ABOUT, EPILOG)


def run(arguments: Sequence[str] | None = None) -> ExitCode:
    """Runs one command line; every failure is one sentence on stderr."""
    options: Options = parser().parse_args(arguments)
    try:
        code: ExitCode = options.command.run(options)
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
