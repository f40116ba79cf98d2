"""`gemelo device status` and `gemelo sensors`: the device at one glance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from services.cli.columns import table
from services.cli.device_snapshot import DeviceSnapshot, device_snapshot, readings
from services.cli.device_text import text_of
from services.cli.device_view import DeviceView
from services.cli.exits import CommandError, ExitCode

if TYPE_CHECKING:
    from services.cli.session import Session

FOR_SENSORS = 0.5  # [s] that a glance waits for them


def status(session: Session, as_json: bool) -> ExitCode:
    """Prints who the device is and how."""
    view = DeviceView(session)
    view.require_heard()
    if session.arm.sensors and view.state.message is not None:
        view.wait_for(lambda: view.sensors.message is not None, FOR_SENSORS)
    shown = snapshot_of(view)
    print(msgspec.json.encode(shown).decode() if as_json else text_of(shown))
    return ExitCode.OK


def snapshot_of(view: DeviceView) -> DeviceSnapshot:
    """What is known now; readings that are no longer fresh are left out."""
    return device_snapshot(
        view.session.arm,
        view.status.message,
        view.state.message,
        view.configuration.message,
        None if view.sensors.is_stale else view.sensors.message,
    )


def sensors(session: Session, as_json: bool) -> ExitCode:
    """Prints every sensor's reading; fails where there is none."""
    if not session.arm.sensors:
        raise CommandError("robot.toml has no [[sensor]], so there is none to read")
    view = DeviceView(session)
    if not view.wait_for(lambda: view.sensors.message is not None):
        view.require_state()
        raise CommandError("the device has sent no reading for 2 s: `gemelo device status`, `gemelo log`")
    shown = readings(session.arm, view.sensors.message)
    if as_json:
        print(msgspec.json.encode(shown).decode())
    else:
        rows = [(each.name, "-" if each.value is None else f"{each.value:.6g}", each.unit or "-") for each in shown]
        print(table(("sensor", "value", "unit"), rows))
    return ExitCode.OK
