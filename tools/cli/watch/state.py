"""`gemelo state`: joints, tool, steps and device at one glance."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import msgspec

from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer, FrameError
from gemelo.schemas.control import ControlState
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.device_link import round_trip, warning_of, why_not_usable
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import (
    CONTROL,
    DEVICE_STATE,
    DEVICE_STATUS,
    FRAMES,
    JOINT_STATES,
    STATIC_FRAMES,
    STEP_ERRORS,
    STEP_LEDGER,
    STOPPING_DISTANCE,
)
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.output import control
from gemelo.tools.cli.common.session import CommandSession, connect, other_robots
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import SHOWN
from gemelo.tools.cli.device.device_snapshot import OPEN_LOOP
from gemelo.tools.cli.parser import Options, Parser

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

PATIENCE = 2.0  # [s] for the first messages
TO_HEAR_OF_CONTROL = 0.5  # [s] for what the gateway keeps for late joiners
REFRESH = 0.2  # [s] of --watch


def add_options(parser: Parser) -> None:
    """Adds --watch and --json."""
    parser.add_argument("-w", "--watch", action="store_true", help="again and again, until Ctrl-C")
    parser.add_argument("--json", action="store_true", help="JSON, in SI units")


def run(options: Options) -> ExitCode:
    """Prints the state once, or again and again."""
    with connect() as session:
        return state(session, options.watch, options.json)


class JointLine(msgspec.Struct, frozen=True):
    """One joint, in SI units."""

    name: str
    unit: str
    position: float | None = None  # [rad] or [m]
    velocity: float | None = None  # [rad/s] or [m/s]
    commanded_steps: float | None = None
    executed_steps: int | None = None
    error_steps: float | None = None
    confidence: float | None = None  # 0 to 1: that no step is lost
    verified_by: str = ""
    verified_at: int = 0  # [ns] UNIX time; 0: never


class StateSnapshot(msgspec.Struct, frozen=True):
    """Everything that `gemelo state` shows."""

    robot: str
    joints: tuple[JointLine, ...]
    tool_frame: str
    tool: tuple[float, ...] | None  # (3,) [m] in the base frame
    device: str
    mode: str
    online: bool
    reason: str
    time_scale: float | None
    buffered: float | None  # [s]
    round_trip: float | None  # [s]
    round_trip_age: float | None = None  # [s] since that was measured
    speaks: bool = False  # the device's states arrive
    warning: str = ""  # what a person has to mend though the device is online
    open_loop: bool = False  # the positions are what was sent: what was executed is not known
    ledger: StepLedger | None = None
    stopping: StoppingDistance | None = None
    control: ControlState | None = None
    why: Reason | None = None  # `reason` as data
    warning_why: Reason | None = None  # `warning` as data


def snapshot(
    arm: ArmDescription,
    states: JointState | None,
    errors: StepErrors | None,
    device: DeviceState | None,
    status: DeviceStatus | None,
    tool: tuple[float, ...] | None,
    ledger: StepLedger | None = None,
    stopping: StoppingDistance | None = None,
    control: ControlState | None = None,
    *,
    now: int = 0,
    age: float = 0.0,
) -> StateSnapshot:
    """The `StateSnapshot` at `now` [ns UNIX] of the messages received so far, None for one that was not.

    `tool` is (3,) [m] in the base frame, `age` [s] that of the device's state.
    """
    states, errors = states or JointState(), errors or StepErrors()
    position = dict(zip(states.name, states.position, strict=False))
    velocity = dict(zip(states.name, states.velocity, strict=False))
    commanded = dict(zip(errors.name, errors.commanded, strict=False))
    executed = dict(zip(errors.name, errors.executed, strict=False))
    error = dict(zip(errors.name, errors.error, strict=False))
    is_open_loop = bool(status and status.open_loop)
    if is_open_loop and device is not None:
        commanded = dict(zip(device.name, map(float, device.steps), strict=False))
        executed, error = {}, {}
    verified = {} if ledger is None else dict(
        zip(ledger.name, zip(ledger.confidence, map(str, ledger.verified_by), ledger.verified_at, strict=False),
            strict=False)
    )  # fmt: skip
    lines = tuple(
        JointLine(
            joint.name, joint.unit, position.get(joint.name), velocity.get(joint.name),
            commanded.get(joint.name), executed.get(joint.name), error.get(joint.name),
            *verified.get(joint.name, ()),
        )
        for joint in arm.joints
    )  # fmt: skip
    why = _why(status, now)
    return StateSnapshot(
        robot=arm.name,
        joints=lines,
        tool_frame=arm.tool_frame,
        tool=tool,
        device=status.device if status else "",
        mode=device.mode.name if device else "unknown",
        online=bool(status and status.online),
        reason=str(why or ""),
        time_scale=device.time_scale if device else None,
        buffered=device.buffered if device else None,
        round_trip=device.round_trip if device and device.is_round_trip_of_wire else None,
        round_trip_age=device.round_trip_age + age if device else None,
        speaks=bool(status and status.speaks),
        warning=status.warning if status else "",
        open_loop=is_open_loop,
        ledger=ledger,
        control=control,
        stopping=stopping,
        why=why,
        warning_why=warning_of(status) if status else None,
    )


def _why(status: DeviceStatus | None, now: int) -> Reason | None:
    if status is None:
        return because("state.no_gateway")
    if not status.online:
        return why_not_usable(status, now)
    return status.why or (plain(status.reason) if status.reason else None)


def text_of(view: StateSnapshot) -> str:
    """The snapshot as a table and three lines."""
    headings = columns("joint", "position", "unit", "velocity [unit/s]", "commanded [steps]", "executed [steps]",
                       "error [steps]", "sure", "verified by")  # fmt: skip
    parts = [table(headings, [_row(line) for line in view.joints])]
    parts += ["", sentence(OPEN_LOOP)] if view.open_loop else []
    parts += ["", sentence(_tool(view))]
    parts += filter(None, (ledger_text(view.ledger), stopping_text(view.stopping), control_text(view.control)))
    parts += [sentence(because("state.device", _device(view))), sentence(because("state.link", _link(view)))]
    parts += [sentence(because("state.mend", view.warning_why))] if view.warning_why is not None else []
    return "\n".join(parts)


def _tool(view: StateSnapshot) -> Reason:
    if view.tool is None:
        return because("state.tool.unknown", frame=view.tool_frame)
    x, y, z = (1e3 * value for value in view.tool)
    return because("state.tool", frame=view.tool_frame, x=x, y=y, z=z)


def _device(view: StateSnapshot) -> Reason:
    device, mode = view.device or word("device_line", "unknown"), view.mode
    if view.time_scale is None or view.buffered is None:
        found = because("state.device.mode", device=device, mode=mode)
    else:
        found = because(
            "state.device.path", device=device, mode=mode, time_scale=view.time_scale, buffered=view.buffered
        )
    return because("state.device.but", found, view.why) if view.online and view.why is not None else found


def _link(view: StateSnapshot) -> Reason:
    code = "state.link.online" if view.online else "state.link.not_usable" if view.speaks else "state.link.offline"
    found = because(code) if view.online or view.why is None else because(code, view.why)
    if view.round_trip is None:
        return found
    trip = round_trip(view.round_trip, view.round_trip_age or 0.0)
    return because("state.link.online.trip" if view.online else "state.link.trip", found, trip)


def ledger_text(ledger: StepLedger | None) -> str:
    """What the step ledger means at the tool; empty before the first."""
    if ledger is None:
        return ""
    why = ledger.why or plain(ledger.reason)
    if ledger.open_loop or not any(ledger.confidence):
        return sentence(because("state.ledger.unknown", why))
    bound, level, sure = 1e3 * ledger.tool_bound, ledger.level, _percent(ledger.arm_confidence)
    if any(ledger.lost):
        known = 1e3 * ledger.tool_error
        return sentence(because("state.ledger.lost", why, known=known, bound=bound, level=level, sure=sure))
    return sentence(because("state.ledger", why, bound=bound, level=level, sure=sure))


def stopping_text(stopping: StoppingDistance | None) -> str:
    """How far the tool goes if all is lost now; empty before the first word of it."""
    if stopping is None:
        return ""
    if not stopping.is_known:
        return sentence(because("state.stop.unknown", stopping.why or plain(stopping.reason)))
    times = {"duration": stopping.duration, "reaction": stopping.reaction}
    return sentence(because("state.stop", distance=1e3 * stopping.distance, **times))


def control_text(control: ControlState | None) -> str:
    """Who alone may move the arm; empty where nobody has taken control."""
    if control is None or not control.held:
        return ""
    return sentence(because("state.control", name=control.name, node=control.node, host=control.host))


def _percent(share: float | None) -> str:
    """Rounded down: what is not reached must not read as if it were."""
    return "-" if share is None else f"{int(share * 1000.0) / 10.0:g} %"


def _row(line: JointLine) -> tuple[str, ...]:
    shown, factor = SHOWN[line.unit]
    return (
        line.name, _number(line.position, factor, 3), shown, _number(line.velocity, factor, 3),
        _number(line.commanded_steps, 1.0, 2), _number(line.executed_steps, 1.0, 0), _number(line.error_steps, 1.0, 2),
        _percent(line.confidence), word("verified", line.verified_by) or "-",
    )  # fmt: skip


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{value * factor:z.{digits}f}"


class StateView:
    """Collects the newest of every message that a snapshot needs."""

    def __init__(self, session: CommandSession) -> None:
        self._arm = session.arm
        node = self._node = session.node
        self.frames = FrameBuffer()
        self._states = node.latest(JOINT_STATES)
        self._errors = node.latest(STEP_ERRORS)
        self._device = node.latest(DEVICE_STATE)
        self._status = node.latest(DEVICE_STATUS)
        self._ledger, self._stopping = node.latest(STEP_LEDGER), node.latest(STOPPING_DISTANCE)
        self._control = node.latest(CONTROL)
        node.subscribe(FRAMES, self.frames.insert_all)
        node.subscribe(STATIC_FRAMES, lambda message: self.frames.insert_all(message, is_static=True))

    @property
    def is_complete(self) -> bool:
        """True if every message has been received."""
        status = self._status.message
        parts: list[object] = [self._states.message, self._device.message, status]
        parts += [self._ledger.message, self._stopping.message]
        if status is not None and not status.open_loop:  # else there are no step errors
            parts.append(self._errors.message)
        return None not in parts and self.tool() is not None

    @property
    def knows_control(self) -> bool:
        """True if it is known who holds control; a recording of before there was such a thing never says."""
        return self._control.message is not None

    @property
    def is_empty(self) -> bool:
        """True if neither joint states nor the device's status have been received."""
        return self._states.message is None and self._status.message is None

    def tool(self) -> tuple[float, ...] | None:
        """The tool's position (3,) [m] in the base frame, by the frames of state_publisher; None if not known."""
        try:
            return tuple(self.frames.look_up(self._arm.base_frame, self._arm.tool_frame).translation)
        except FrameError:
            return None

    def snapshot(self) -> StateSnapshot:
        """Everything received so far."""
        return snapshot(
            self._arm,
            self._states.message,
            self._errors.message,
            self._device.message,
            self._status.message,
            self.tool(),
            self._ledger.message,
            self._stopping.message,
            self._control.message,
            now=self._node.now(),
            age=self._device.age(),
        )


