"""`gemelo use`: which of several robots the commands of this folder are for."""

from __future__ import annotations

from gemelo.libraries.runtime.running import running_robots
from gemelo.libraries.runtime.started import choose_name, chosen_name, load_started
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.parser import Options, Parser


def add_options(parser: Parser) -> None:
    """Adds the robot and --none."""
    one = parser.add_mutually_exclusive_group()
    one.add_argument("robot", metavar="NAME", nargs="?", default="", help="of the robots that run; left out: say which")
    one.add_argument("--none", action="store_true", help="choose none: of several one is named with each command")


def run(options: Options) -> ExitCode:
    """Chooses the robot, or prints what runs and which is chosen; raises `CommandError` for one that does not run."""
    router = load_started().router
    running = sorted(running_robots(router))
    if options.robot and options.robot not in running:
        if not running:
            raise CommandError(f"no robot runs at {router.host}:{router.port}: start it first", ExitCode.NO_STACK)
        raise unknown("robot that runs", options.robot, running)
    if options.robot or options.none:
        try:
            choose_name(options.robot)
        except OSError as error:
            raise usage(f"the choice cannot be written: {error}") from error
    print(standing(running, chosen_name()))
    return ExitCode.OK


def standing(running: list[str], chosen: str) -> str:
    """What runs, and which robot commands without `--robot` are for."""
    runs = f"{', '.join(running)} runs" if len(running) == 1 else f"{', '.join(running) or 'none'} run"
    if len(running) == 1:
        return f"{runs}: commands of this folder are for it"
    if chosen in running:
        return f"{runs}: commands of this folder are for {chosen}"
    if not running:
        return f"{runs}" + (f"; of several {chosen} is chosen" if chosen else "")
    return f"{runs}, and none is chosen: `gemelo use {running[0]}`, or `gemelo --robot {running[0]} ...` with each"
