"""The progress of a homing, from the reports of the device."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence

from gemelo.api.errors import Aborted, Interrupted, Refused
from gemelo.api.homing_report import HOME, OFF, TO, WAITS, HomingProgress, HomingReport
from gemelo.api.session import Session
from gemelo.api.targets import require_joint
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.device import DeviceCommand, DeviceEvent, DeviceMode, DeviceState, HomeCommand, StopKind
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.device_link import why_not_usable, why_offline
from gemelo.schemas.reasons import FrontEnd, Reason, because, remedy, say
from gemelo.schemas.robot import HomingDirection
from gemelo.schemas.topics import DEVICE_EVENTS, DEVICE_STATE, DEVICE_STATUS

TO_BEGIN = 3.0  # [s] from the device's yes to its first word of homing
LAST_WORDS = 0.5  # [s] for events that come after the state
OFFLINE = 2.0  # [s] that the device may be away: a link that comes back, a clock that is synchronised anew
TELL_EVERY = 0.2  # [s] while no joint begins another phase
BRAKING = 5.0  # [s] beyond the time-outs of robot.toml

Command = Callable[[DeviceCommand | StopKind], object]


OnHoming = Callable[[HomingProgress], object]


class HomingWait:
    """The homing of some joints: takes events and states from before the command on. Pure."""

    def __init__(self, arm: ArmDescription, joints: Sequence[Joint]) -> None:
        self.joints = tuple(joints)
        self.has_begun = False
        self.why: Reason | None = None  # it ended before its end
        self.steps_off: dict[str, int] = {}
        self.phases = {joint.name: WAITS for joint in joints}  # by joint: WAITS, TO, OFF or HOME
        self._arm = arm
        self._mode: DeviceMode | None = None

    @property
    def homed(self) -> tuple[str, ...]:
        """The joints that have found their switches."""
        return tuple(name for name, phase in self.phases.items() if phase == HOME)

    @property
    def is_over(self) -> bool:
        """True once the device has left Homing, or has said why it will."""
        return self.has_begun and self._mode is not DeviceMode.HOMING

    @property
    def is_done(self) -> bool:
        """True if all joints are home."""
        return len(self.homed) == len(self.phases)

    @property
    def longest(self) -> float:
        """[s] that it may take: the groups one after another, each as long as its slowest joint."""
        groups: dict[int, float] = {}
        for joint in self.joints:
            if joint.drive.homing is not None:
                group = joint.drive.homing.group
                groups[group] = max(groups.get(group, 0.0), joint.drive.homing.timeout)
        return sum(groups.values()) + BRAKING

    def on_event(self, event: DeviceEvent) -> None:
        """What the device reports once."""
        match event.event:
            case "homed":
                self._on_homed(event.detail)
            case "homing_stopped":
                self.why = self.why or _stopped(event.detail)

    def on_state(self, state: DeviceState) -> None:
        """How it is now; a state from before the homing, which may still be on its way, is passed over."""
        self.has_begun = self.has_begun or state.mode is DeviceMode.HOMING or state.fault != 0
        if not self.has_begun:
            return
        self._mode = state.mode
        if state.fault:
            self.why = fault_reason(state.fault, joint_name(self._arm, state.fault_joint))
        velocity = dict(zip(state.name, state.velocity, strict=False))
        for joint in self.joints:
            if self.phases[joint.name] != HOME:
                self.phases[joint.name] = _phase_of(joint, velocity.get(joint.name, 0.0)) or self.phases[joint.name]

    def _on_homed(self, detail: str) -> None:
        name, _, rest = detail.partition(":")
        name = joint_name(self._arm, name.strip())
        if name in self.phases:
            self.phases[name] = HOME
            off = re.search(r"-?\d+", rest)
            if off is not None:
                self.steps_off[name] = int(off[0])


def home(
    session: Session,
    names: Iterable[str],
    command: Command,
    on_progress: OnHoming | None,
    on_cancel: Callable[[], object] | None,
) -> HomingReport:
    """Homes the joints named, or all that can; raises `Refused`, `Aborted`, `Interrupted` or `Lost`."""
    homing = HomingWait(session.description, homing_joints(session.description, names))
    _require_ready(session)
    events = session.node.subscribe(DEVICE_EVENTS, homing.on_event)
    states = session.node.subscribe(DEVICE_STATE, homing.on_state)
    try:
        return _follow(session, homing, command, on_progress, on_cancel)
    finally:
        states.close()
        events.close()
        session.changed()


def homing_joints(arm: ArmDescription, names: Iterable[str]) -> list[Joint]:
    """The joints to home: those named, or all that have a switch; raises `BadArgument` or `Refused`."""
    asked = []
    for name in names:
        require_joint(arm, name)
        asked.append(arm.joint(name))
    without = [joint.name for joint in asked if joint.drive.homing is None]
    if without:
        hint = remedy("declare_joint", joint=without[0])
        raise Refused(because("homing.no_switch", hint, joint=without[0]), check="homing")
    found = asked or [joint for joint in arm.joints if joint.drive.homing is not None]
    if not found:
        raise Refused(because("homing.no_switches", remedy("declare_joints")), check="homing")
    return found


def joint_name(arm: ArmDescription, name: str) -> str:
    """The joint's name for what the device calls it; any other text is left as it is."""
    return next((joint.name for joint in arm.joints if name in (joint.name, joint.wire_name)), name)


