"""The board's sensors: republished while their readings are fresh, with a word when they fall silent."""

from __future__ import annotations

from typing import NamedTuple

from gemelo.schemas.device import SensorReadings
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import SENSORS
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.links.reports import SensorReport
from gemelo.services.stepper_gateway.moment import Moment, next_beat

SILENCE = 2.0  # [s] without readings until nothing is republished; chosen: twenty readings
PERIOD = 0.1  # [s] between two messages; chosen: smooth for a person's eye, and a sonar is hardly faster


class LatestReadings(NamedTuple):
    """The newest readings and when they came."""

    values: dict[str, float]
    stamp: int  # [ns] UNIX time of the measurement
    arrival: float  # [s] monotonic


class SensorRelay:
    """What one board measures, in the order of robot.toml."""

    def __init__(self, device: GatewayDevice) -> None:
        self._device = device
        self._units = {sensor.name: sensor.unit for sensor in device.arm.sensors}
        self._readings: LatestReadings | None = None
        self._present_since: float | None = None  # [s] monotonic, of the device
        self._due = 0.0  # [s] monotonic
        self._is_silent = False

    def on_readings(self, report: SensorReport, arrival: float, moment: Moment) -> None:
        """Take what the board has measured; `arrival` [s] monotonic."""
        known = {name: value for name, value in report.values.items() if name in self._units}
        measured = self._device.session.clock.measured(report.t_us, arrival)
        self._readings = LatestReadings(known, moment.unix_at(measured), arrival)
        if self._is_silent:
            self._is_silent = False
            self._device.event("sensors_back", because("sensors.back"), moment, LogLevel.INFO)

    def step(self, unreachable_reason: Reason | None, moment: Moment) -> None:
        """Republish, or say once that there is nothing to republish."""
        if not self._units:
            return
        if unreachable_reason is not None:
            self._present_since = None
        elif self._present_since is None:
            self._present_since = moment.monotonic
        if self._age(moment) > SILENCE:
            return self._fall_silent(moment)
        if self._readings is not None and self._readings.values and moment.monotonic >= self._due:
            self._due = next_beat(self._due, moment.monotonic, PERIOD)
            self._publish(self._readings, moment)

    def _age(self, moment: Moment) -> float:
        """[s] since the last readings, or since the device is there without any."""
        since = self._readings.arrival if self._readings is not None else self._present_since
        return moment.monotonic - since if since is not None else 0.0

    def _fall_silent(self, moment: Moment) -> None:
        if not self._is_silent:
            self._is_silent = True
            silent = because("sensors.silent", names=tuple(self._units), time=SILENCE)
            self._device.event("sensors_silent", silent, moment)

    def _publish(self, readings: LatestReadings, moment: Moment) -> None:
        names = tuple(name for name in self._units if name in readings.values)
        self._device.publish(
            SENSORS,
            SensorReadings(
                stamp=readings.stamp,
                name=names,
                value=tuple(readings.values[name] for name in names),
                unit=tuple(self._units[name] for name in names),
            ),
            moment,
        )
