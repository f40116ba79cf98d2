"""`gemelo deploy status`: what the file has and the bus has not is named, and what the bus has besides."""

from __future__ import annotations

import json
from contextlib import ExitStack

from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.device import DeviceStatus
from gemelo.schemas.roles import SERVICES
from gemelo.schemas.system import NodeInfo
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.tools.cli.hosts.deploy_status import summary
from gemelo.tools.cli.main import run
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.status import SeenNode, SeenRobot, ServiceState, is_well, site_status
from tests.hosts.sites import EXAMPLE
from tests.runtime.support import RouterProcess, spinning

SITE = load_site(EXAMPLE, project_root())
HOST = {"stepper_gateway": "cell", "state_publisher": "cell", "planner": "brain", "logger": "brain", "panel": "desk"}
ONLINE = DeviceStatus(online=True, device="rm1")


def node(machine: str, ready: bool = True, problem: str = "", version: str = "0.1.0") -> SeenNode:
    return SeenNode(NodeInfo(host=machine, ready=ready, problem=problem, version=version), ClockOffset(5.0, 0.001))


def all_well() -> dict[str, SeenNode]:
    return {name: node(machine) for name, machine in HOST.items()}


def status(nodes: dict[str, SeenNode], device: DeviceStatus | None = ONLINE, **robots: SeenRobot):
    return {each.service: each for each in site_status(SITE, {"rm1": SeenRobot(nodes, device), **robots})}


def test_a_site_that_is_as_its_file_says_is_well_and_every_clock_is_told():
    found = status(all_well())
    assert is_well(tuple(found.values()))
    assert set(found) == {*HOST, "router", "broker", "virtual_esp32"}
    assert found["planner"].clock_offset == 5.0
    assert (found["planner"].host, found["planner"].machine) == ("brain", "brain")
    assert summary(found.values()) == "all 8 are ready"


@given(st.sets(st.sampled_from(sorted(HOST))))
def test_exactly_what_is_silent_is_named(silent):
    found = status({name: each for name, each in all_well().items() if name not in silent})
    named = {name for name, each in found.items() if each.standing is ServiceState.SILENT}
    assert named == silent
    assert is_well(tuple(found.values())) == (not silent)
    for name in silent:
        assert f"{name} of rm1 is silent" in summary(found.values())


@given(st.sets(st.sampled_from(sorted(SERVICES))))
def test_exactly_what_the_file_does_not_have_is_named(besides):
    found = status(all_well() | {name: node("attic") for name in besides - set(HOST)})
    named = {name for name, each in found.items() if each.standing is ServiceState.NOT_EXPECTED}
    assert named == besides - set(HOST)


def test_a_robot_that_the_file_does_not_have_is_named_and_people_and_programs_are_not():
    other = SeenRobot({"planner": node("attic"), "my_program": node("attic")})
    found = site_status(SITE, {"rm1": SeenRobot(all_well(), ONLINE), "parol6": other})
    (named,) = (each for each in found if each.standing is ServiceState.NOT_EXPECTED)
    assert (named.robot, named.service, named.machine) == ("parol6", "planner", "attic")
    assert named.reason == "the file has no robot parol6"


def test_why_a_service_is_not_ready_is_told_in_its_own_words():
    found = status(all_well() | {"logger": node("brain", ready=False, problem="the disk is full")})
    assert (found["logger"].standing, found["logger"].reason) == (ServiceState.NOT_READY, "the disk is full")


def test_a_service_that_hangs_and_one_on_another_host_are_told_apart():
    found = status(all_well() | {"planner": SeenNode(), "logger": node("cell")})
    assert (found["planner"].standing, found["planner"].reason[-15:]) == (ServiceState.SILENT, "does not answer")
    assert found["logger"].standing is ServiceState.ELSEWHERE
    assert found["logger"].reason == "it runs on cell; the file has it on brain"


def test_what_is_not_on_the_bus_is_judged_by_who_needs_it():
    away = status(all_well(), DeviceStatus(reason="the broker at 10.0.0.11 does not answer"))
    assert (away["virtual_esp32"].standing, away["broker"].standing) == (ServiceState.SILENT, ServiceState.UNKNOWN)
    assert away["broker"].reason == "the broker at 10.0.0.11 does not answer"
    silent = status({}, None)
    assert silent["virtual_esp32"].standing is silent["broker"].standing is ServiceState.UNKNOWN


def test_two_versions_are_told():
    found = status(all_well() | {"planner": node("brain", version="0.2.0")})
    assert "versions differ: 0.1.0 (" in summary(found.values())
    assert "0.2.0 (planner on brain)" in summary(found.values())


LAB = """
[router]
host = "one"
port = {port}
[broker]
host = "one"
[robots.rm1]
folder = "urdf/rm1"
device = "board"
[hosts.one]
address = "127.0.0.1"
roles = ["operator"]
[hosts.one.services]
rm1 = ["stepper_gateway", "state_publisher", "planner"]
"""


def test_the_command_asks_the_bus_and_ends_with_1_until_all_are_there(tmp_path, monkeypatch, capsys):
    router = RouterProcess(tmp_path)
    file = tmp_path / "lab.toml"
    file.write_text(LAB.format(port=router.port))
    words = ["deploy", "status", str(file), "--json"]

    def asked() -> tuple[int, dict[str, dict[str, object]]]:
        code = run(words)
        return int(code), {each["service"]: each for each in json.loads(capsys.readouterr().out)}

    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(router.port))
    try:
        with ExitStack() as alive:
            for name in ("stepper_gateway", "state_publisher"):
                each = Node(name, router.deployment, robot="rm1", stop=ShutdownRequest())
                alive.enter_context(each)
                alive.enter_context(spinning(each))
                each.set_ready(True)
                if name == "stepper_gateway":
                    each.publisher(DEVICE_STATUS).put(ONLINE)
            code, found = asked()
            assert code == 1
            assert {name: each["standing"] for name, each in found.items()} == {
                "router": "ready", "broker": "ready", "stepper_gateway": "ready", "state_publisher": "ready",
                "planner": "silent",
            }  # fmt: skip
            assert abs(found["stepper_gateway"]["clock_offset"]) <= found["stepper_gateway"]["clock_bound"]
            planner = alive.enter_context(Node("planner", router.deployment, robot="rm1", stop=ShutdownRequest()))
            alive.enter_context(spinning(planner))
            planner.set_ready(False, "no description")
            assert asked()[1]["planner"]["reason"] == "no description"
            planner.set_ready(True)
            assert asked()[0] == 0
            assert run(words[:3]) == 0
            assert "all 5 are ready" in capsys.readouterr().out
    finally:
        router.kill()


def test_a_deployment_of_another_router_is_refused_with_the_one_to_take(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "7448")
    assert run(["deploy", "status", "example"]) == 2
    assert "10.0.0.12:7447" in (said := capsys.readouterr().err)
    assert "export GEMELO_CONFIG=/etc/gemelo/rm1.toml" in said
