"""`gemelo home`: homes joints on their switches and shows the phase of each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceMode, DeviceState, HomeCommand, StopKind
from schemas.device_faults import fault_text
from schemas.topics import DEVICE_EVENTS, DEVICE_STATE
from services.cli.device import ask
from services.cli.device_snapshot import DeviceView
from services.cli.errors import CommandError, ExitCode
from services.cli.homing import HOME, HomeReport, Homing, home_text
from services.cli.parser import Choices, Options, Parser, json_option
from services.cli.robot_names import joint_name, joint_of
from services.cli.session import Robot, Session, connect, load_robot
from services.cli.terminal import Interrupt, LiveBlock, two_stage_interrupt

if TYPE_CHECKING:
    from services.arm.model.description import Arm, Joint

TO_BEGIN = 3.0  # [s] from the device's yes to its first word of homing
LAST_WORDS = 0.5  # [s] for events that come after the state
BRAKING = 5.0  # [s] beyond the time-outs of robot.toml
POLL = 0.02  # [s]


def add_options(parser: Parser) -> None:
    """Adds the joints and --json."""
    parser.add_argument("joints", metavar="JOINT", nargs="*", help="all that have a home switch, if none is named")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Homes the joints named; a wrong name is refused before the stack is asked."""
    robot = load_robot()
    homing_joints(robot.arm, options.joints)
    with connect(robot) as session:
        return home(session, options.joints, options.json)


def choices(robot: Robot | None) -> Choices:
    """The joints that have a home switch."""
    return {"": [joint.name for joint in robot.arm.joints if joint.drive.homing is not None]} if robot else {}


def home(session: Session, wanted: Sequence[str], as_json: bool = False) -> ExitCode:
    """Homes the joints named, or all that can; raises `CommandError` with the reason if not all are home."""
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


def homing_joints(arm: Arm, names: Iterable[str]) -> list[Joint]:
    """The joints named, or all that have a home switch; raises `CommandError` with the remedy for any other."""
    asked = [joint_of(arm, name) for name in names]
    without = [joint.name for joint in asked if joint.drive.homing is None]
    if without:
        raise CommandError(
            f'joint "{without[0]}" has no [joint.homing] in robot.toml, so it cannot home: '
            f"declare where it stands, `gemelo reference --joints {without[0]}=...`"
        )
    found = asked or [joint for joint in arm.joints if joint.drive.homing is not None]
    if not found:
        raise CommandError(
            "no joint has a [joint.homing] in robot.toml: declare where they stand with `gemelo reference`"
        )
    return found


def require_ready(arm: Arm, state: DeviceState) -> None:
    """Raises `CommandError` with the remedy if homing cannot begin."""
    if state.fault or state.mode in (DeviceMode.FAULT, DeviceMode.ESTOP):
        about = fault_text(state.fault, joint_name(arm, state.fault_joint))
        raise CommandError(f"homing refused: {about or state.mode.name}")
    if not state.armed:
        raise CommandError("homing refused: the drivers are off: `gemelo device arm`, then `gemelo home`")
    if state.mode in (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING):
        raise CommandError(f"homing refused: the device is in {state.mode.name}: wait, or `gemelo stop`")


def longest(homing: Homing) -> float:
    """The longest time that it may take [s]: the groups one after another, each as long as its slowest joint."""
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
        reason = _reason_to_give_up(view, homing, elapsed)
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
    """Prints a line for every joint whose phase has changed and redraws the block; returns the present phases."""
    changed = {name: phase for name, phase in homing.phases.items() if said[name] != phase}
    block.say(*(_line(homing, name, phase) for name, phase in changed.items() if phase == HOME or not block.is_live))
    rows = [f"  {name:<20} {phase}" for name, phase in homing.phases.items()]
    block.draw("\n".join([f"homing for {elapsed:.1f} s (Ctrl-C stops it)", *rows]))
    return dict(homing.phases)


def _line(homing: Homing, name: str, phase: str) -> str:
    return home_text(name, homing.steps_off.get(name)) if phase == HOME else f"{name}: {phase}"


def _reason_to_give_up(view: DeviceView, homing: Homing, elapsed: float) -> str:
    """The reason to wait no longer; empty if there is none."""
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
