"""`gemelo device config`: shows the device's configuration, or sends it anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.device import DeviceConfiguration
from gemelo.tools.cli.common.errors import CommandError, ExitCode, text_of
from gemelo.tools.cli.common.session import connect_arm
from gemelo.tools.cli.common.terminal import confirm
from gemelo.tools.cli.parser import Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm

QUESTION = "The drivers go off (an arm that its motors hold up may sink) and every joint has to be referenced anew."


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
    print(f"crc32 {wanted.crc32:08x}, {_force(wanted)}")
    return ExitCode.OK


def push(arm: Arm, yes: bool) -> ExitCode:
    """Disarms, configures and arms again; asks before the drivers go off. Raises `CommandError` if refused."""
    wanted = arm.device.configuration
    if wanted.accepted:
        print(f"nothing to do: {_force(wanted)} (crc32 {wanted.crc32:08x})")
        return ExitCode.OK
    was_armed = arm.device.state.armed
    try:
        crc32 = arm.device.configure(before_disarm=lambda: confirm(QUESTION, yes))
    except gemelo.Refused as error:
        again = ", and push again" if error.check == "device" else ""
        raise CommandError(f"{text_of(error)}{again}") from error
    print(f"the device works with configuration {crc32:08x}")
    if was_armed:
        print("armed again; no joint is referenced: `gemelo home` or `gemelo reference`")
    else:
        print("disarmed; no joint is referenced: `gemelo device arm`, then `gemelo home` or `gemelo reference`")
    return ExitCode.OK


def _force(wanted: DeviceConfiguration) -> str:
    if wanted.accepted:
        return "in force: the device works with it"
    return f"NOT in force: {wanted.reason or 'the device has another'}"
