"""The commands about the device, on a bus in memory."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import threading

import msgspec
import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import (
    ArmCommand,
    DeviceConfiguration,
    DeviceFault,
    DeviceMode,
    DeviceStatus,
    InjectKind,
    InjectRequest,
    StopKind,
)
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.forms import csv_lines, json_line
from gemelo.tools.cli.device import device, device_config, device_monitor, device_status
from gemelo.tools.cli.device.device_press import PRESSES, press, request_of
from gemelo.tools.cli.main import run
from gemelo.tools.cli.motion import stop_ready
from gemelo.tools.cli.motion.home import home
from tests.cli.pretend_device import PretendDevice
from tests.runtime.support import spinning


@pytest.fixture
def rm1_device(arm, network, deployment):
    with Node("stepper_gateway", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        made = PretendDevice(node, arm)
        with spinning(node, made.step):
            yield made


def test_homing_tells_the_way_of_every_joint_and_ends_with_zero(connected, rm1_device, capsys):
    assert home(connected, []) is ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    for name in connected.joint_names:
        assert f"{name}: home" in lines
    assert lines.index("brazo_joint: to its switch") < lines.index("brazo_joint: home")
    assert lines[-1].startswith("homed 3 of 3 joints in 0.")


def test_homing_says_how_many_steps_were_lost(connected, rm1_device, capsys):
    rm1_device.steps_off = {"brazo_joint": -37, "antebrazo_joint": 0, "efector_joint": 1}
    assert home(connected, ["q1", "antebrazo_joint", "q3"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "brazo_joint: home; its counter was -37 steps off (steps were lost, or it was moved by hand)\n" in text
    assert "antebrazo_joint: home; its counter was right\n" in text
    assert "efector_joint: home; its counter was right to a step\n" in text
    assert rm1_device.asked[-1].name == ("brazo_joint", "antebrazo_joint", "efector_joint")


def test_homing_as_json_is_one_object(connected, rm1_device, capsys):
    rm1_device.steps_off = {"efector_joint": 5}
    assert home(connected, ["efector_joint"], as_json=True) is ExitCode.OK
    report = json.loads(capsys.readouterr().out)
    assert (report["homed"], report["steps_off"], report["reason"]) == (["efector_joint"], {"efector_joint": 5}, "")


def test_a_fault_while_homing_names_the_joint_and_the_remedy(connected, rm1_device, capsys):
    rm1_device.homing_fault = DeviceFault.SWITCH_NOT_FOUND
    with pytest.raises(CommandError, match=r'SWITCH_NOT_FOUND at joint "antebrazo_joint": .*`gemelo reset`') as error:
        home(connected, [])
    assert error.value.code is ExitCode.FAILED
    assert "brazo_joint: home" in capsys.readouterr().out


def test_ctrl_c_stops_the_homing(connected, rm1_device, capsys):
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(CommandError, match="it was stopped") as error:
        home(connected, [])
    assert error.value.code is ExitCode.CANCELLED
    assert rm1_device.asked[-1] is StopKind.STOP
    assert "stopping: the joints slow down" in capsys.readouterr().out


def test_a_disarmed_device_is_not_homed_but_the_remedy_is_said(connected, rm1_device):
    rm1_device.set(armed=False)
    with pytest.raises(CommandError, match="`gemelo device arm`, then `gemelo home`"):
        home(connected, [])
    assert rm1_device.asked == []


def test_a_device_in_fault_is_not_homed_but_the_remedy_is_said(connected, rm1_device):
    rm1_device.set(mode=DeviceMode.ESTOP, fault=int(DeviceFault.EMERGENCY_STOP), armed=False)
    with pytest.raises(CommandError, match=r"EMERGENCY_STOP.*release it, `gemelo reset`, `gemelo device arm`"):
        home(connected, [])


def test_a_homing_that_never_begins_is_not_waited_for_for_ever(connected, rm1_device, monkeypatch):
    from gemelo.api import homing as module

    monkeypatch.setattr(module, "TO_BEGIN", 0.2)
    monkeypatch.setattr(rm1_device, "go_on_homing", lambda: rm1_device.set(mode=DeviceMode.UNREFERENCED))
    with pytest.raises(CommandError, match="did not begin"):
        home(connected, [])


def test_the_status_is_one_screen(session, rm1_device, capsys):
    rm1_device.set(inputs=("limit_q1",), outputs=("avanzar",), referenced=(True, False, True))
    assert device_status.status(session, as_json=False) is ExitCode.OK
    text = capsys.readouterr().out
    assert "rm1: online, virtual, firmware 1.0.0, boot 00000abc (power_on), 3 joints, tick 50 kHz" in text
    assert "config   in force (crc32 00001234)" in text
    assert "mode     UNREFERENCED: it does not know where its joints are: `gemelo home` or `gemelo reference`" in text
    assert "drivers  armed" in text
    assert "inputs   estop released" in text
    assert "outputs  avanzar on" in text
    assert "sensors  ultra 12.5 cm, bateria 7.4 V" in text
    assert "round trip 2.0 ms" in text
    rows = {line.split()[0]: line.split() for line in text.splitlines() if "_joint " in line}
    assert rows["brazo_joint"] == ["brazo_joint", "yes", "933", "0.0", "limit_q1", "PRESSED"]
    assert rows["antebrazo_joint"] == ["antebrazo_joint", "NO", "-50", "0.0", "limit_q2", "released"]


def test_the_status_shows_the_memory_of_a_board_that_says_it(session, rm1_device, capsys):
    device_status.status(session, as_json=False)
    assert "memory" not in capsys.readouterr().out
    rm1_device.status = msgspec.structs.replace(
        rm1_device.status, heap_free=71_000, heap_least=9_000, stack_least=812, stack_task="wire"
    )
    rm1_device.tell()
    device_status.status(session, as_json=False)
    text = capsys.readouterr().out
    assert "memory   71000 bytes free, 9000 at the least since its start; the stack of wire had 812 left" in text
    assert "mend     the board's memory was down to 9000 bytes" in text


def test_the_status_names_fault_joint_and_remedy(session, rm1_device, capsys):
    rm1_device.set(mode=DeviceMode.FAULT, fault=int(DeviceFault.LIMIT_SWITCH), fault_joint="q2")
    device_status.status(session, as_json=False)
    text = capsys.readouterr().out
    assert 'fault    LIMIT_SWITCH at joint "antebrazo_joint": its limit switch was pressed' in text
    assert "remedy   see what it ran into" in text


def test_a_configuration_that_is_not_in_force_says_what_to_do(session, rm1_device, capsys):
    rm1_device.status = DeviceStatus(online=True, device="rm1", config_crc32=1, wanted_crc32=2)
    rm1_device.configuration = DeviceConfiguration(crc32=2, accepted=False)
    rm1_device.tell()
    device_status.status(session, as_json=False)
    text = capsys.readouterr().out
    assert "NOT in force: the device has 00000001, robot.toml asks for 00000002; `gemelo device config --push`" in text


def test_an_offline_device_says_why(session, connected, rm1_device, capsys):
    rm1_device.status = DeviceStatus(online=False, device="rm1", reason="the broker does not answer")
    rm1_device.tell()
    device_status.status(session, as_json=False)
    assert "device   rm1: OFFLINE: the broker does not answer" in capsys.readouterr().out
    with pytest.raises(CommandError, match="offline: the broker does not answer"):
        home(connected, [])


def test_a_device_that_speaks_and_does_not_hear_is_shown_with_its_state(session, arm, network, deployment, capsys):
    with Node("stepper_gateway", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        deaf = PretendDevice(node, arm)
        deaf.status = DeviceStatus(online=False, speaks=True, device="rm1", reason="it speaks and does not hear")
        deaf.set(round_trip_age=40.0)
        deaf.tell()
        threading.Timer(0.3, lambda: deaf.step(node.now())).start()  # later than its status, which is latched
        assert device_status.status(session, as_json=False) is ExitCode.OK
    assert "round trip 2.0 ms, measured 40 s ago" in capsys.readouterr().out


def test_the_status_as_json_has_the_messages_and_the_words(session, rm1_device, capsys):
    assert device_status.status(session, as_json=True) is ExitCode.OK
    shown = json.loads(capsys.readouterr().out)
    assert shown["configured"] is True
    assert shown["state"]["armed"] is True
    assert shown["joints"][0]["switches"] == {"limit_q1": False}


def test_sensors_are_a_table_with_units(session, rm1_device, capsys):
    assert device_status.sensors(session, as_json=False) is ExitCode.OK
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[2:]]
    assert rows == [["ultra", "12.5", "cm"], ["bateria", "7.4", "V"], ["pinza", "-", "mm"]]


def test_silent_sensors_are_an_error(session, rm1_device, monkeypatch):
    from gemelo.tools.cli.device.device_snapshot import DeviceView

    wait = DeviceView.wait_for
    monkeypatch.setattr(DeviceView, "wait_for", lambda view, is_enough, timeout=0.2: wait(view, is_enough, timeout))
    rm1_device.readings = None
    with pytest.raises(CommandError, match="no reading"):
        device_status.sensors(session, as_json=False)


def test_an_output_is_switched_by_its_name(connected, rm1_device, capsys):
    assert device.output(connected, "avanzar", True) is ExitCode.OK
    assert rm1_device.asked[-1].on
    assert "output avanzar on done" in capsys.readouterr().out
    with pytest.raises(CommandError, match='no output "avansar": did you mean "avanzar"'):
        device.output(connected, "avansar", True)


def test_a_speed_is_a_share_of_the_planned_one(connected, rm1_device):
    assert device.speed(connected, 0.5) is ExitCode.OK
    assert rm1_device.asked[-1].scale == 0.5
    with pytest.raises(CommandError, match="not in 0% to 100%"):
        device.speed(connected, 1.01)


def test_arming_and_disarming_say_what_follows(connected, rm1_device, capsys):
    assert device.command(connected, "disarm") is ExitCode.OK
    assert "every joint is unreferenced" in capsys.readouterr().out
    assert device.command(connected, "arm") is ExitCode.OK
    assert "`gemelo home`" in capsys.readouterr().out


def test_the_monitor_says_every_change_once(session, rm1_device, capsys):
    threading.Timer(0.5, lambda: rm1_device.set(mode=DeviceMode.IDLE, inputs=("estop",), speed=0.25)).start()
    assert device_monitor.monitor(session, None, 1.0) is ExitCode.OK
    said = [line.split(" ", 1)[1] for line in capsys.readouterr().out.splitlines()]
    assert said[-3:] == ["mode IDLE", "input estop PRESSED", "speed 25%"]
    assert "drivers armed" in said
    assert "rm1 is online, boot 00000abc (power_on)" in said
    assert "brazo_joint is UNREFERENCED" in said
    assert len(said) == len(set(said))


def test_the_monitor_ends_after_so_many_lines_of_json(session, rm1_device, capsys):
    assert device_monitor.monitor(session, 3, 5.0, json_line, is_live=False) is ExitCode.OK
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 3
    assert all(line["stamp"] > 0 and line["text"] for line in lines)


def test_the_monitor_says_changes_as_a_table_under_a_heading(session, rm1_device, capsys):
    assert device_monitor.monitor(session, 2, 5.0, csv_lines(), is_live=False) is ExitCode.OK
    heading, *rows = csv.reader(capsys.readouterr().out.splitlines())
    assert heading == ["stamp", "text"]
    assert len(rows) == 2
    assert all(int(stamp) > 0 and text for stamp, text in rows)


def test_the_configuration_is_shown_with_its_crc(connected, rm1_device, capsys):
    assert device_config.show(connected, as_json=False) is ExitCode.OK
    text = capsys.readouterr().out
    assert '"name": "rm1"' in text
    assert "crc32 00001234, in force" in text


def test_a_configuration_in_force_is_not_pushed_again(connected, rm1_device, capsys):
    assert device_config.push(connected, yes=False) is ExitCode.OK
    assert "nothing to do" in capsys.readouterr().out
    assert rm1_device.asked == []


def test_pushing_disarms_configures_and_arms_again(connected, rm1_device, capsys):
    rm1_device.configuration = msgspec.structs.replace(rm1_device.configuration, accepted=False)
    rm1_device.tell()
    assert device_config.push(connected, yes=True) is ExitCode.OK
    assert rm1_device.asked == [StopKind.DISARM, ArmCommand()]
    assert "no joint is referenced: `gemelo home` or `gemelo reference`" in capsys.readouterr().out


def test_pushing_asks_first_and_a_pipe_cannot_answer(connected, rm1_device, monkeypatch):
    rm1_device.configuration = msgspec.structs.replace(rm1_device.configuration, accepted=False)
    rm1_device.tell()
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    with pytest.raises(CommandError, match="--yes"):
        device_config.push(connected, yes=False)
    assert rm1_device.asked == []


def test_a_moving_arm_is_not_configured(connected, rm1_device):
    rm1_device.configuration = msgspec.structs.replace(rm1_device.configuration, accepted=False)
    rm1_device.tell()
    rm1_device.set(mode=DeviceMode.RUN)
    with pytest.raises(CommandError, match="in RUN: wait, or `gemelo stop`"):
        device_config.push(connected, yes=True)


@pytest.mark.parametrize(
    ("words", "request_"),
    [
        ("estop", InjectRequest(kind=InjectKind.ESTOP, value=1.0)),
        ("release", InjectRequest(kind=InjectKind.ESTOP, value=0.0)),
        ("block q1", InjectRequest(kind=InjectKind.BLOCK, target="brazo_joint", value=1.0)),
        ("free brazo_joint", InjectRequest(kind=InjectKind.BLOCK, target="brazo_joint", value=0.0)),
        ("slip brazo_joint -40", InjectRequest(kind=InjectKind.SLIP, target="brazo_joint", value=-40.0)),
        ("switch limit_q2 auto", InjectRequest(kind=InjectKind.SWITCH, target="limit_q2", value=-1.0)),
        ("sensor bateria 7.1", InjectRequest(kind=InjectKind.SENSOR, target="bateria", value=7.1)),
        ("object 20mm", InjectRequest(kind=InjectKind.OBJECT, value=0.02)),
        ("object 0", InjectRequest(kind=InjectKind.OBJECT, value=0.0)),
        ("reboot", InjectRequest(kind=InjectKind.REBOOT)),
        ("offline 2", InjectRequest(kind=InjectKind.OFFLINE, value=2.0)),
        ("freeze 0.5", InjectRequest(kind=InjectKind.FREEZE, value=0.5)),
        ("drift -100", InjectRequest(kind=InjectKind.DRIFT, value=-100.0)),
    ],
)
def test_words_become_presses(arm, words, request_):
    word, *rest = words.split()
    assert request_of(arm, word, rest) == request_


def test_every_kind_of_press_has_its_word(arm):
    values = {"JOINT": "q1", "STEPS": "1", "INPUT": "estop", "on|off|auto": "on", "SENSOR": "ultra"}
    kinds = {request_of(arm, word, [values.get(f, "1") for f in each.follows]).kind for word, each in PRESSES.items()}
    assert kinds == set(InjectKind)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("estp", 'did you mean "estop"'),
        ("slip brazo_joint", "write it as: gemelo device press slip JOINT STEPS"),
        ("slip braso_joint 3", 'did you mean "brazo_joint"'),
        ("slip q1 many", '"many" is not a number of steps'),
        ("sensor ultra nan", "not finite"),
        ("switch limit_q9 on", "did you mean"),
        ("switch limit_q1 down", "auto"),
        ("offline -1", "negative"),
    ],
)
def test_what_cannot_be_pressed_says_what_can(arm, words, reason):
    word, *rest = words.split()
    with pytest.raises(CommandError, match=reason) as error:
        request_of(arm, word, rest)
    assert error.value.code is ExitCode.USAGE


def test_a_press_is_done_or_refused_in_the_devices_words(connected, rm1_device, capsys):
    assert press(connected, "slip", ["brazo_joint", "40"]) is ExitCode.OK
    assert "slip brazo_joint 40: done" in capsys.readouterr().out
    with pytest.raises(CommandError, match="press refused: it does not slip"):
        press(connected, "slip", ["efector_joint", "40"])


def test_a_real_device_is_not_pressed_over_the_bus(connected, rm1_device):
    rm1_device.status = msgspec.structs.replace(rm1_device.status, virtual=False)
    rm1_device.tell()
    with pytest.raises(CommandError, match="rm1 is a real device"):
        press(connected, "estop", [])
    assert rm1_device.pressed == []


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["home", "braso_joint"], 'did you mean "brazo_joint"'),
        (["output", "avansar", "on"], 'did you mean "avanzar"'),
        (["speed", "150%"], "not in 0% to 100%"),
        (["device", "press", "block", "nobody"], "no joint"),
    ],
)
def test_a_wrong_name_is_said_before_the_stack_is_asked(words, reason, capsys, monkeypatch):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    assert run(words) is ExitCode.USAGE
    assert reason in capsys.readouterr().err


def test_a_stop_that_waits_ready_stops_at_each_enter_or_space_and_leaves_at_q(connected, rm1_device, capsys):
    typed = iter(("", "x", " ", "", "\n", "q"))
    assert stop_ready.watch(connected, lambda timeout: next(typed)) is ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ready: Enter or space stops rm1, q leaves"
    assert [line.split(" after ")[0] for line in lines[1:]] == ["stop done", "stop done"]
    assert rm1_device.asked == [StopKind.STOP, StopKind.STOP]


def test_a_stop_that_waits_ready_tells_when_it_could_not_stop_and_waits_on(connected, network, rm1_device, capsys):
    def read(timeout: float) -> str:
        network.is_connected = not network.is_connected
        return next(typed)

    typed = iter(("", "", "q"))
    assert stop_ready.watch(connected, read) is ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["ready", "NOT READY", "ready"]


def test_a_stop_that_is_not_confirmed_says_so_and_what_to_do(connected, network, capsys):
    typed = iter((" ", "q"))
    assert stop_ready.watch(connected, lambda timeout: next(typed)) is ExitCode.OK
    said = capsys.readouterr()
    assert "stop was NOT confirmed: press again, or use the emergency stop" in said.out
    assert "nobody serves device/stop" in said.err
