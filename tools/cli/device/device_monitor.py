"""`gemelo device monitor`: a line for every change, and on a terminal the device's status below."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from gemelo.api.homing import joint_name
from gemelo.schemas.device import DeviceConfiguration, DeviceEvent, DeviceState, DeviceStatus
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.device_link import why_not_usable
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import DEVICE_CONFIGURATION, DEVICE_EVENTS, DEVICE_STATE, DEVICE_STATUS
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.forms import Form, count_options, form_of, form_options
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.common.units import positive_seconds
from gemelo.tools.cli.device.device_snapshot import DeviceView, snapshot_of
from gemelo.tools.cli.device.device_status import text_of
from gemelo.tools.cli.parser import Options, Parser

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

REFRESH = 5.0  # [Hz]
REFERENCED = {True: "monitor.referenced", False: "monitor.unreferenced"}
INPUT = {True: "monitor.input.pressed", False: "monitor.input.released"}
OUTPUT = {True: "monitor.output.on", False: "monitor.output.off"}
COUNTERS = {"underruns": "monitor.underruns", "refused": "monitor.refused", "bad_frames": "monitor.bad_frames"}


def add_options(parser: Parser) -> None:
    """Adds the end of monitoring, --json and --csv."""
    count_options(parser, "lines")
    parser.add_argument("-d", "--duration", type=positive_seconds, metavar="TIME", help="end after it, as 10 or 10s")
    form_options(parser)


def run(options: Options) -> ExitCode:
    """Monitors the device."""
    with connect() as session:
        is_for_person = not (options.csv or options.json)
        form = form_of(options, str)
        return monitor(session, options.count, options.duration, None if is_for_person else form, is_for_person)


class MonitorLine(msgspec.Struct, frozen=True):
    """One line of --json and --csv."""

    stamp: int  # [ns] UNIX time of its reception
    text: str


def timed_line(stamp: int, change: Reason) -> str:
    """A change for a person, with the time of day of its reception [ns UNIX]."""
    time = datetime.datetime.fromtimestamp(stamp / 1e9).strftime("%H:%M:%S.%f")[:-3]
    return f"{time} {sentence(change)}"


class Monitor:
    """Prints every change once, at most `count` of them; for a person where there is no form for a program."""

    def __init__(self, session: CommandSession, block: LiveBlock, count: int | None, form: Form | None) -> None:
        self._session, self._block, self._count, self._form = session, block, count, form
        self._status: DeviceStatus | None = None
        self._state: DeviceState | None = None
        self._configuration: DeviceConfiguration | None = None
        self._said = 0
        node = session.node
        node.subscribe(DEVICE_STATUS, self._on_status)
        node.subscribe(DEVICE_CONFIGURATION, self._on_configuration)
        node.subscribe(DEVICE_EVENTS, lambda event: self._say([event_change(event)]))
        node.subscribe(DEVICE_STATE, self._on_state)

    def _on_status(self, status: DeviceStatus) -> None:
        before, self._status = self._status, status
        self._say(status_changes(before, status, self._session.node.now()))

    def _on_configuration(self, configuration: DeviceConfiguration) -> None:
        before, self._configuration = self._configuration, configuration
        self._say(configuration_changes(before, configuration))

    def _on_state(self, state: DeviceState) -> None:
        before, self._state = self._state, state
        self._say(state_changes(self._session.arm, before, state))

    def _say(self, changes: Sequence[Reason]) -> None:
        now = self._session.node.now()
        for each in changes:
            if self._count is not None and self._said >= self._count:
                return
            self._said += 1
            self._block.say(self._form(MonitorLine(now, str(each))) if self._form else timed_line(now, each))
        if self._count is not None and self._said >= self._count:
            self._session.node.stop()


def monitor(
    session: CommandSession, count: int | None, duration: float | None, form: Form | None = None, is_live: bool = True
) -> ExitCode:
    """Runs until Ctrl-C, `count` lines or `duration` [s]; `form` is None for a person.

    `is_live`: the device's status is shown below the lines.
    """
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


def status_changes(before: DeviceStatus | None, after: DeviceStatus, now: int) -> list[Reason]:
    """What to say at `now` [ns UNIX] if the device came online, went offline or restarted."""
    if before is not None and (before.online, before.boot_id, before.reason) == (
        after.online, after.boot_id, after.reason
    ):  # fmt: skip
        return []
    device = after.device or "-"
    if not after.online:
        why = why_not_usable(after, now)
        return [because("monitor.not_usable" if after.speaks else "monitor.offline", why, device=device)]
    boot = {"boot": f"{after.boot_id:08x}", "cause": after.reset_cause}
    if not after.reason:
        return [because("monitor.online", device=device, **boot)]
    return [because("monitor.online.but", after.why or plain(after.reason), device=device, **boot)]


def configuration_changes(before: DeviceConfiguration | None, after: DeviceConfiguration) -> list[Reason]:
    """What to say if the configuration in force changed."""
    known = None if before is None else (before.crc32, before.accepted, before.reason)
    if known == (after.crc32, after.accepted, after.reason):
        return []
    crc32 = f"{after.crc32:08x}"
    if after.accepted:
        return [because("monitor.configuration.in_force", crc32=crc32)]
    why = after.why or (plain(after.reason) if after.reason else because("device.configuration.changed"))
    return [because("monitor.configuration.not_in_force", why, crc32=crc32)]


def state_changes(arm: ArmDescription, before: DeviceState | None, after: DeviceState) -> list[Reason]:
    """Every change of the state, steps and times left out."""
    old = before or DeviceState()
    changes = [] if before is not None and old.mode is after.mode else [because("monitor.mode", mode=after.mode.name)]
    fault = fault_reason(after.fault, joint_name(arm, after.fault_joint))
    if fault is not None and (old.fault, old.fault_joint) != (after.fault, after.fault_joint):
        changes.append(because("monitor.fault", fault))
    if before is None or old.armed != after.armed:
        changes.append(because("monitor.armed" if after.armed else "monitor.disarmed"))
    changes += _referenced(old, after)
    changes += _named(INPUT, old.inputs, after.inputs) + _named(OUTPUT, old.outputs, after.outputs)
    changes += [because("monitor.speed", speed=after.speed)] if old.speed != after.speed else []
    return changes + [
        because(code, count=getattr(after, name))
        for name, code in COUNTERS.items()
        if before is not None and getattr(old, name) != getattr(after, name)
    ]


def event_change(event: DeviceEvent) -> Reason:
    """An event of the device."""
    if not event.detail:
        return because("monitor.event", event=event.event)
    return because("monitor.event.detail", event.why or plain(event.detail), event=event.event)


def _referenced(before: DeviceState, after: DeviceState) -> list[Reason]:
    old = dict(zip(before.name, before.referenced, strict=False))
    new = dict(zip(after.name, after.referenced, strict=False))
    return [because(REFERENCED[known], joint=name) for name, known in new.items() if old.get(name) != known]


def _named(codes: dict[bool, str], before: Sequence[str], after: Sequence[str]) -> list[Reason]:
    return [
        *(because(codes[True], name=name) for name in after if name not in before),
        *(because(codes[False], name=name) for name in before if name not in after),
    ]
