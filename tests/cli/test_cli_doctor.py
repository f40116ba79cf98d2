"""`gemelo doctor`: each thing that keeps a twin from working is named with its remedy."""

from __future__ import annotations

import json
import platform
import re
import subprocess
import sys
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

import pytest

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.plain_text import ENGLISH
from gemelo.schemas.system import NodeInfo
from gemelo.tools.chaos.descriptors import give_descriptors, take_descriptors
from gemelo.tools.cli.common import language
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch import doctor
from tests.disks import WAYS, refusing_disk
from tests.real_time import may_run_in_real_time
from tests.stepper_gateway.locked import Mosquitto, external, locked

OK = ClockOffset(0.0, 0.001)


@pytest.fixture
def stack(gateway):
    return gateway


def test_the_doctor_finds_a_twin_that_is_well(session, stack):
    found = {each.subject: each for each in doctor.twin(session)}
    assert found["nodes"].verdict is doctor.Verdict.OK
    assert found["device"].found == "rm1 is online, round trip 2.0 ms"
    assert found["clocks"].verdict is doctor.Verdict.OK
    assert found["versions of the nodes"].verdict is doctor.Verdict.OK


def test_the_doctor_names_two_nodes_of_one_name(session, stack, network):
    bus = MemoryBus(network)
    for started in ("00000000000000000001.11.cellar", "00000000000000000002.22.attic"):
        bus.declare_alive(f"@id/planner/planner/{started}")
    bus.declare_alive("@id/*/*/*")
    found = {each.subject: each for each in doctor.twin(session)}
    bus.close()
    assert found["two planner"].verdict is doctor.Verdict.ERROR
    assert found["two planner"].found == "planner lives 2 times: process 11 on cellar, process 22 on attic"
    assert found["two planner"].remedy.endswith("end process 11 on cellar")
    assert not [each for each in doctor.twin(session) if each.subject.startswith("two ")]


