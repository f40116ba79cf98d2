"""A gateway whose device has switches, outputs, sensors and a homing, on a bus in memory."""

from __future__ import annotations

import msgspec

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import (
    ArmCommand,
    ConfigureRequest,
    ConfigureResponse,
    DeviceCommand,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceConfiguration,
    DeviceEvent,
    DeviceFault,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    DeviceStopRequest,
    HomeCommand,
    InjectRequest,
    InjectResponse,
    OutputCommand,
    SensorReadings,
    SpeedCommand,
    StopKind,
)
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURATION,
    DEVICE_CONFIGURE,
    DEVICE_EVENTS,
    DEVICE_INJECT,
    DEVICE_STATE,
    DEVICE_STATUS,
    DEVICE_STOP,
    SENSORS,
)

TO_HOME = 0.15  # [s] for every joint


class PretendDevice:
    """Does at once what it is asked; homes one joint after another, or comes to `homing_fault` at the second."""

    def __init__(self, node: Node, arm: ArmDescription) -> None:
        self.arm, self._node = arm, node
        self.asked: list[DeviceCommand | StopKind] = []
        self.pressed: list[InjectRequest] = []
        self.steps_off: dict[str, int] = {}
        self.homing_fault = DeviceFault.NONE
        self.state = DeviceState(
            mode=DeviceMode.UNREFERENCED, armed=True, name=arm.joint_names, referenced=(False,) * 3,
            steps=(933, -50, 113), velocity=(0.0,) * 3, time_scale=1.0, round_trip=0.002,
        )  # fmt: skip
        self._homing: list[str] = []
        self._all: list[str] = []
        self._since = 0.0
        node.serve(DEVICE_COMMAND, self._on_command)
        node.serve(DEVICE_STOP, self._on_stop)
        node.serve(DEVICE_CONFIGURE, self._on_configure)
        node.serve(DEVICE_INJECT, self._on_inject)
        self._states, self._events = node.publisher(DEVICE_STATE), node.publisher(DEVICE_EVENTS)
        self._statuses, self._sensors = node.publisher(DEVICE_STATUS), node.publisher(SENSORS)
        self._configurations = node.publisher(DEVICE_CONFIGURATION)
        self.status = DeviceStatus(
            online=True, device="rm1", firmware="1.0.0", boot_id=0xABC, reset_cause="power_on", joints=3,
            tick_hz=50_000, config_crc32=0x1234, wanted_crc32=0x1234, virtual=True,
        )  # fmt: skip
        self.configuration = DeviceConfiguration(text='{"name":"rm1"}', crc32=0x1234, accepted=True)
        self.readings: SensorReadings | None = SensorReadings(
            name=("ultra", "bateria"), value=(12.5, 7.4), unit=("cm", "V")
        )
        self.tell()

    def tell(self) -> None:
        """Says who it is again."""
        self._statuses.put(self.status)
        self._configurations.put(self.configuration)

    def set(self, **fields) -> None:
        self.state = msgspec.structs.replace(self.state, **fields)

    def step(self, now: int) -> None:
        if self._homing:
            self.go_on_homing()
        self._states.put(msgspec.structs.replace(self.state, stamp=now))
        if self.readings is not None:
            self._sensors.put(msgspec.structs.replace(self.readings, stamp=now))

    def go_on_homing(self) -> None:
        if self._node.monotonic() - self._since < TO_HOME:
            velocity = tuple(-80.0 if name == self._homing[0] else 0.0 for name in self.arm.joint_names)
            self.set(velocity=velocity)
            return
        if self.homing_fault and len(self._homing) < len(self._all):
            self.set(mode=DeviceMode.FAULT, fault=int(self.homing_fault), fault_joint=self._homing[0])
            self._homing.clear()
            return
        self._since = self._node.monotonic()
        name = self._homing.pop(0)
        wire_name = self.arm.joint(name).wire_name
        off = f": {self.steps_off[name]} steps off" if name in self.steps_off else ""
        self._events.put(DeviceEvent(event="homed", detail=wire_name + off))
        known = zip(self.state.referenced, self.arm.joint_names, strict=True)
        self.set(referenced=tuple(before or each == name for before, each in known), velocity=(0.0,) * 3)
        if not self._homing:
            self.set(mode=DeviceMode.IDLE if all(self.state.referenced) else DeviceMode.UNREFERENCED)

    def _on_command(self, request: DeviceCommandRequest) -> DeviceCommandResponse:
        self.asked.append(request.command)
        match request.command:
            case HomeCommand() as home:
                self._all = list(home.name)
                self._homing, self._since = list(home.name), self._node.monotonic()
                self.set(mode=DeviceMode.HOMING)
            case ArmCommand():
                self.set(armed=True, referenced=(False,) * 3)
            case OutputCommand() as output:
                self.set(outputs=(output.output,) if output.on else ())
            case SpeedCommand() as speed:
                self.set(speed=speed.scale)
        return DeviceCommandResponse(accepted=True, mode=self.state.mode)

    def _on_stop(self, request: DeviceStopRequest) -> DeviceCommandResponse:
        self.asked.append(request.kind)
        if request.kind is StopKind.STOP and self._homing:
            self._homing.clear()
            self._events.put(DeviceEvent(event="homing_stopped", detail="command"))
            self.set(mode=DeviceMode.UNREFERENCED)
        if request.kind is StopKind.DISARM:
            self.set(armed=False, referenced=(False,) * 3)
        return DeviceCommandResponse(accepted=True, mode=self.state.mode)

    def _on_configure(self, request: ConfigureRequest) -> ConfigureResponse:
        if self.state.armed:
            return ConfigureResponse(accepted=False, reason="the device is armed")
        self.configuration = msgspec.structs.replace(self.configuration, accepted=True)
        self.tell()
        return ConfigureResponse(accepted=True, crc32=self.configuration.crc32)

    def _on_inject(self, request: InjectRequest) -> InjectResponse:
        self.pressed.append(request)
        return InjectResponse(accepted=request.target != "efector_joint", reason="it does not slip")
