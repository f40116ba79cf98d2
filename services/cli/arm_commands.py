"""Commands that move the arm, tell how it is, or switch what is on it: move, home, state, output, ..."""

from __future__ import annotations

from services.cli.exits import ExitCode
from services.cli.move_options import move_options
from services.cli.parser import Command, Options, Parser, Words, finite_number, json_option


def move(options: Options) -> ExitCode:
    from services.cli.move import move
    from services.cli.move_options import request_from
    from services.cli.session import connect, load

    request = request_from(options, load()[1])
    with connect() as session:
        return move(session, request, options.plan_only, options.json)


def state_options(parser: Parser) -> None:
    parser.add_argument("-w", "--watch", action="store_true", help="again and again, until Ctrl-C")
    parser.add_argument("--json", action="store_true", help="JSON, in SI units")


def state(options: Options) -> ExitCode:
    from services.cli.session import connect
    from services.cli.state import state

    with connect() as session:
        return state(session, options.watch, options.json)


def device_command(options: Options) -> ExitCode:
    from services.cli.device import command
    from services.cli.session import connect

    with connect() as session:
        return command(session, options.command.words[0])


def reference_options(parser: Parser) -> None:
    parser.add_argument(
        "--joints", nargs="+", default=[], metavar="JOINT=VALUE", help="where they stand, as 30deg or 40mm"
    )


def reference(options: Options) -> ExitCode:
    from services.cli.device import reference
    from services.cli.session import connect

    with connect() as session:
        return reference(session, options.joints)


def home_options(parser: Parser) -> None:
    parser.add_argument("joints", metavar="JOINT", nargs="*", help="all that have a home switch, if none is named")
    json_option(parser)


def home(options: Options) -> ExitCode:
    from services.cli.device_names import homing_joints
    from services.cli.home import home
    from services.cli.session import connect, load

    homing_joints(load()[1], options.joints)
    with connect() as session:
        return home(session, options.joints, options.json)


def output_options(parser: Parser) -> None:
    parser.add_argument("output", metavar="OUTPUT", help="a name of robot.toml's [[output]]")
    parser.add_argument("state", choices=("on", "off"), help="on or off")


def output(options: Options) -> ExitCode:
    from services.cli.device import output
    from services.cli.device_names import require_name
    from services.cli.session import connect, load

    require_name("output", options.output, load()[1].outputs)
    with connect() as session:
        return output(session, options.output, options.state == "on")


def sensors(options: Options) -> ExitCode:
    from services.cli.device_status import sensors
    from services.cli.session import connect

    with connect() as session:
        return sensors(session, options.json)


def percent(text: str) -> float:
    return finite_number(text.removesuffix("%"))


def speed_options(parser: Parser) -> None:
    parser.add_argument("percent", metavar="PERCENT", type=percent, help="of the planned speed, 0 to 100")


def speed(options: Options) -> ExitCode:
    from services.cli.device import share_of, speed
    from services.cli.session import connect

    share_of(options.percent)
    with connect() as session:
        return speed(session, options.percent)


def joint_words() -> Words:
    from services.cli.device_words import joints

    return joints()


def output_words() -> Words:
    from services.cli.device_words import outputs

    return outputs()


COMMANDS = (
    Command(("move",), "plan a way to a goal and go it; Ctrl-C slows the arm down to rest", move, move_options),
    Command(("state",), "joints, tool, steps commanded and executed, device", state, state_options),
    Command(("hold",), "slow down on the path and stand there", device_command),
    Command(("resume",), "go on along the path after a hold", device_command),
    Command(("stop",), "slow down on the path and forget the rest of it", device_command),
    Command(("reset",), "leave Fault or EStop, when a person has seen why", device_command),
    Command(
        ("reference",),
        "declare where the joints stand; those not named stand at robot.toml's reference position",
        reference,
        reference_options,
    ),
    Command(("home",), "let the joints find their switches; Ctrl-C stops them", home, home_options,
            "gemelo home brazo_joint", joint_words),
    Command(("output",), "switch an output of the device", output, output_options, "gemelo output avanzar on",
            output_words),
    Command(("sensors",), "what the device's sensors read", sensors, json_option, "gemelo sensors --json"),
    Command(("speed",), "how fast the device plays every path from now on; 0 lets it stand on it", speed, speed_options,
            "gemelo speed 50"),
)  # fmt: skip
