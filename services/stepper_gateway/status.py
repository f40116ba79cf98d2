"""What the bus is told of who the device is, and whether it can be used."""

from __future__ import annotations

from schemas.device import DeviceStatus
from services.stepper_gateway.links.reports import StatusReport
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.mover import Mover


def status_of(mover: Mover, moment: Moment) -> DeviceStatus:
    """Only the boot that says its states is described; a silent device is offline, whatever a broker has retained."""
    absence, session = mover.absence(moment), mover.session
    report = session.status or StatusReport(online=False)
    return DeviceStatus(
        stamp=moment.unix,
        online=not absence,
        reason=absence or mover.hindrance(),
        device=mover.arm.device.name,
        firmware=report.firmware,
        boot_id=session.boot_id,
        reset_cause=report.reset_cause,
        joints=report.joints,
        tick_hz=report.tick_hz,
        queue_capacity=report.queue_capacity,
        config_crc32=mover.configuration.device_crc32,
        wanted_crc32=mover.configuration.crc32,
        virtual=report.virtual,
    )
