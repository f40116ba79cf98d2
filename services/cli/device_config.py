"""`gemelo device config`: what robot.toml asks of the device, whether it works with it, and giving it anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from services.cli.confirm import confirm
from services.cli.device import ask, wait_for_drivers
from services.cli.device_view import DeviceView
from services.cli.exits import CommandError, ExitCode

if TYPE_CHECKING:
    from services.cli.session import Session

TO_ANSWER = 10.0  # [s] for a configuration: a board may write it to its flash first
QUESTION = "The drivers go off (an arm that its motors hold up may sink) and every joint has to be referenced anew."


def show(session: Session, as_json: bool) -> ExitCode:
    """Prints the configuration and whether it is in force."""
    wanted = _wanted(DeviceView(session))
    if as_json:
        print(msgspec.json.encode(wanted).decode())
        return ExitCode.OK
    print(msgspec.json.format(wanted.text, indent=2))
    print(f"crc32 {wanted.crc32:08x}, {_force(wanted)}")
    return ExitCode.OK


def push(session: Session, yes: bool) -> ExitCode:
    """Disarms, configures and arms again; asks first where a person would lose something."""
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
