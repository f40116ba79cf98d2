"""`gemelo use`: which of several robots the commands of this folder are for."""

from __future__ import annotations

from gemelo.libraries.runtime.running import running_robots
from gemelo.libraries.runtime.started import choose_name, chosen_name, load_started
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.language import sentence
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
            raise CommandError(because("cli.use.nothing", host=router.host, port=router.port), ExitCode.NO_STACK)
        raise unknown("robot that runs", options.robot, running)
    if options.robot or options.none:
        try:
            choose_name(options.robot)
        except OSError as error:
            raise usage(because("cli.use.unwritten", error=str(error))) from error
    print(sentence(standing(running, chosen_name())))
    return ExitCode.OK


def standing(running: list[str], chosen: str) -> Reason:
    """What runs, and which robot commands without `--robot` are for."""
    names = ", ".join(running)
    if len(running) == 1:
        return because("cli.use.one", robot=names)
    if chosen in running:
        return because("cli.use.chosen", robots=names, chosen=chosen)
    if not running:
        return because("cli.use.none_but", chosen=chosen) if chosen else because("cli.use.none")
    return because("cli.use.which", robots=names, first=running[0])
