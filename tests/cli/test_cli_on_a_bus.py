"""The commands that speak with a stack, on a bus in memory."""

import json
import os
import signal
import threading

import pytest
import yaml

import gemelo
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import (
    DeviceCommandRequest,
    DeviceMode,
    DeviceStopRequest,
    ResetCommand,
    ResumeCommand,
    StopKind,
)
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, NamedGoal, PlanRequest, PoseGoal
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import JOINT_STATES, JOINT_TARGETS
from gemelo.tools.cli.bus import action, node, topic, topic_rates
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.bus.messages import message_of
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.forms import yaml_document
from gemelo.tools.cli.common.terminal import Interrupt
from gemelo.tools.cli.device import device
from gemelo.tools.cli.motion.move import move
from gemelo.tools.cli.watch import state

READY = PlanRequest(goal=NamedGoal(name="ready"))


@pytest.fixture
def stack(gateway, planner):
    return gateway


def test_a_move_says_how_exactly_the_arm_arrived(connected, stack, capsys):
    assert move(connected, READY, plan_only=False, as_json=False) is ExitCode.OK
    *progress, last = capsys.readouterr().out.splitlines()
    assert all(line.startswith("moving: ") for line in progress)
    assert last.startswith("planned in ")
    assert "took 0.40 s, final error " in last
    assert last.endswith(" mm, steps: brazo_joint +0.25, antebrazo_joint -0.50, efector_joint +0.00")


def test_a_move_as_json_is_one_object(connected, stack, capsys):
    assert move(connected, READY, plan_only=False, as_json=True) is ExitCode.OK
    report = json.loads(capsys.readouterr().out)
    assert report["succeeded"] is True
    assert report["final_error_m"] > 0.0


def test_plan_only_moves_nothing(connected, stack, capsys):
    assert move(connected, READY, plan_only=True, as_json=False) is ExitCode.OK
    assert "would take" in capsys.readouterr().out


def test_a_goal_out_of_reach_is_refused_with_one_that_can_be_typed(connected, stack):
    with pytest.raises(CommandError, match=r"out of reach.*nearest that can: --to [-\d. ]+$") as refused:
        move(connected, PlanRequest(goal=PoseGoal(position=(2.0, 0.0, 0.1))), plan_only=False, as_json=False)
    assert refused.value.code is ExitCode.FAILED


def test_a_joint_beyond_its_limit_is_refused_with_the_nearest_value(connected, stack):
    goal = JointGoal(name=("brazo_joint",), position=(4.0,))
    with pytest.raises(CommandError, match=r"nearest that can: --joints brazo_joint=169\.\d+deg"):
        move(connected, PlanRequest(goal=goal), plan_only=False, as_json=False)


def test_a_gateway_that_refuses_is_quoted(connected, stack):
    stack.refusal = 'device "rm1" has fault 1'
    with pytest.raises(CommandError, match='refused by stepper_gateway: device "rm1" has fault 1'):
        move(connected, READY, plan_only=False, as_json=False)


def test_an_abort_says_why_and_where(connected, stack, capsys):
    stack.ends_as, stack.reason = GoalStatusCode.ABORTED, "the boot id changed"
    assert move(connected, READY, plan_only=False, as_json=False) is ExitCode.FAILED
    assert "aborted after 0.40 s: the boot id changed; now at brazo_joint 17." in capsys.readouterr().out


