"""The controller board: how it is, what it is told, and what a hand could do to a virtual one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gemelo.api.errors import BadArgument, Lost, Refused, why_of
from gemelo.api.homing import joint_name
from gemelo.api.session import PATIENCE, Session
from gemelo.api.targets import number
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import (
    ArmCommand,
    ConfigureRequest,
    DeviceCommand,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceConfiguration,
    DeviceFault,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    DeviceStopRequest,
    InjectKind,
    InjectRequest,
    ReferenceCommand,
    ResetCommand,
    StopKind,
)
from gemelo.schemas.device_faults import fault_text
from gemelo.schemas.device_link import why_offline
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURATION,
    DEVICE_CONFIGURE,
    DEVICE_INJECT,
    DEVICE_STATE,
    DEVICE_STATUS,
    DEVICE_STOP,
)

TO_ANSWER = 3.0  # [s] for a command
TO_CONFIGURE = 10.0  # [s]: a board may write it to its flash first
MOVING = (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING)


class Device:
    """The board that moves the motors, or its virtual twin.

    >>> arm.device.mode.name, arm.device.fault
    ('IDLE', '')
    """

    def __init__(self, session: Session, prepare: Callable[[], None]) -> None:
        """`prepare` is called before each command that is not a stop."""
        self._session, self._prepare = session, prepare

    @property
    def status(self) -> DeviceStatus:
        """Who it is, and whether it is online.

        >>> arm.device.status.online, arm.device.status.virtual
        (True, True)
        """
        return self._session.newest(DEVICE_STATUS)

    @property
    def state(self) -> DeviceState:
        """Mode, fault, switches, outputs, executed steps; raises `Lost` with the reason where it is offline.

        >>> arm.device.state.armed, all(arm.device.state.referenced)
        (True, True)
        """
        status = self._session.latest(DEVICE_STATUS)
        try:
            return self._session.newest(DEVICE_STATE)
        except Lost:
            if status.message is not None and not status.message.online:
                raise Lost(why_offline(status.message, self._session.node.now())) from None
            raise

    @property
    def mode(self) -> DeviceMode:
        """BOOT, UNREFERENCED, HOMING, IDLE, RUN, HOLD, FAULT or ESTOP.

        >>> arm.device.mode is gemelo.DeviceMode.IDLE
        True
        """
        return self.state.mode

    @property
    def fault(self) -> str:
        """The fault, what it means, and what to do; empty if there is none.

        >>> arm.device.fault
        ''
        """
        return fault_of(self._session.description, self.state)

    @property
    def configuration(self) -> DeviceConfiguration:
        """What robot.toml asks of the device, and whether it works with it.

        >>> arm.device.configuration.accepted
        True
        """
        return self._session.newest(DEVICE_CONFIGURATION)

    def arm(self) -> None:
        """Energises the motors, and waits until they hold.

        >>> arm.device.arm()
        """
        self.command(ArmCommand())

    def disarm(self) -> None:
        """Takes the current from the motors; every joint is unreferenced then, and an arm may sink.

        >>> where = arm.joints
        >>> arm.device.disarm()
        >>> arm.device.mode.name
        'UNREFERENCED'
        >>> arm.device.arm()
        >>> arm.reference(where)
        """
        self.command(StopKind.DISARM)

    def reset(self) -> None:
        """Leaves a fault or an emergency stop, once its cause is gone.

        >>> where = arm.joints
        >>> arm.device.inject("estop")
        >>> arm.device.mode.name
        'ESTOP'
        >>> arm.device.inject("estop", value=0)
        >>> arm.device.reset()
        >>> arm.device.arm()
        >>> arm.reference(where)
        """
        self.command(ResetCommand())

    def configure(self, before_disarm: Callable[[], object] | None = None) -> int:
        """Gives the device what robot.toml says of it, if it has anything else: it disarms, and is referenced no more.

        `before_disarm` is called before the drivers of an armed device go off; what it raises ends this. Returns the
        CRC-32 of the configuration that the device works with now.

        >>> arm.device.configure() == arm.device.configuration.crc32
        True
        """
        if self.configuration.accepted:
            return self.configuration.crc32
        state = self.state
        if state.mode in MOVING:
            raise Refused(because("client.device.moving", remedy("wait_or_stop"), mode=state.mode.name), check="device")
        if state.armed:
            if before_disarm is not None:
                before_disarm()
            self.disarm()
            self._session.wait_for(lambda: not self.state.armed, PATIENCE)
        answer = self._session.call(DEVICE_CONFIGURE, ConfigureRequest(), TO_CONFIGURE)
        if not answer.accepted:
            why, again = why_of(answer), (remedy("arm_again"),) if state.armed else ()
            raise Refused(because("client.configuration.refused", why, *again), check="configuration", reason=why)
        if state.armed:
            self.arm()
        return answer.crc32

    def inject(self, what: str, target: str = "", value: float = 1.0) -> None:
        """Does to a virtual device what a hand or an accident could do; a real one refuses.

        "estop" (`value` 0 releases it), "switch" (`target`: an input; 1 held, 0 open, -1 left to the arm), "block" (a
        joint; 0 lets go), "slip" (a joint; steps), "sensor" (a sensor; its reading), "reboot", "offline" ([s]),
        "freeze" ([s]), "drift" ([ppm]), "object" ([m] between the jaws of a servo gripper; 0 takes it away).

        >>> arm.device.inject("sensor", "ultra", 0.25)
        """
        kinds = [kind.value for kind in InjectKind]
        if what not in kinds:
            raise BadArgument(because("argument.inject.unknown", nearest(what, kinds), name=what))
        self._require_target(InjectKind(what), target)
        if self.status.online and not self.status.virtual:
            raise Refused(because("client.not_virtual", device=self.status.device), check="virtual")
        request = InjectRequest(kind=InjectKind(what), target=target, value=number("value", value))
        answer = self._session.call(DEVICE_INJECT, request, TO_ANSWER)
        self._session.changed()
        if not answer.accepted:
            why = why_of(answer)
            raise Refused(because("client.device.refused", why), check="device", reason=why)

    def command(self, wanted: DeviceCommand | StopKind, what: str = "") -> DeviceMode:
        """As `send`; the mode that the device answered with.

        >>> arm.device.command(gemelo.StopKind.STOP).name
        'IDLE'
        """
        return self.send(wanted, what).mode

    def send(self, wanted: DeviceCommand | StopKind, what: str = "") -> DeviceCommandResponse:
        """Sends a command; the device's answer, for arming when the motors hold. Raises `Refused` with its reason.

        >>> arm.device.send(gemelo.StopKind.STOP).accepted
        True
        """
        what = what or (wanted.value if isinstance(wanted, StopKind) else str(wanted.__struct_config__.tag))
        if isinstance(wanted, StopKind):
            answer = self._session.call(DEVICE_STOP, DeviceStopRequest(kind=wanted), TO_ANSWER)
        else:
            self._prepare()
            answer = self._session.call(DEVICE_COMMAND, DeviceCommandRequest(command=wanted), TO_ANSWER)
        self._session.changed()
        if not answer.accepted:
            why = why_of(answer)
            said = because("client.command.refused", why, what=what)
            if not answer.check and not says_mode(why):
                said = because("client.command.refused_in_mode", why, what=what, mode=answer.mode.name)
            raise Refused(said, check=answer.check or "device", subject=what, reason=why)
        if isinstance(wanted, ArmCommand):
            lead = max(joint.driver.enable_lead_ms for joint in self._session.description.joints) * 1e-3
            self._session.wait_for(lambda: False, lead)
        return answer

    def _require_target(self, kind: InjectKind, target: str) -> None:
        arm = self._session.description
        known = {
            InjectKind.SWITCH: [each.name for each in arm.inputs],
            InjectKind.BLOCK: list(arm.joint_names),
            InjectKind.SLIP: list(arm.joint_names),
            InjectKind.SENSOR: [each.name for each in arm.sensors],
        }.get(kind)
        if known is None and target:
            raise BadArgument(because("argument.inject.whole_device", kind=kind.value, target=target))
        if known is not None and target not in known:
            raise BadArgument(because("argument.inject.target", nearest(target, known), kind=kind.value, target=target))


def says_mode(why: Reason) -> bool:
    """True if the device's mode is in the reason, or in one behind it."""
    return "mode" in why.values or any(says_mode(each) for each in why.causes)


def fault_of(arm: ArmDescription, state: DeviceState) -> str:
    """The fault in `state`, what it means, and what to do; empty if there is none."""
    if state.fault == DeviceFault.NONE:
        return ""
    return fault_text(state.fault, joint_name(arm, state.fault_joint))


def reference_command(arm: ArmDescription, values: Mapping[str, float]) -> ReferenceCommand:
    """The command with every joint named: at `values` [rad] or [m], the others at robot.toml's reference position."""
    whole = {**dict(zip(arm.joint_names, arm.reference_position, strict=True)), **values}
    return ReferenceCommand(name=tuple(whole), position=tuple(whole.values()))