def _require_ready(session: Session) -> None:
    """Raises `Refused` with the remedy where homing cannot begin."""
    status = session.newest(DEVICE_STATUS)
    if not status.online:
        reason = why_offline(status, session.node.now())
        raise Refused(because("homing.refused", reason), check="device", reason=reason)
    state = session.newest(DEVICE_STATE)
    if state.fault or state.mode in (DeviceMode.FAULT, DeviceMode.ESTOP):
        fault = fault_reason(state.fault, joint_name(session.description, state.fault_joint))
        why = because("homing.refused", fault) if fault else because("homing.mode", mode=state.mode.name)
        raise Refused(why, check="device", remedy="arm.device.reset()")
    if not state.armed:
        why = because("homing.drivers_off", remedy("arm_then_home"))
        raise Refused(why, check="device", remedy="arm.device.arm(), then arm.home()")
    if state.mode in (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING):
        raise Refused(because("homing.moving", remedy("wait_or_stop"), mode=state.mode.name), check="device")


def _follow(
    session: Session,
    homing: HomingWait,
    command: Command,
    on_progress: OnHoming | None,
    on_cancel: Callable[[], object] | None,
) -> HomingReport:
    """Begins it; the report if all are home; `Aborted` or `Interrupted` with it if not."""
    node = session.node
    began = node.monotonic()
    told = HomingProgress(homing.phases, {}, 0.0)

    def tell() -> None:
        nonlocal told
        elapsed = node.monotonic() - began
        if on_progress is not None and (told != homing.phases or elapsed - told.elapsed >= TELL_EVERY):
            told = HomingProgress(homing.phases, homing.steps_off, elapsed)
            on_progress(told)

    watch = HomingEnd(session, homing)
    is_interrupted = False
    try:
        command(HomeCommand(name=tuple(joint.name for joint in homing.joints)))
        session.wait_for(lambda: homing.is_over or watch.trouble() is not None, None, tell)
    except KeyboardInterrupt:  # also while the answer is on its way: the device may have begun
        is_interrupted = True
        command(StopKind.STOP)
        if on_cancel is not None:
            on_cancel()
        session.wait_for(lambda: homing.is_over, BRAKING, tell)
    session.wait_for(lambda: homing.is_done or (homing.why or watch.trouble()) is not None, LAST_WORDS)
    tell()
    report = _report(homing, node.monotonic() - began, watch)
    ended = because("homing.ended", report.why or because("homing.all_home"), time=report.took)
    if is_interrupted:
        raise Interrupted(ended, homing=report)
    if report.why is not None:
        raise Aborted(ended, homing=report, reason=report.why)
    return report


def _report(homing: HomingWait, took: float, watch: HomingEnd) -> HomingReport:
    """How it ended, after `took` [s]."""
    if homing.is_done:
        return HomingReport(homing.homed, homing.steps_off, took)
    missing = ", ".join(name for name in homing.phases if name not in homing.homed)
    why = homing.why or watch.trouble() or because("homing.without", joints=missing)
    return HomingReport(homing.homed, homing.steps_off, took, say(why, front_end=FrontEnd.SCRIPT), why)


class HomingEnd:
    """Why a homing is waited for no longer."""

    def __init__(self, session: Session, homing: HomingWait) -> None:
        self._homing, self._node = homing, session.node
        self._status, self._state = session.latest(DEVICE_STATUS), session.latest(DEVICE_STATE)
        self._began = self._node.monotonic()

    def trouble(self) -> Reason | None:
        """None while it is waited for."""
        elapsed = self._node.monotonic() - self._began
        status = self._status.message
        if status is not None and not status.online and self._state.age() > OFFLINE:
            return because("homing.offline", why_not_usable(status, self._node.now()))
        if self._state.age() > BRAKING:
            return because("homing.silent", remedy("look_at_device"))
        if not self._homing.has_begun and elapsed > TO_BEGIN:
            return because("homing.not_begun", remedy("look_at_device"))
        if elapsed > self._homing.longest:
            return because("homing.late", remedy("stop_and_see_device"), time=elapsed)
        return None


def _phase_of(joint: Joint, velocity: float) -> str:
    """What the joint does at `velocity` [steps/s]; empty where it stands, as it does at every turn."""
    if abs(velocity) < 1.0 or joint.drive.homing is None:
        return ""
    towards = 1.0 if joint.drive.homing.direction is HomingDirection.UPPER else -1.0
    return TO if math.copysign(1.0, velocity) == towards else OFF


def _stopped(detail: str) -> Reason:
    """Why the device broke off."""
    return because("homing.heartbeat" if detail == "heartbeat" else "homing.stopped", remedy("home_again"))
