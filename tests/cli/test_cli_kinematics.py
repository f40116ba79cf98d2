"""`gemelo ik` and `gemelo fk`, from their words to the planner's answer."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FkRequest, IkRequest, PoseGoal
from gemelo.schemas.topics import FK, IK
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.main import run
from gemelo.tools.cli.robot import kinematics


@pytest.fixture
def asked(
    arm, network, deployment, connected, monkeypatch: pytest.MonkeyPatch
) -> Iterator[list[IkRequest | FkRequest]]:
    """What a planner on the same bus was asked; the commands reach it."""
    requests: list[IkRequest | FkRequest] = []
    answers = KinematicRequests(arm)
    home = JointState(name=arm.joint_names, position=(0.0,) * len(arm.joints))

    def ik(request: IkRequest):
        requests.append(request)
        return answers.ik(request, home)

    def fk(request: FkRequest):
        requests.append(request)
        return answers.fk(request, home)

    @contextmanager
    def connect_arm(robot=None):
        with reported(load_robot()):
            yield connected

    monkeypatch.setattr(kinematics, "connect_arm", connect_arm)
    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.serve(IK, ik)
        node.serve(FK, fk)
        thread = threading.Thread(target=lambda: node.spin(lambda now: None, rate=10.0))
        thread.start()
        yield requests
        node.stop()
        thread.join()


def said(line: str) -> ExitCode:
    return run(line.split())


def test_configurations_are_printed_the_nearest_first(asked, capsys):
    assert said("ik --to 0.25 0.15 0.10 --solutions 4") is ExitCode.OK
    understood, heading, _, *rows = capsys.readouterr().out.splitlines()
    assert understood == "understood: tool to 250, 150, 100 mm"
    assert heading.split("  ")[0].strip() == "brazo_joint [deg]"
    assert heading.endswith("away [s]")
    away = [float(row.split()[-1]) for row in rows]
    assert len(away) == 2
    assert away == sorted(away)


def test_every_option_reaches_the_goal(asked):
    said(
        "ik --to 0.25 0.15 0.1 --axis 0 0 1 --along 0 0 -1 --tolerance 2mm --turn-tolerance 90deg "
        "--near q1=90deg --touching"
    )
    goal = PoseGoal(
        position=(0.25, 0.15, 0.1), tool_axis=(0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0),
        position_tolerance=0.002, orientation_tolerance=math.radians(90.0),
    )  # fmt: skip
    near = JointState(name=("brazo_joint",), position=(math.radians(90.0),))
    assert asked == [IkRequest(goal=goal, near=near, avoid_collisions=False)]


def test_roll_pitch_yaw_become_a_quaternion(asked):
    said("ik --to 0.25 0.15 0.1 --rpy 180deg 0 90deg --frame base_link")
    [request] = asked
    half = math.sqrt(0.5)
    assert request.goal.orientation == pytest.approx((half, half, 0.0, 0.0))
    assert request.goal.frame == "base_link"


def test_json_is_the_response(asked, capsys):
    assert said("ik --to 0.25 0.15 0.1 --json") is ExitCode.OK
    response = json.loads(capsys.readouterr().out)
    assert response["name"] == ["brazo_joint", "antebrazo_joint", "efector_joint"]
    assert len(response["solutions"]) == 1


def test_a_tilt_that_rm1_cannot_do_is_refused_with_what_can_be_typed(asked, capsys):
    assert said("ik --to 0.25 0.15 0.1 --axis 0 0 1 --along 1 0 -1") is ExitCode.FAILED
    error = capsys.readouterr().err
    assert "rm1 cannot tilt its tool" in error
    assert "--to 0.2500 0.1500 0.1000 --along " in error


def test_fk_of_what_ik_says_is_the_point(asked, capsys):
    said("ik --to 0.25 0.15 0.1 --json")
    values = json.loads(capsys.readouterr().out)["solutions"][0]["position"]
    joints = " ".join(
        f"q{index + 1}={value!r}{unit}"
        for index, (value, unit) in enumerate(zip(values, ("rad", "rad", "m"), strict=True))
    )
    assert said(f"fk {joints} --links efector_link base_link") is ExitCode.OK
    _, _, _, tool, base = capsys.readouterr().out.splitlines()
    assert [float(cell) for cell in tool.split()[1:4]] == pytest.approx([0.25, 0.15, 0.1], abs=2e-6)
    assert base.split()[0] == "base_link"


def test_an_unknown_link_is_refused_with_the_nearest(asked, capsys):
    assert said("fk --links efector") is ExitCode.FAILED
    assert 'rm1 has no link "efector"' in capsys.readouterr().err


@pytest.mark.parametrize("line", ["ik", "ik --to 1 2", "ik --to nan 0 0", "fk brazo_joint=30mm", "fk nothing=1"])
def test_what_cannot_be_understood_is_a_usage_error(line: str, capsys):
    try:
        code = said(line)
    except SystemExit as exit_:
        code = exit_.code
    assert code == ExitCode.USAGE


def test_links_and_joints_can_be_completed():
    words = kinematics.fk_choices(load_robot())
    assert "brazo_joint=" in words[""]
    assert "efector_link" in words["--links"]
