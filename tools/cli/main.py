"""The `gemelo` command: finds the command in the table and runs it. There is no daemon."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from gemelo.libraries.runtime.process.leaving import end_process
from gemelo.schemas import plain_text
from gemelo.tools.cli.commands import COMMANDS, GROUPS
from gemelo.tools.cli.common import language
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.output import escaped_output
from gemelo.tools.cli.parser import Options, build

ABOUT = "The twin's command line: move the arm, and see everything that is said about it."
EPILOG = (
    "A command is for the robot that runs. `gemelo --robot NAME COMMAND` is for one of several, for another arm of\n"
    "urdf/, or for a recording that is played; `gemelo use NAME` chooses one of several for this folder.\n"
    "`gemelo --simulate COMMAND` is for a twin of its own in virtual time, for which nothing needs to run;\n"
    "`--simulate=START` has it stand in a named state, or unreferenced.\n"
    "`gemelo --lang es COMMAND` prints Spanish, which is the default where $LANG begins with es; JSON stays as it is."
)


def parse(arguments: Sequence[str]) -> Options:
    """The options of one command line; ends the process with a sentence if it cannot be understood.

    `behind` is what was typed behind the command, for one that becomes a program of its own.
    """
    options: Options = build(COMMANDS, GROUPS, ABOUT, EPILOG, arguments).parse_args(arguments)
    options.behind = tuple(arguments[len(options.command.words) :])
    return options


def with_leading_options(arguments: list[str]) -> list[str]:
    """The command with its own arguments: without `--simulate`, `--robot` and `--lang` before it, which are obeyed."""
    while arguments:
        option, _, value = arguments[0].partition("=")
        if option == "--simulate":
            from gemelo.tools.cli.simulated import choose  # slow to load, for --simulate alone

            choose(arguments.pop(0))
        elif option in LEADING and not value:
            if len(arguments) < 2:
                from gemelo.schemas.reasons import because  # 30 ms, where something is refused

                raise usage(because(LEADING[option][0]))
            LEADING[option][1](arguments[1])
            del arguments[:2]
        else:
            break
    return arguments


def choose_robot(name: str) -> None:
    """One of several arms that were started together has a deployment of its own; any other has that of this process.

    Raises `CommandError` where there is no such robot.
    """
    from gemelo.api.addresses import is_address  # slow to load, for --robot alone
    from gemelo.libraries.runtime.deployment import overriding
    from gemelo.libraries.runtime.started import deployment_of_arm

    if is_address(name):
        return choose_address(name)
    file = deployment_of_arm(name)
    if file is None:
        os.environ["GEMELO_ROBOT"] = robot_folder(name)
        return
    for variable in overriding(os.environ):  # what they said when it was started stands in the file
        del os.environ[variable]
    os.environ["GEMELO_CONFIG"] = str(file)


def choose_address(address: str) -> None:
    """The arm at the address of a router: its files come from there. Raises `CommandError`."""
    import gemelo
    from gemelo.api.bus_files import deployment_at  # slow to load, for an address alone

    try:
        found = deployment_at(address)
    except gemelo.Error as error:
        raise CommandError(error, ExitCode.NO_STACK if isinstance(error, gemelo.Lost) else ExitCode.USAGE) from error
    os.environ |= {
        "GEMELO_ROBOT": found.robot,
        "GEMELO_ROUTER_HOST": found.router.host,
        "GEMELO_ROUTER_PORT": str(found.router.port),
        "GEMELO_PATHS_RUN": found.paths.run,
    }


def robot_folder(name: str) -> str:
    """The folder of an arm, of a shadow that `gemelo bag play` has made, or of a robot that runs with files elsewhere;
    raises `CommandError` for none of them."""
    from gemelo.libraries.runtime.deployment import project_root  # slow to load, for --robot alone
    from gemelo.libraries.runtime.running import files_of, running_robots
    from gemelo.libraries.runtime.started import load_started

    root, deployment = project_root(), load_started()
    out = Path(deployment.paths.out)
    for folder in (root / "urdf" / name, out / "shadows" / name, Path(name)):
        if (folder / "robot.toml").is_file():
            return str(folder.resolve())
    running = running_robots(deployment.router)
    if name in running and (elsewhere := files_of(deployment.router, name, running[name])):
        return elsewhere
    known = [path.parent.name for where in (root / "urdf", out / "shadows") for path in where.glob("*/robot.toml")]
    raise unknown("robot", name, sorted({*known, *running}))


def choose_language(name: str) -> None:
    """Raises `CommandError` for a language that there is no folder of."""
    if name not in (known := plain_text.known()):
        raise unknown("language", name, known)
    language.choose(name)
    os.environ[plain_text.CHOSEN] = name  # of what this command starts


LEADING = {  # options before the command, each with a value: the code of its refusal without it, and what it does
    "--robot": ("cli.robot.no_value", choose_robot),
    "--lang": ("cli.lang.no_value", choose_language),
}


@contextmanager
def same_language_after() -> Iterator[None]:
    """The language that `--lang` chose is that of this command line alone, where a process runs several."""
    before = os.environ.get(plain_text.CHOSEN)
    try:
        yield
    finally:
        os.environ.pop(plain_text.CHOSEN, None)
        if before is not None:
            os.environ[plain_text.CHOSEN] = before


def run(arguments: Sequence[str] | None = None) -> ExitCode:
    """Runs one command line, by default that of the process; prints every failure as one sentence on stderr, and
    nothing with control characters of others."""
    with escaped_output(), same_language_after():
        return _run(list(sys.argv[1:] if arguments is None else arguments))


def _run(given: list[str]) -> ExitCode:
    try:
        language.choose(plain_text.of_environment(os.environ))
        options = parse(with_leading_options(given))
        code: ExitCode = options.command.load("run")(options)
        sys.stdout.flush()
        return code
    except CommandError as error:
        print(f"gemelo: {error}", file=sys.stderr)
        return error.code
    except ModuleNotFoundError as error:
        from gemelo.libraries.runtime.extras import missing_extra  # for who lacks one alone

        if (reason := missing_extra(error)) is None:
            raise
        print(f"gemelo: {language.sentence(reason)}", file=sys.stderr)
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.CANCELLED
    except BrokenPipeError:
        # The reader (as `head`) has enough; without this the interpreter complains again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.OK
    finally:
        if (simulated := sys.modules.get("gemelo.tools.cli.simulated")) is not None:
            simulated.end()


def main() -> NoReturn:
    """The console script."""
    end_process(run())


if __name__ == "__main__":
    main()