def test_the_doctor_without_a_twin_says_what_would_do(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    monkeypatch.setenv("GEMELO_MQTT_PORT", "1")
    assert run(["doctor", "--json"]) is ExitCode.FAILED
    found = {each["subject"]: each for each in json.loads(capsys.readouterr().out)}
    for name in ("router", "broker"):
        assert (found[name]["verdict"], found[name]["remedy"]) == ("error", "start the twin with `make up`")
    assert found["robot"]["verdict"] == "ok"
    assert bool(found["priority"]["remedy"]) is not may_run_in_real_time()
    assert "twin" not in found


def test_the_doctor_speaks_the_language_of_the_command_line_and_its_json_is_the_same(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    monkeypatch.setenv("GEMELO_MQTT_PORT", "1")
    assert run(["--lang", "es", "doctor"]) is ExitCode.FAILED
    text = capsys.readouterr().out
    assert re.search(r"^error +router +nadie escucha en 127\.0\.0\.1:1 \(", text, re.MULTILINE)
    assert re.search(r"^(bien|aviso) +memoria +\d+\.\d GB libres", text, re.MULTILINE)
    assert "router: arranque el gemelo con `make up`" in text
    assert run(["--lang", "es", "doctor", "--json"]) is ExitCode.FAILED
    found = {each["subject"]: each for each in json.loads(capsys.readouterr().out)}
    assert found["router"]["found"].startswith("nobody listens at 127.0.0.1:1 (")
    assert found["router"]["why"]["code"] == "doctor.listens.not"
    language.choose(ENGLISH)


def test_the_doctor_says_what_versions_are_installed(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    run(["doctor"])
    (line,) = [each for each in capsys.readouterr().out.splitlines() if " versions " in each]
    for words in (f"gemelo {version('gemelo')}", "wire protocol 1", f"Python {platform.python_version()}"):
        assert words in line
    assert line.split()[0] == "ok"


@pytest.mark.parametrize(
    ("limit", "plenty", "nothing_left", "subject", "remedy"),
    [
        ("LEAST_DISK", 0.0, 1e30, "disk", "free space where "),
        ("LEAST_MEMORY", 0.0, 1e30, "memory", "end what uses it"),
        ("MOST_CPU", 101.0, -1.0, "CPU", "end what uses it (`gemelo top` says which node)"),
    ],
)
def test_the_doctor_says_how_much_room_is_left_and_what_would_do(
    monkeypatch, tmp_path, capsys, limit, plenty, nothing_left, subject, remedy
):
    """Measured here and now, against one limit that everything keeps, and one that nothing does."""
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "not_there_yet" / "out"))
    said = []
    for value in (plenty, nothing_left):
        monkeypatch.setattr(doctor, limit, value)
        run(["doctor", "--json"])
        found = {each["subject"]: each for each in json.loads(capsys.readouterr().out)}
        said.append((found[subject]["verdict"], found[subject]["remedy"]))
        assert re.match(
            r"\d+ % of \d+ cores in use$" if subject == "CPU" else r"\d+\.\d GB free$", found[subject]["found"]
        )
    assert said[0] == ("ok", "")
    assert said[1][0] == "warning"
    assert said[1][1].startswith(remedy)


@pytest.mark.parametrize(
    ("diagnosis", "verdict", "words"),
    [
        (doctor.device(None, None, "127.0.0.1"), "error", "make up"),
        (doctor.device(DeviceStatus(reason="no state for 0.5 s"), None, ""), "error", "offline: no state for 0.5 s"),
        (doctor.device(DeviceStatus(online=True, device="rm1"), DeviceState(fault=3), ""), "warning", "gemelo reset"),
        (doctor.clocks({"planner": ClockOffset(5.2, 0.01)}), "warning", "timedatectl"),
        (doctor.clocks({"a": ClockOffset(-3.0, 0.002), "b": OK}), "warning", "a -3000.0 ±2.0 ms let"),
        (doctor.clocks({"a": ClockOffset(0.0003, 0.001), "b": OK}), "ok", "farthest from this host's is a, +0.3 ±1.0"),
        (doctor.clocks({}), "warning", "no node tells its time"),
        (doctor.serial_port("/dev/nobody"), "error", "/dev/nobody is not there"),
        (
            doctor.versions({"planner": NodeInfo(version="0.0.1", host="brain")}),
            "warning",
            "planner 0.0.1 on brain; this",
        ),
        (
            doctor.versions({"planner": NodeInfo(version="0.0.1")}),
            "warning",
            "put one version on every host (`make setup`",
        ),
        (doctor.versions({"planner": NodeInfo(version=version("gemelo"))}), "ok", "1 nodes run"),
    ],
)
def test_the_doctor_names_what_is_wrong_with_its_remedy(diagnosis, verdict, words):
    assert diagnosis.verdict == verdict
    assert words in f"{diagnosis.found} {diagnosis.remedy}"


def test_the_doctor_says_why_a_broker_does_not_let_the_gateway_in(tmp_path: Path):
    section = locked(tmp_path / "lock")
    with closing(Mosquitto(tmp_path, section)):
        assert doctor.broker(section).verdict is doctor.Verdict.OK
        secure_folder.write(tmp_path / "lock" / "gateway.password", "wrong\n")
        refused = doctor.broker(section)
        assert refused.verdict is doctor.Verdict.ERROR
        assert 'refuses user "gateway"' in refused.found
        (tmp_path / "lock" / "gateway.password").chmod(0o644)
        assert "chmod 600" in doctor.broker(section).found
    away = doctor.broker(external(locked(tmp_path / "other")))
    assert "are its address and port right" in away.found


def test_the_doctor_says_which_process_gets_no_descriptor_any_more():
    program = "print(flush=True); input()"
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it has loaded what it needs
        info = NodeInfo(node="planner", pid=process.pid)
        assert list(doctor.descriptors([info])) == []
        take_descriptors(process.pid)
        (found,) = doctor.descriptors([info])
        assert (found.verdict, found.subject) == ("warning", "descriptors of planner")
        assert "its limit is 3" in found.found
        give_descriptors(process.pid)
        assert list(doctor.descriptors([info])) == []
        process.communicate(b"\n")


@pytest.mark.parametrize("wire", ["mqtt", "serial"])
def test_where_a_sites_gateway_is_on_another_host_the_devices_wire_is_no_matter_here(wire, monkeypatch, tmp_path: Path):
    file, keys = tmp_path / "rm1.toml", tmp_path / "keys"
    keys.mkdir()
    file.write_text(f"""robot = "urdf/rm1"
wire = "{wire}"
[router]
port = 1
tls = true
ca = "{keys}/ca.pem"
[mqtt]
broker = "external"
port = 1
secure_folder = "{tmp_path}/broker"
[serial]
device = "/dev/nobody"
""")
    monkeypatch.setenv("GEMELO_CONFIG", str(file))
    found = {each.subject: each for each in doctor.diagnoses()}
    assert found["wire"].verdict is doctor.Verdict.OK
    assert found["wire"].found == "the gateway is on another host of the site, and the device's wire with it"
    (keys / "gateway.pem").touch()
    found = {each.subject: each for each in doctor.diagnoses()}
    assert found["broker" if wire == "mqtt" else "serial port"].verdict is doctor.Verdict.ERROR


REMEDIES = dict(
    zip(WAYS, ("make room on that disk", "is read-only, as Linux makes one that fails", "[paths]"), strict=True)
)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("variable", "name"), [("GEMELO_PATHS_OUT", "recordings"), ("GEMELO_PATHS_RUN", "run")])
def test_the_doctor_says_that_a_folder_cannot_be_written(monkeypatch, tmp_path: Path, capsys, way, variable, name):
    monkeypatch.setenv(variable, str(tmp_path / "here"))
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    with refusing_disk(way, tmp_path / "here") as disk:
        disk.refuse()
        assert run(["doctor", "--json"]) is ExitCode.FAILED
        found = {each["subject"]: each for each in json.loads(capsys.readouterr().out)}[f"folder {name}"]
        assert (found["verdict"], REMEDIES[way] in found["remedy"]) == ("error", True), found
        disk.take()
        run(["doctor", "--json"])
        assert f"folder {name}" not in {each["subject"] for each in json.loads(capsys.readouterr().out)}


def test_the_doctor_says_what_a_node_cannot_write_to_its_disk():
    well, ill = NodeInfo(node="planner"), NodeInfo(node="logger", host="brain", unwritten="x cannot be written: y")
    (found,) = doctor.unwritten([well, ill])
    assert (found.verdict, found.subject) == ("warning", "files of logger on brain")
    assert found.found == "x cannot be written: y"


def test_the_doctor_says_what_is_wrong_with_the_deployment(monkeypatch, tmp_path: Path, capsys):
    (tmp_path / "site.toml").write_text("rober = 3")
    monkeypatch.setenv("GEMELO_CONFIG", str(tmp_path / "site.toml"))
    assert run(["doctor"]) is ExitCode.FAILED
    assert "rober" in capsys.readouterr().out


def test_a_gateway_that_says_nothing_is_looked_for_on_its_own_host():
    here, away = (doctor.device(None, None, host) for host in ("127.0.0.1", "10.0.0.12"))
    assert here.found == away.found == "stepper_gateway says nothing of it"
    assert "make up" in here.remedy
    assert "make up" not in away.remedy
    assert "ping 10.0.0.12" in away.remedy