def test_ctrl_c_cancels_and_says_where_the_arm_stopped(connected, stack, capsys):
    threading.Timer(0.15, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    assert move(connected, READY, plan_only=False, as_json=False) is ExitCode.CANCELLED
    text = capsys.readouterr().out
    assert "cancelling: the arm slows down" in text
    assert "stopped at brazo_joint 17.998 deg, antebrazo_joint -45.000 deg, efector_joint 39." in text


def test_a_second_ctrl_c_leaves():
    interrupt = Interrupt()
    interrupt.press()
    with pytest.raises(KeyboardInterrupt):
        interrupt.press()


def test_without_a_planner_the_stack_is_not_there(connected):
    with pytest.raises(gemelo.Lost, match="planner"):
        move(connected, READY, plan_only=False, as_json=False)


def test_the_state_shows_joints_steps_device_and_link(session, stack, capsys):
    assert state.state(session, watch=False, as_json=False) is ExitCode.OK
    text = capsys.readouterr().out
    assert "brazo_joint        28.648  deg" in text
    assert "efector_joint      40.000  mm" in text
    assert "device rm1: IDLE, time scale 1.00" in text
    assert "link   online, round trip 2.0 ms" in text
    assert "[steps]" in text


def test_the_state_as_json_is_si(session, stack, capsys):
    assert state.state(session, watch=False, as_json=True) is ExitCode.OK
    shown = json.loads(capsys.readouterr().out)
    assert [joint["position"] for joint in shown["joints"]] == [0.5, 0.25, 0.04]
    assert shown["mode"] == "IDLE"


def test_nothing_heard_of_the_arm_is_no_stack(session, monkeypatch):
    monkeypatch.setattr(state, "PATIENCE", 0.1)
    with pytest.raises(CommandError, match="stepper_gateway") as error:
        state.state(session, watch=False, as_json=False)
    assert error.value.code is ExitCode.NO_STACK


def test_echo_prints_yaml_documents(session, stack, capsys):
    assert topic.echo(session, JOINT_STATES, FieldPath(JointState, ""), yaml_document, 3) is ExitCode.OK
    *documents, rest = capsys.readouterr().out.split("---\n")
    assert len(documents) == 3
    assert rest == ""
    assert yaml.safe_load(documents[0])["position"] == [0.5, 0.25, 0.04]


def test_hz_measures_the_rate(session, stack, capsys):
    assert topic_rates.hz(session, JOINT_STATES, 1000, 1) is ExitCode.OK
    words = capsys.readouterr().out.split()
    assert words[:2] == ["average", "rate:"]
    assert 25.0 < float(words[2]) < 100.0


def test_hz_of_silence_says_so(session, capsys):
    assert topic_rates.hz(session, JOINT_STATES, 1000, 1) is ExitCode.OK
    assert capsys.readouterr().out == "no new messages on joint_states\n"


def test_only_the_writer_of_a_topic_may_publish_on_it(session):
    with pytest.raises(CommandError, match="only stepper_gateway writes joint_states"):
        topic.publish(session, JOINT_STATES, JOINT_STATES.message(), None, 1)


def test_pub_stamps_what_has_no_stamp(session, network, deployment, capsys):
    from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
    from gemelo.libraries.runtime.node import Node

    heard = []
    with Node("listener", deployment, robot="rm1", bus=MemoryBus(network)) as listener:
        listener.subscribe(JOINT_TARGETS, heard.append)
        message = JOINT_TARGETS.message(name=("brazo_joint",), position=(0.1,))
        assert topic.publish(session, JOINT_TARGETS, message, 50.0, 2) is ExitCode.OK
        listener.wait(0.1)
    assert [each.position for each in heard][-1] == (0.1,)
    assert heard[-1].stamp > 0
    assert "published 2 x JointTargets" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "request_"),
    [
        ("hold", DeviceStopRequest(kind=StopKind.HOLD)),
        ("resume", DeviceCommandRequest(command=ResumeCommand())),
        ("stop", DeviceStopRequest()),
        ("reset", DeviceCommandRequest(command=ResetCommand())),
    ],
)
def test_a_device_command_is_done_or_refused_in_the_devices_words(connected, stack, kind, request_, capsys):
    assert device.command(connected, kind) is ExitCode.OK
    assert stack.commands[-1] == request_
    stack.mode = DeviceMode.RUN
    with pytest.raises(CommandError, match=r"refused: the arm moves \(device mode RUN\)"):
        device.command(connected, kind)


def test_a_refusal_that_names_the_mode_is_not_followed_by_it(connected, stack):
    stack.mode = DeviceMode.RUN
    stack.command_refusal = because("command.refused.unexplained", command="RESUME", mode="RUN", answer="WRONG_STATE")
    with pytest.raises(CommandError, match=r"^resume refused: the device refuses RESUME in mode RUN: [^()]*$"):
        device.command(connected, "resume")


def test_a_reference_says_where_the_joints_are_now(connected, stack, capsys):
    assert device.reference(connected, ["q3=40mm"]) is ExitCode.OK
    assert "efector_joint is at 40.000 mm" in capsys.readouterr().out


def test_nodes_are_listed_without_the_command_itself(session, stack):
    assert node.living(session) == ["planner", "stepper_gateway"]
    assert "stepper_gateway  rm1" in node.listing(node.standings(session))
    assert "follow_joint_trajectory" in node.information_of(session, "stepper_gateway").actions


def test_an_unknown_node_is_answered_with_the_nearest(session, stack):
    with pytest.raises(CommandError, match='did you mean "planner"'):
        node.information_of(session, "planer")


def test_a_goal_can_be_sent_without_a_planner(session, gateway, capsys):
    row = action.action_of("follow_joint_trajectory")
    goal = message_of(row.goal, '{"trajectory": {"joint_names": ["brazo_joint"]}}')
    assert action.send_goal(session, row, goal, with_feedback=True) is ExitCode.OK
    text = capsys.readouterr().out
    assert text.startswith("accepted: goal ")
    assert "feedback:\n  stamp: 0" in text
    assert "result: SUCCEEDED\n  error_code: 0  # SUCCESSFUL" in text


def test_what_becomes_of_a_goal_is_said_as_json(session, gateway, capsys):
    row = action.action_of("follow_joint_trajectory")
    goal = message_of(row.goal, '{"trajectory": {"joint_names": ["brazo_joint"]}}')
    assert action.send_goal(session, row, goal, with_feedback=True, as_json=True) is ExitCode.OK
    accepted, *feedback, ended = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert len(accepted["accepted"]) > 8
    assert {each["feedback"]["stamp"] for each in feedback} == {0}
    assert ended["status"] == "SUCCEEDED"
    assert ended["result"]["error_code"] == 0
