"""`gemelo device config`: shows the device's configuration, or sends it anew."""

from __future__ import annotations

import msgspec

from schemas.device import (
    ArmCommand,
    ConfigureRequest,
    DeviceConfiguration,
    DeviceMode,
    DeviceState,
    StopKind,
)
from schemas.topics import DEVICE_CONFIGURE
from services.cli.device import ask, wait_for_drivers
from services.cli.device_snapshot import DeviceView
from services.cli.errors import CommandError, ExitCode
from services.cli.parser import Options, Parser, json_option
from services.cli.session import Session, connect
from services.cli.terminal import confirm

TO_ANSWER = 10.0  # [s] for a configuration: a board may write it to its flash first
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
    with connect() as session:
        return push(session, options.yes) if options.push else show(session, options.json)


def show(session: Session, as_json: bool) -> ExitCode:
    """Prints the configuration that robot.toml asks for, and its state on the device."""
    wanted = _wanted(DeviceView(session))
    if as_json:
        print(msgspec.json.encode(wanted).decode())
        return ExitCode.OK
    print(msgspec.json.format(wanted.text, indent=2))
    print(f"crc32 {wanted.crc32:08x}, {_force(wanted)}")
    return ExitCode.OK


def push(session: Session, yes: bool) -> ExitCode:
    """Disarms, configures and arms again; asks before the drivers go off. Raises `CommandError` if refused."""
    view = DeviceView(session)
    state, wanted = view.require_state(), _wanted(view)
    if wanted.accepted:
        print(f"nothing to do: {_force(wanted)} (crc32 {wanted.crc32:08x})")
        return ExitCode.OK
    _require_rest(state)
    if state.armed:
        confirm(QUESTION, yes)
        ask(session, StopKind.DISARM)
        view.wait_for(lambda: view.state.message is not None and not view.state.message.armed)
    answer = session.node.call(DEVICE_CONFIGURE, ConfigureRequest(), timeout=TO_ANSWER)
    if not answer.accepted:
        again = "; the drivers are off now: `gemelo device arm`" if state.armed else ""
        raise CommandError(f"the device refused the configuration: {answer.reason}{again}")
    print(f"the device works with configuration {answer.crc32:08x}")
    if state.armed:
        ask(session, ArmCommand())
        wait_for_drivers(session)
        print("armed again; no joint is referenced: `gemelo home` or `gemelo reference`")
    else:
        print("disarmed; no joint is referenced: `gemelo device arm`, then `gemelo home` or `gemelo reference`")
    return ExitCode.OK


def _wanted(view: DeviceView) -> DeviceConfiguration:
    if not view.wait_for(lambda: view.configuration.message is not None):
        raise CommandError("nobody says what robot.toml asks for: is stepper_gateway running?", ExitCode.NO_STACK)
    assert view.configuration.message is not None
    return view.configuration.message


def _force(wanted: DeviceConfiguration) -> str:
    if wanted.accepted:
        return "in force: the device works with it"
    return f"NOT in force: {wanted.reason or 'the device has another'}"


def _require_rest(state: DeviceState) -> None:
    if state.mode in (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING):
        raise CommandError(f"refused: the device is in {state.mode.name}: wait, or `gemelo stop`, and push again")
