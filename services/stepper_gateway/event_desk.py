"""The device's events as the bus has them: when they happened, and how grave they are."""

from __future__ import annotations

from schemas.system import LogLevel
from services.stepper_gateway.gateway_device import GatewayDevice
from services.stepper_gateway.links.reports import EventReport
from services.stepper_gateway.moment import Moment

TROUBLE = ("fault", "hold", "late", "underrun", "estop", "homing_stopped", "text_lost", "press_refused")
MOTION = {"started": "from", "finished": "at"}  # how the place of a motion's event is introduced
BY_A_PERSON = "command"  # the detail of what somebody has asked for


def pass_on(event: EventReport, device: GatewayDevice, moment: Moment) -> None:
    """Say it on the bus and in the log."""
    is_trouble = event.event in TROUBLE and event.detail != BY_A_PERSON
    level = LogLevel.WARNING if is_trouble else LogLevel.INFO
    now = moment.monotonic
    happened = device.session.clock.measured(event.t_us, now) if event.t_us else now
    said = _motion(event.event, device) if event.event in MOTION else ""
    device.event(event.event, event.detail, Moment(moment.unix_at(happened), happened), level, said)


def _motion(event: str, device: GatewayDevice) -> str:
    """That a motion begins or ends, and where the joints are; empty where that is not known."""
    if device.state is None:
        return ""
    places = zip(device.joints, device.reporter.positions(device.state.steps), strict=True)
    where = ", ".join(f"{joint.name} {position:+.4f} {joint.unit}" for joint, position in places)
    return f"motion {event}: {MOTION[event]} {where}"
