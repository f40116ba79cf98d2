"""`gemelo device status` and `gemelo sensors`: the device at one glance."""

from __future__ import annotations

import msgspec

from gemelo.schemas.device import DeviceMode, DeviceState, DeviceStatus
from gemelo.schemas.device_link import offline_word, reason_text, state_round_trip_text
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.device.board_memory import memory_left, memory_low
from gemelo.tools.cli.device.device_snapshot import (
    OPEN_LOOP,
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
    DeviceMode.BOOT: "it has no configuration yet: `gemelo device config --push`",
    DeviceMode.UNREFERENCED: "it does not know where its joints are: `gemelo home` or `gemelo reference`",
    DeviceMode.HOLD: "it stands on its path: `gemelo resume` or `gemelo stop`",
}


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
        raise CommandError("robot.toml has no [[sensor]], so there is none to read")
    view = DeviceView(session)
    if not view.wait_for(lambda: view.sensors.message is not None):
        view.require_state()
        raise CommandError("the device has sent no reading for 2 s: `gemelo device status`, `gemelo log`")
    shown = readings(session.arm, view.sensors.message)
    if as_json:
        print(msgspec.json.encode(shown).decode())
    else:
        rows = [(each.name, "-" if each.value is None else f"{each.value:.6g}", each.unit or "-") for each in shown]
        print(table(("sensor", "value", "unit"), rows))
    return ExitCode.OK


def text_of(view: DeviceSnapshot) -> str:
    """The snapshot as one screen of text."""
    lines = [f"device   {who_it_is(view.status, view.now)}", f"config   {view.configuration}"]
    lines += [f"mend     {view.status.warning}"] if view.status.warning else []
    for heading, found in (("memory", memory_left(view.status)), ("mend", memory_low(view.status))):
        lines += [f"{heading:<8} {sentence(found)}"] if found is not None else []
    if view.state is None:
        return "\n".join(lines)
    lines += [f"mode     {_mode(view)}", *_fault(view), f"drivers  {_drivers(view.state)}"]
    lines += [f"speed    {_speed(view.state)}"]
    lines += _named("inputs", view.inputs, "PRESSED", "released") + _named("outputs", view.outputs, "on", "off")
    lines += [f"sensors  {', '.join(map(reading_text, view.sensors))}"] if view.sensors else []
    return "\n".join([*lines, f"link     {_link(view.state, view.state_age)}", "", _joints(view)])


def reading_text(reading: Reading) -> str:
    """`ultra 12.5 cm`."""
    value = "-" if reading.value is None else f"{reading.value:.6g}"
    return f"{reading.name} {value} {reading.unit}".rstrip()


def who_it_is(status: DeviceStatus, now: int) -> str:
    """The device, how it is connected at `now` [ns UNIX], and its firmware."""
    name = status.device or "unknown"
    if not status.online:
        return f"{name}: {offline_word(status.speaks).upper()}: {reason_text(status, now)}"
    if status.open_loop:
        return f"{name}: online, {status.firmware}; {OPEN_LOOP}"
    kind = "virtual, " if status.virtual else ""
    return (
        f"{name}: online, {kind}firmware {status.firmware}, boot {status.boot_id:08x} ({status.reset_cause}), "
        f"{status.joints} joints, tick {status.tick_hz / 1000:g} kHz"
    )


def _mode(view: DeviceSnapshot) -> str:
    mode = view.state.mode if view.state is not None else DeviceMode.BOOT
    hint = "" if view.fault else view.status.reason or HINTS.get(mode)
    return f"{mode.name}: {hint}" if hint else mode.name


def _fault(view: DeviceSnapshot) -> list[str]:
    if not view.fault:
        return []
    where = f' at joint "{view.fault_joint}"' if view.fault_joint else ""
    return [f"fault    {view.fault}{where}: {view.meaning}", f"remedy   {view.remedy}"]


def _drivers(state: DeviceState) -> str:
    return "armed: the motors hold" if state.armed else "disarmed: the motors are without current, `gemelo device arm`"


def _speed(state: DeviceState) -> str:
    is_on_path = state.mode in (DeviceMode.RUN, DeviceMode.HOLD)
    now = f"; the path runs at {state.time_scale:.0%} now" if is_on_path else ""
    return f"{state.speed:.0%} of the planned one{now}"


def _named(heading: str, parts: dict[str, bool], yes: str, no: str) -> list[str]:
    said = ", ".join(f"{name} {yes if is_on else no}" for name, is_on in parts.items())
    return [f"{heading:<8} {said}"] if said else []


def _link(state: DeviceState, age: float) -> str:
    trip = state_round_trip_text(state, age)
    return (
        f"{trip}, {state.buffered:.2f} s of path queued; since boot "
        f"{state.underruns} under-runs, {state.refused} refused, {state.bad_frames} bad frames"
    )


def _joints(view: DeviceSnapshot) -> str:
    return table(("joint", "referenced", "steps", "velocity [steps/s]", "switches"), [_row(j) for j in view.joints])


def _row(joint: DeviceJoint) -> tuple[str, ...]:
    words = {None: "-", True: "yes", False: "NO"}
    switches = ", ".join(f"{name} {'PRESSED' if on else 'released'}" for name, on in joint.switches.items())
    return (
        joint.name,
        words[joint.referenced],
        "-" if joint.steps is None else str(joint.steps),
        "-" if joint.velocity is None else f"{joint.velocity:.1f}",
        switches or "none",
    )
