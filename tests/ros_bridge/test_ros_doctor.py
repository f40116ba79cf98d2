"""`gemelo ros doctor`: whose router is whose, who is there, and whose types are others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.libraries.ros2.types import ros_type
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.ros_wire.names import DEFAULT, EntityKind, NodeName, endpoint_token, node_token
from gemelo.schemas.deployment import Deployment, RosSection, RouterSection
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from gemelo.tools.cli.ros import ros_doctor
from gemelo.tools.cli.watch.doctor import Verdict
from tests.ros_bridge.bridges import running
from tests.ros_bridge.ros_client import RosClient, ros_router
from tests.runtime.support import free_port, until

JOINTS = "sensor_msgs/msg/JointState"


def judged(deployment: Deployment) -> dict[str, tuple[Verdict, str]]:
    """By subject: the verdict and the code."""
    return {each.subject: (each.verdict, each.why.code) for each in ros_doctor.diagnoses(deployment)}


def at(router: str = "", own_port: int = 0) -> Deployment:
    section = RosSection(router=router)
    return replace(load_deployment(environ={}), ros=section, router=RouterSection(port=own_port or free_port()))


def test_without_a_router_of_ros_it_says_how_to_start_one() -> None:
    found = judged(at())
    assert found["ROS router"] == (Verdict.ERROR, "ros.router.none")
    assert found["router"] == (Verdict.OK, "ros.doctor.no_twin")


def test_a_router_that_is_not_there_is_named() -> None:
    assert judged(at(f"tcp/127.0.0.1:{free_port()}"))["ROS router"] == (Verdict.ERROR, "ros.router.away")


def test_a_bridge_is_found_and_that_it_is_alone() -> None:
    with ros_router() as locator:
        found = judged(at(locator))
        assert found["ROS router"] == (Verdict.OK, "ros.doctor.router")
        assert found["bridge"] == (Verdict.ERROR, "ros.doctor.no_bridge")
        assert found["ROS nodes"] == (Verdict.WARNING, "ros.doctor.alone")


def test_another_node_and_its_other_definition_of_a_type_are_named(tmp_path: Path) -> None:
    node = NodeName("rviz")
    patched = ros_type(JOINTS)._replace(hash="RIHS01_0")
    with running(tmp_path) as bridge:
        session = str(bridge.client.session.info.zid())
        names = ("/joint_states", patched), ("/other", patched), ("/joint_states", ros_type(JOINTS))
        tokens = [node_token(node, session)] + [
            endpoint_token(node, session, number, EntityKind.SUBSCRIPTION, name, kind, DEFAULT)
            for number, (name, kind) in enumerate(names, 1)
        ]
        held = [bridge.client.declare_client(each) for each in tokens]
        assert until(lambda: any("set_parameters_atomically" in each for each in bridge.client.tokens()))
        deployment = replace(bridge.deployment, router=RouterSection(port=free_port()))
        found = list(ros_doctor.diagnoses(deployment))
        assert held
    by_code = {each.why.code: each.why.values for each in found}
    assert by_code["ros.doctor.nodes"]["nodes"] == ("/rviz",)
    assert by_code["ros.doctor.bridge"]["node"] == "/gemelo"
    hashes = [each.why.values for each in found if each.why.code == "ros.doctor.hash"]
    assert [(each["name"], each["hash"]) for each in hashes] == [("/joint_states", "RIHS01_0")]


def test_nodes_of_ros_on_our_own_router_are_an_error() -> None:
    port = free_port()
    with ros_router(port) as locator, RosClient(locator) as client:
        held = client.declare_client(node_token(NodeName("turtle"), str(client.session.info.zid())))
        found = {each.subject: each for each in ros_doctor.diagnoses(at(own_port=port))}
        assert held
    assert (found["router"].verdict, found["router"].why.code) == (Verdict.ERROR, "ros.doctor.astray")
    assert found["router"].why.values["nodes"] == ("/turtle",)


def test_the_command_prints_what_to_copy_and_json_for_programs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with ros_router() as locator:
        monkeypatch.setattr(ros_doctor, "deployment_here", lambda: at(locator))
        assert run(["ros", "doctor"]) is ExitCode.FAILED
        printed = capsys.readouterr().out
        assert "export RMW_IMPLEMENTATION=rmw_zenoh_cpp" in printed
        assert f'mode="client";connect/endpoints=["{locator}"]' in printed
        assert run(["ros", "doctor", "--json"]) is ExitCode.FAILED
        codes = {each["why"]["code"] for each in json.loads(capsys.readouterr().out)}
        assert "ros.doctor.no_bridge" in codes
