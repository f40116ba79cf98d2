"""What the bus is told of who the device is, and whether it can be used."""

from __future__ import annotations

from schemas.device import DeviceStatus
from services.stepper_gateway.gateway_device import GatewayDevice
from services.stepper_gateway.links.reports import StatusReport
from services.stepper_gateway.moment import Moment


def status_of(device: GatewayDevice, moment: Moment) -> DeviceStatus:
    """Only the boot that says its states is described; a silent device is offline, whatever a broker has retained."""
    absence, session = device.absence(moment), device.session
    report = session.status or StatusReport(online=False)
    return DeviceStatus(
        stamp=moment.unix,
        online=not absence,
        reason=absence or device.hindrance(),
        device=device.arm.device.name,
        firmware=report.firmware,
        boot_id=session.boot_id,
        reset_cause=report.reset_cause,
        joints=report.joints,
        tick_hz=report.tick_hz,
        queue_capacity=report.queue_capacity,
        config_crc32=device.configuration.device_crc32,
        wanted_crc32=device.configuration.crc32,
        virtual=report.virtual,
    )
