"""`gemelo home`: let the joints find their switches, and say how it goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceMode, DeviceState, HomeCommand, StopKind
from schemas.device_faults import fault_text
from schemas.topics import DEVICE_EVENTS, DEVICE_STATE
from services.cli.device import ask
from services.cli.device_names import homing_joints, joint_name
from services.cli.device_view import DeviceView
from services.cli.exits import CommandError, ExitCode
from services.cli.homing import HOME, HomeReport, Homing, home_text
from services.cli.interrupt import Interrupt, two_stage_interrupt
from services.cli.live import LiveBlock

if TYPE_CHECKING:
    from services.arm.description import Arm
    from services.cli.session import Session

TO_BEGIN = 3.0  # [s] from the device's yes to its first word of homing
LAST_WORDS = 0.5  # [s] for events that come after the state
BRAKING = 5.0  # [s] beyond the time-outs of robot.toml
POLL = 0.02  # [s]


def home(session: Session, wanted: Sequence[str], as_json: bool = False) -> ExitCode:
    """Homes the joints named, or all that can; ends when they are home, or with the reason why not."""
    homing = Homing(session.arm, homing_joints(session.arm, wanted))
    view = DeviceView(session)
    session.node.subscribe(DEVICE_EVENTS, homing.on_event)
    require_ready(session.arm, view.require_state())
    names = tuple(joint.name for joint in homing.joints)
    with two_stage_interrupt() as interrupt:
        ask(session, HomeCommand(name=names))
        session.node.subscribe(DEVICE_STATE, homing.on_state)
        report = _follow(session, view, homing, interrupt, as_json)
    if as_json:
        print(msgspec.json.encode(report).decode())
    return _end(report, homing, as_json)


def require_ready(arm: Arm, state: DeviceState) -> None:
    """Raises with the remedy where homing cannot begin."""
    if state.fault or state.mode in (DeviceMode.FAULT, DeviceMode.ESTOP):
        about = fault_text(state.fault, joint_name(arm, state.fault_joint))
        raise CommandError(f"homing refused: {about or state.mode.name}")
    if not state.armed:
        raise CommandError("homing refused: the drivers are off: `gemelo device arm`, then `gemelo home`")
    if state.mode in (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING):
        raise CommandError(f"homing refused: the device is in {state.mode.name}: wait, or `gemelo stop`")


def longest(homing: Homing) -> float:
    """[s] that it may take: the groups one after another, each as long as its slowest joint."""
    groups: dict[int, float] = {}
    for joint in homing.joints:
        if joint.drive.homing is not None:
            group = joint.drive.homing.group
            groups[group] = max(groups.get(group, 0.0), joint.drive.homing.timeout)
    return sum(groups.values()) + BRAKING


def _follow(session: Session, view: DeviceView, homing: Homing, interrupt: Interrupt, quiet: bool) -> HomeReport:
    node, block = session.node, LiveBlock()
    began = node.monotonic()
    reason, said = "", dict(homing.phases)
    while not homing.is_over and not reason:
        _stop_once(session, interrupt, quiet)
        node.wait(POLL)
        elapsed = node.monotonic() - began
        if not quiet:
            said = _show(block, homing, said, elapsed)
        reason = _trouble(view, homing, elapsed)
    if not reason and not homing.reason:
        view.wait_for(lambda: homing.is_done or bool(homing.reason), LAST_WORDS)
    if not quiet:
        _show(block, homing, said, node.monotonic() - began)
        block.say()
    missing = ", ".join(name for name in homing.phases if name not in homing.homed)
    return HomeReport(
        homed=homing.homed,
        steps_off=homing.steps_off,
        took_s=round(node.monotonic() - began, 3),
        interrupted=interrupt.is_set,
        reason="" if homing.is_done else reason or homing.reason or f"the device ended it without {missing}",
    )


def _stop_once(session: Session, interrupt: Interrupt, quiet: bool) -> None:
    if interrupt.is_set and not interrupt.is_answered:
        interrupt.is_answered = True
        ask(session, StopKind.STOP)
        if not quiet:
            print("stopping: the joints slow down (Ctrl-C again leaves without waiting)", flush=True)


def _show(block: LiveBlock, homing: Homing, said: dict[str, str], elapsed: float) -> dict[str, str]:
    """A line for every joint whose phase has changed, and the block of all; the phases that are said now."""
    changed = {name: phase for name, phase in homing.phases.items() if said[name] != phase}
    block.say(*(_line(homing, name, phase) for name, phase in changed.items() if phase == HOME or not block.is_live))
    rows = [f"  {name:<20} {phase}" for name, phase in homing.phases.items()]
    block.draw("\n".join([f"homing for {elapsed:.1f} s (Ctrl-C stops it)", *rows]))
    return dict(homing.phases)


def _line(homing: Homing, name: str, phase: str) -> str:
    return home_text(name, homing.steps_off.get(name)) if phase == HOME else f"{name}: {phase}"


def _trouble(view: DeviceView, homing: Homing, elapsed: float) -> str:
    """Why there is nothing more to wait for, or an empty text."""
    status = view.status.message
    if status is not None and not status.online:
        return f"the device went offline: {status.reason}"
    if view.state.age() > BRAKING:
        return "the device has fallen silent: `gemelo device status`"
    if not homing.has_begun and elapsed > TO_BEGIN:
        return "the device did not begin: `gemelo device status`"
    if elapsed > longest(homing):
        return f"it has not ended after {elapsed:.0f} s: `gemelo stop`, `gemelo device status`"
    return ""


def _end(report: HomeReport, homing: Homing, as_json: bool) -> ExitCode:
    if not report.reason:
        if not as_json:
            print(f"homed {len(report.homed)} of {len(homing.joints)} joints in {report.took_s:.1f} s")
        return ExitCode.OK
    raise CommandError(
        f"homing ended after {report.took_s:.1f} s: {report.reason}",
        ExitCode.CANCELLED if report.interrupted else ExitCode.FAILED,
    )
