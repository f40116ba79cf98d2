"""The newest messages about the device, and one snapshot of all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import msgspec

from gemelo.schemas.device import DeviceConfiguration, DeviceState, DeviceStatus, SensorReadings
from gemelo.schemas.device_faults import FaultDescription, explain
from gemelo.schemas.device_link import why_offline
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import DEVICE_CONFIGURATION, DEVICE_STATE, DEVICE_STATUS, SENSORS
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import CommandSession, other_robots

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

PATIENCE = 2.0  # [s] for the first messages
POLL = 0.02  # [s]

OPEN_LOOP = because("status.open_loop")
IN_FORCE = "status.configuration.in_force"


class DeviceView:
    """The newest message of every topic about the device."""

    def __init__(self, session: CommandSession) -> None:
        self.session = session
        node = session.node
        self.status = node.latest(DEVICE_STATUS)
        self.state = node.latest(DEVICE_STATE)
        self.configuration = node.latest(DEVICE_CONFIGURATION)
        self.sensors = node.latest(SENSORS)

    def wait_for(self, is_enough: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Handles messages until `is_enough()`; False if that takes longer than `timeout` [s]."""
        node = self.session.node
        deadline = node.monotonic() + timeout
        while not is_enough():
            if node.monotonic() >= deadline:
                return False
            node.wait(POLL)
        return True

    def require_heard(self) -> None:
        """Waits for the first message of the device; raises `CommandError` if there is none."""
        self.wait_for(lambda: self._is_settled)
        if self.status.message is None and self.state.message is None:
            silence = because("status.silent", time=PATIENCE)
            raise CommandError(other_robots(self.session.deployment, self.session.arm) or silence, ExitCode.NO_STACK)

    def require_state(self) -> DeviceState:
        """The device's state; raises `CommandError` with the reason if it is offline or silent."""
        self.require_heard()
        status = self.status.message
        if status is not None and not status.online:
            raise CommandError(why_offline(status, self.session.node.now()))
        if self.state.message is None or self.state.is_stale:
            raise CommandError(because("status.no_state"), ExitCode.NO_STACK)
        return self.state.message

    def require_status(self) -> DeviceStatus:
        """The device's status; raises `CommandError` if nobody publishes it."""
        self.wait_for(lambda: self.status.message is not None)
        if self.status.message is None:
            raise CommandError(because("status.unknown_device"), ExitCode.NO_STACK)
        return self.status.message

    @property
    def _is_settled(self) -> bool:
        """True if nothing more is to be expected: a silent device has no state, one that does not hear has."""
        status = self.status.message
        return status is not None and (not (status.online or status.speaks) or self.state.message is not None)


class DeviceJoint(msgspec.Struct, frozen=True, kw_only=True):
    """One joint as the device knows it."""

    name: str
    referenced: bool | None = None
    steps: int | None = None
    velocity: float | None = None  # [steps/s]
    switches: dict[str, bool] = {}  # by name, True if pressed


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """One sensor."""

    name: str
    value: float | None = None
    unit: str = ""


class DeviceSnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """All that is known of the device; --json prints it."""

    status: DeviceStatus
    state: DeviceState | None
    configured: bool
    configuration: str  # the one in force, or the reason why it is not
    fault: str = ""
    fault_joint: str = ""
    meaning: str = ""
    remedy: str = ""
    joints: tuple[DeviceJoint, ...] = ()
    inputs: dict[str, bool] = {}  # of the e-stop and other inputs without a joint
    outputs: dict[str, bool] = {}
    sensors: tuple[Reading, ...] = ()
    now: int = 0  # [ns] UNIX time of this snapshot
    state_age: float = 0.0  # [s]
    configuration_why: Reason | None = None  # `configuration` as data


def snapshot_of(view: DeviceView) -> DeviceSnapshot:
    """The snapshot of a view; sensor readings that are no longer fresh are left out."""
    return device_snapshot(
        view.session.arm,
        view.status.message,
        view.state.message,
        view.configuration.message,
        None if view.sensors.is_stale else view.sensors.message,
        view.session.node.now(),
        0.0 if view.state.message is None else view.state.age(),
    )


def device_snapshot(
    arm: ArmDescription,
    status: DeviceStatus | None,
    state: DeviceState | None,
    configuration: DeviceConfiguration | None,
    sensors: SensorReadings | None,
    now: int = 0,
    age: float = 0.0,
) -> DeviceSnapshot:
    """The snapshot at `now` [ns UNIX] of the messages received so far, None for one that was not.

    `age` [s] is that of the device's state.
    """
    status = status or unknown_device()
    about = explain(state.fault) if state is not None else None
    about = about or FaultDescription("", "", "")
    active = frozenset(state.inputs) if state is not None else frozenset[str]()
    from gemelo.api.homing import joint_name  # slow to load, and `gemelo state` has no need of it

    on = frozenset(state.outputs) if state is not None else frozenset[str]()
    why = configuration_in_force(status, configuration)
    return DeviceSnapshot(
        status=status,
        state=state,
        configured=why.code == IN_FORCE,
        configuration=str(why),
        fault=about.name,
        fault_joint=joint_name(arm, state.fault_joint) if state is not None else "",
        meaning=about.meaning,
        remedy=about.remedy,
        joints=tuple(_joint(arm, name, state, active) for name in arm.joint_names),
        inputs={each.name: each.name in active for each in arm.inputs if not each.joint},
        outputs={each.name: each.name in on for each in arm.outputs},
        sensors=readings(arm, sensors),
        now=now,
        state_age=age,
        configuration_why=why,
    )


def unknown_device() -> DeviceStatus:
    """The status before the first one."""
    why = because("status.nobody")
    return DeviceStatus(reason=str(why), why=why)


def readings(arm: ArmDescription, sensors: SensorReadings | None) -> tuple[Reading, ...]:
    """Every sensor of robot.toml with its reading, None if there is none."""
    sensors = sensors or SensorReadings()
    values = dict(zip(sensors.name, sensors.value, strict=False))
    return tuple(Reading(name=each.name, value=values.get(each.name), unit=each.unit) for each in arm.sensors)


def configuration_in_force(status: DeviceStatus, configuration: DeviceConfiguration | None) -> Reason:
    """Whether the device works with what robot.toml asks for, else why not."""
    wanted = configuration.crc32 if configuration is not None else status.wanted_crc32
    is_accepted = configuration is not None and configuration.accepted
    if is_accepted or (status.config_crc32 and status.config_crc32 == wanted):
        return because(IN_FORCE, crc32=f"{wanted:08x}")
    if configuration is not None and (
        why := configuration.why or (configuration.reason and plain(configuration.reason))
    ):
        return because("cli.device.config.not_in_force", why)
    if status.config_crc32:
        return because("status.configuration.other", crc32=f"{status.config_crc32:08x}", wanted=f"{wanted:08x}")
    return because("status.configuration.none", wanted=f"{wanted:08x}")


def _joint(arm: ArmDescription, name: str, state: DeviceState | None, active: frozenset[str]) -> DeviceJoint:
    switches = {each.name: each.name in active for each in arm.inputs if each.joint == name}
    if state is None or name not in state.name:
        return DeviceJoint(name=name, switches=switches)
    index = state.name.index(name)
    return DeviceJoint(
        name=name,
        referenced=state.referenced[index] if index < len(state.referenced) else None,
        steps=state.steps[index] if index < len(state.steps) else None,
        velocity=state.velocity[index] if index < len(state.velocity) else None,
        switches=switches,
    )
