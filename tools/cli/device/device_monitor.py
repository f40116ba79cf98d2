"""`gemelo device monitor`: a line for every change, and on a terminal the device's status below."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from gemelo.api.homing import joint_name
from gemelo.schemas.device import DeviceConfiguration, DeviceEvent, DeviceState, DeviceStatus
from gemelo.schemas.device_faults import fault_text
from gemelo.schemas.topics import DEVICE_CONFIGURATION, DEVICE_EVENTS, DEVICE_STATE, DEVICE_STATUS
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.forms import Form, count_options, form_of, form_options
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.common.units import positive_seconds
from gemelo.tools.cli.device.device_snapshot import DeviceView, snapshot_of
from gemelo.tools.cli.device.device_status import text_of
from gemelo.tools.cli.parser import Options, Parser

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

REFRESH = 5.0  # [Hz]


def add_options(parser: Parser) -> None:
    """Adds the end of monitoring, --json and --csv."""
    count_options(parser, "lines")
    parser.add_argument("-d", "--duration", type=positive_seconds, metavar="TIME", help="end after it, as 10 or 10s")
    form_options(parser)


def run(options: Options) -> ExitCode:
    """Monitors the device."""
    with connect() as session:
        form = form_of(options, timed_line)
        return monitor(session, options.count, options.duration, form, is_live=form is timed_line)


class MonitorLine(msgspec.Struct, frozen=True):
    """One line of --json and --csv."""

    stamp: int  # [ns] UNIX time of its reception
    text: str


def timed_line(change: MonitorLine) -> str:
    """A change for a person, with the time of day."""
    time = datetime.datetime.fromtimestamp(change.stamp / 1e9).strftime("%H:%M:%S.%f")[:-3]
    return f"{time} {change.text}"


class Monitor:
    """Prints every change once, at most `count` of them."""

    def __init__(self, session: CommandSession, block: LiveBlock, count: int | None, form: Form) -> None:
        self._session, self._block, self._count, self._form = session, block, count, form
        self._status: DeviceStatus | None = None
        self._state: DeviceState | None = None
        self._configuration: DeviceConfiguration | None = None
        self._said = 0
        node = session.node
        node.subscribe(DEVICE_STATUS, self._on_status)
        node.subscribe(DEVICE_CONFIGURATION, self._on_configuration)
        node.subscribe(DEVICE_EVENTS, lambda event: self._say([event_text(event)]))
        node.subscribe(DEVICE_STATE, self._on_state)

    def _on_status(self, status: DeviceStatus) -> None:
        before, self._status = self._status, status
        self._say(status_changes(before, status))

    def _on_configuration(self, configuration: DeviceConfiguration) -> None:
        before, self._configuration = self._configuration, configuration
        self._say(configuration_changes(before, configuration))

    def _on_state(self, state: DeviceState) -> None:
        before, self._state = self._state, state
        self._say(state_changes(self._session.arm, before, state))

    def _say(self, lines: list[str]) -> None:
        now = self._session.node.now()
        for line in lines:
            if self._count is not None and self._said >= self._count:
                return
            self._said += 1
            self._block.say(self._form(MonitorLine(now, line)))
        if self._count is not None and self._said >= self._count:
            self._session.node.stop()


def monitor(
    session: CommandSession, count: int | None, duration: float | None, form: Form = timed_line, is_live: bool = True
) -> ExitCode:
    """Runs until Ctrl-C, `count` lines or `duration` [s]; `is_live`: the device's status is shown below the lines."""
    block = LiveBlock() if is_live else LiveBlock(is_live=False)
    view = DeviceView(session)
    Monitor(session, block, count, form)
    ends = None if duration is None else session.node.monotonic() + duration

    def step(now: int) -> None:
        block.draw("\n" + text_of(snapshot_of(view)))
        if ends is not None and session.node.monotonic() >= ends:
            session.node.stop()

    session.node.spin(step, rate=REFRESH)
    return ExitCode.OK


def status_changes(before: DeviceStatus | None, after: DeviceStatus) -> list[str]:
    """A line if the device came online, went offline or restarted."""
    if before is None or (before.online, before.boot_id, before.reason) != (after.online, after.boot_id, after.reason):
        reason = f": {after.reason}" if after.reason else ""
        boot = f", boot {after.boot_id:08x} ({after.reset_cause})" if after.online else ""
        how = "online" if after.online else "NOT USABLE" if after.speaks else "OFFLINE"
        return [f"{after.device or 'the device'} is {how}{boot}{reason}"]
    return []


def configuration_changes(before: DeviceConfiguration | None, after: DeviceConfiguration) -> list[str]:
    """A line if the configuration in force changed."""
    known = None if before is None else (before.crc32, before.accepted, before.reason)
    if known == (after.crc32, after.accepted, after.reason):
        return []
    said = "in force" if after.accepted else f"NOT in force: {after.reason or 'the device has another'}"
    return [f"configuration {after.crc32:08x} {said}"]


def state_changes(arm: ArmDescription, before: DeviceState | None, after: DeviceState) -> list[str]:
    """A line for every change of the state, steps and times left out."""
    old = before or DeviceState()
    lines = [] if before is not None and old.mode is after.mode else [f"mode {after.mode.name}"]
    if after.fault and (old.fault, old.fault_joint) != (after.fault, after.fault_joint):
        lines.append(f"fault {fault_text(after.fault, joint_name(arm, after.fault_joint))}")
    if before is None or old.armed != after.armed:
        lines.append("drivers armed" if after.armed else "drivers disarmed")
    lines += _referenced(old, after)
    lines += _named("input", old.inputs, after.inputs, "PRESSED", "released")
    lines += _named("output", old.outputs, after.outputs, "on", "off")
    lines += [f"speed {after.speed:.0%}"] if old.speed != after.speed else []
    counters = ("underruns", "refused", "bad_frames")
    lines += [
        f"{name.replace('_', ' ')} {getattr(after, name)}"
        for name in counters
        if before is not None and getattr(old, name) != getattr(after, name)
    ]
    return lines


def event_text(event: DeviceEvent) -> str:
    """A line for an event of the device."""
    return f"event {event.event}" + (f": {event.detail}" if event.detail else "")


def _referenced(before: DeviceState, after: DeviceState) -> list[str]:
    old = dict(zip(before.name, before.referenced, strict=False))
    new = dict(zip(after.name, after.referenced, strict=False))
    return [
        f"{name} is {'referenced' if known else 'UNREFERENCED'}"
        for name, known in new.items()
        if old.get(name) != known
    ]


def _named(kind: str, before: Sequence[str], after: Sequence[str], yes: str, no: str) -> list[str]:
    return [
        *(f"{kind} {name} {yes}" for name in after if name not in before),
        *(f"{kind} {name} {no}" for name in before if name not in after),
    ]
