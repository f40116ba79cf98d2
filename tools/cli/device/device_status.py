"""`gemelo device status` and `gemelo sensors`: the device at one glance."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from gemelo.schemas.device import DeviceMode, DeviceState, DeviceStatus
from gemelo.schemas.device_faults import meaning_and_remedy
from gemelo.schemas.device_link import state_round_trip, warning_of, why_not_usable
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.device.board_memory import memory_left, memory_low
from gemelo.tools.cli.device.device_snapshot import (
    OPEN_LOOP,
    PATIENCE,
    DeviceJoint,
    DeviceSnapshot,
    DeviceView,
    Reading,
    readings,
    snapshot_of,
)
from gemelo.tools.cli.parser import Options

FOR_SENSORS = 0.5  # [s] that `gemelo device status` waits for readings
HINTS = {
    DeviceMode.BOOT: because("status.hint.boot"),
    DeviceMode.UNREFERENCED: because("status.hint.unreferenced"),
    DeviceMode.HOLD: because("status.hint.hold"),
}
SWITCH = {True: "status.switch.pressed", False: "status.switch.released"}
OUTPUT = {True: "status.output.on", False: "status.output.off"}


def run(options: Options) -> ExitCode:
    """Prints the device's status."""
    with connect() as session:
        return status(session, options.json)


def run_sensors(options: Options) -> ExitCode:
    """Prints the sensors' readings."""
    with connect() as session:
        return sensors(session, options.json)


def status(session: CommandSession, as_json: bool) -> ExitCode:
    """Prints the snapshot of the device."""
    view = DeviceView(session)
    view.require_heard()
    if session.arm.sensors and view.state.message is not None:
        view.wait_for(lambda: view.sensors.message is not None, FOR_SENSORS)
    shown = snapshot_of(view)
    print(msgspec.json.encode(shown).decode() if as_json else text_of(shown))
    return ExitCode.OK


def sensors(session: CommandSession, as_json: bool) -> ExitCode:
    """Prints every sensor's reading; raises `CommandError` if there is none."""
    if not session.arm.sensors:
        raise CommandError(because("status.no_sensor"))
    view = DeviceView(session)
    if not view.wait_for(lambda: view.sensors.message is not None):
        view.require_state()
        raise CommandError(because("status.no_reading", time=PATIENCE))
    shown = readings(session.arm, view.sensors.message)
    if as_json:
        print(msgspec.json.encode(shown).decode())
    else:
        rows = [(each.name, "-" if each.value is None else f"{each.value:.6g}", each.unit or "-") for each in shown]
        print(table(columns("sensor", "value", "unit"), rows))
    return ExitCode.OK


def text_of(view: DeviceSnapshot) -> str:
    """The snapshot as one screen of text."""
    found: list[tuple[str, Reason | None]] = [
        ("device", who_it_is(view.status, view.now)),
        ("config", view.configuration_why),
        ("mend", warning_of(view.status)),
        ("memory", memory_left(view.status)),
        ("mend", memory_low(view.status)),
    ]
    if view.state is None:
        return "\n".join(_lines(found))
    found += [("mode", _mode(view)), *_fault(view), ("drivers", _drivers(view.state)), ("speed", _speed(view.state))]
    lines = _lines(found) + _named("inputs", view.inputs, SWITCH) + _named("outputs", view.outputs, OUTPUT)
    lines += [_line("sensors", ", ".join(map(reading_text, view.sensors)))] if view.sensors else []
    return "\n".join([*lines, *_lines([("link", _link(view.state, view.state_age))]), "", _joints(view)])


def _lines(found: Sequence[tuple[str, Reason | None]]) -> list[str]:
    return [_line(heading, sentence(what)) for heading, what in found if what is not None]


def _line(heading: str, text: str) -> str:
    return f"{word('device_line', heading):<8} {text}"


def reading_text(reading: Reading) -> str:
    """`ultra 12.5 cm`."""
    value = "-" if reading.value is None else f"{reading.value:.6g}"
    return f"{reading.name} {value} {reading.unit}".rstrip()


def who_it_is(status: DeviceStatus, now: int) -> Reason:
    """The device, how it is connected at `now` [ns UNIX], and its firmware."""
    name = status.device or word("device_line", "unknown")
    if not status.online:
        why = why_not_usable(status, now)
        return because("status.not_usable" if status.speaks else "status.offline", why, device=name)
    if status.open_loop:
        return because("status.online.open_loop", OPEN_LOOP, device=name, firmware=status.firmware)
    return because(
        "status.online.virtual" if status.virtual else "status.online",
        device=name, firmware=status.firmware, boot=f"{status.boot_id:08x}", cause=status.reset_cause,
        joints=status.joints, tick=status.tick_hz / 1000,
    )  # fmt: skip


def _mode(view: DeviceSnapshot) -> Reason:
    mode = view.state.mode if view.state is not None else DeviceMode.BOOT
    why = view.status.why or (plain(view.status.reason) if view.status.reason else HINTS.get(mode))
    if why is None or view.fault:
        return because("status.mode", mode=mode.name)
    return because("status.mode.hint", why, mode=mode.name)


def _fault(view: DeviceSnapshot) -> list[tuple[str, Reason | None]]:
    if not view.fault or view.state is None:
        return []
    meaning, mend = meaning_and_remedy(view.state.fault)
    where = {"fault": view.fault, "joint": view.fault_joint}
    what = because("fault.at_joint", meaning, **where) if view.fault_joint else because(
        "fault.present", meaning, fault=view.fault
    )  # fmt: skip
    return [("fault", what), ("remedy", mend)]


def _drivers(state: DeviceState) -> Reason:
    return because("status.armed") if state.armed else because("status.disarmed")


def _speed(state: DeviceState) -> Reason:
    if state.mode in (DeviceMode.RUN, DeviceMode.HOLD):
        return because("status.speed.now", speed=state.speed, now=state.time_scale)
    return because("status.speed", speed=state.speed)


def _named(heading: str, parts: dict[str, bool], codes: dict[bool, str]) -> list[str]:
    return [_line(heading, _each(parts, codes))] if parts else []


def _each(parts: dict[str, bool], codes: dict[bool, str]) -> str:
    return ", ".join(sentence(because(codes[is_on], name=name)) for name, is_on in parts.items())


def _link(state: DeviceState, age: float) -> Reason:
    return because(
        "status.link", state_round_trip(state, age),
        buffered=state.buffered, underruns=state.underruns, refused=state.refused, bad_frames=state.bad_frames,
    )  # fmt: skip


def _joints(view: DeviceSnapshot) -> str:
    return table(
        columns("joint", "referenced", "steps", "velocity [steps/s]", "switches"), [_row(j) for j in view.joints]
    )


def _row(joint: DeviceJoint) -> tuple[str, ...]:
    words = {None: "-", True: word("device_line", "yes"), False: word("device_line", "NO")}
    switches = _each(joint.switches, SWITCH)
    return (
        joint.name,
        words[joint.referenced],
        "-" if joint.steps is None else str(joint.steps),
        "-" if joint.velocity is None else f"{joint.velocity:.1f}",
        switches or word("device_line", "none"),
    )