def state(session: CommandSession, watch: bool, as_json: bool) -> ExitCode:
    """Prints one snapshot, or one after another until Ctrl-C."""
    view = StateView(session)
    wait_for(session, view)
    if not watch:
        print(_render(view, as_json))
        return ExitCode.OK
    return _watch(session, view, as_json)


def wait_for(session: CommandSession, view: StateView) -> None:
    """Waits for all messages, at most `PATIENCE` [s]; raises `CommandError` if there is none at all."""
    began = session.node.monotonic()
    while not view.is_complete and session.node.monotonic() < began + PATIENCE:
        session.node.wait(0.02)
    while not view.knows_control and session.node.monotonic() < began + TO_HEAR_OF_CONTROL:
        session.node.wait(0.02)
    if view.is_empty:
        silence = because("status.silent.arm", time=PATIENCE)
        raise CommandError(other_robots(session.deployment, session.arm) or silence, ExitCode.NO_STACK)


def _render(view: StateView, as_json: bool) -> str:
    shown = view.snapshot()
    return msgspec.json.encode(shown).decode() if as_json else text_of(shown)


def _watch(session: CommandSession, view: StateView, as_json: bool) -> ExitCode:
    clear = "\x1b[H\x1b[2J" if sys.stdout.isatty() and not as_json else ""

    def step(now: int) -> None:
        control(clear)
        print(_render(view, as_json), flush=True)

    session.node.spin(step, rate=1.0 / REFRESH)
    return ExitCode.OK
