"""`gemelo device config`: shows the device's configuration, or sends it anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.device import DeviceConfiguration
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm
from gemelo.tools.cli.common.terminal import confirm
from gemelo.tools.cli.parser import Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm

QUESTION = because("cli.device.config.ask")


def add_options(parser: Parser) -> None:
    """Adds --show, --push, --yes and --json."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--show", action="store_true", help="what robot.toml asks for, and whether it is in force")
    what.add_argument("--push", action="store_true", help="disarm, give the device its configuration, arm again")
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before the drivers go off")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Shows or pushes the configuration."""
    with connect_arm() as arm:
        return push(arm, options.yes) if options.push else show(arm, options.json)


def show(arm: Arm, as_json: bool) -> ExitCode:
    """Prints the configuration that robot.toml asks for, and its state on the device."""
    wanted = arm.device.configuration
    if as_json:
        print(msgspec.json.encode(wanted).decode())
        return ExitCode.OK
    print(msgspec.json.format(wanted.text, indent=2))
    print(sentence(because("cli.device.config.crc32", in_force(wanted), crc32=f"{wanted.crc32:08x}")))
    return ExitCode.OK


def push(arm: Arm, yes: bool) -> ExitCode:
    """Disarms, configures and arms again; asks before the drivers go off. Raises `CommandError` if refused."""
    wanted = arm.device.configuration
    if wanted.accepted:
        print(sentence(because("cli.device.config.nothing_to_do", in_force(wanted), crc32=f"{wanted.crc32:08x}")))
        return ExitCode.OK
    was_armed = arm.device.state.armed
    try:
        crc32 = arm.device.configure(before_disarm=lambda: confirm(QUESTION, yes))
    except gemelo.Refused as error:
        again = because("cli.device.config.again", error.message)
        raise CommandError(again if error.check == "device" else error) from error
    print(sentence(because("cli.device.config.works", crc32=f"{crc32:08x}")))
    print(sentence(because("cli.device.config.armed" if was_armed else "cli.device.config.disarmed")))
    return ExitCode.OK


def in_force(wanted: DeviceConfiguration) -> Reason:
    """Whether the device works with it, else why not."""
    if wanted.accepted:
        return because("cli.device.config.in_force")
    if why := wanted.why or (plain(wanted.reason) if wanted.reason else None):
        return because("cli.device.config.not_in_force", why)
    return because("cli.device.config.other")
