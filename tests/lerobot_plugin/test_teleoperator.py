"""The teleoperator of the plug-in: what a person or a program does, as the actions that LeRobot records."""

from __future__ import annotations

import math

import pytest

PERIOD = 1.0 / 30.0  # [s] of LeRobot's loop
BRAZO = "brazo_joint"


@pytest.fixture
def teleop(plugin, options, arm):
    teleop = plugin.GemeloTeleop(plugin.GemeloTeleopConfig(**options))
    teleop.connect()
    yield teleop
    teleop.disconnect()


@pytest.fixture
def robot(plugin, options, arm):
    """It sends nothing: something else moves the arm."""
    robot = plugin.Gemelo(plugin.GemeloConfig(**options, external_commands=True))
    robot.connect()
    yield robot
    robot.disconnect()


def recorded(arm, teleop, robot, frames):
    """As `lerobot-record` records them: [deg] of the state and of the action of the first joint."""
    found = []
    for _ in range(frames):
        observation, action = robot.get_observation(), teleop.get_action()
        robot.send_action(action)
        found.append((observation[f"{BRAZO}.pos"], action[f"{BRAZO}.pos"]))
        arm.sim.sleep(PERIOD)
    return found


def test_lerobot_finds_it_by_its_type_in_the_package_of_the_robot(plugin, options):
    from lerobot.registry import make_device_from_device_class
    from lerobot.teleoperators import TeleoperatorConfig

    config = TeleoperatorConfig.choices["gemelo"](**options)
    assert type(make_device_from_device_class(config)) is plugin.GemeloTeleop


def test_its_features_are_those_of_the_robot_and_need_no_connection(plugin, options):
    teleop = plugin.GemeloTeleop(plugin.GemeloTeleopConfig(**options))
    robot = plugin.Gemelo(plugin.GemeloConfig(**options))
    assert teleop.action_features == robot.action_features
    assert teleop.feedback_features == {}
    assert teleop.is_calibrated
    with pytest.raises(ConnectionError, match="connect"):
        teleop.get_action()


def test_a_planned_move_of_somebody_is_recorded_as_what_its_path_asks_for(arm, teleop, robot):
    with arm.sim.connect("person") as person:
        motion = person.start(joints={BRAZO: math.radians(20.0)})
        frames = recorded(arm, teleop, robot, 60)
        motion.wait()
    actions = [action for _, action in frames]
    assert actions[0] < 2.0
    assert actions[-1] == pytest.approx(20.0, abs=0.1)
    assert actions == sorted(actions)
    assert max(abs(state - action) for state, action in frames) < 1.5  # the path at the same instant, or 20 ms apart


def test_jogging_by_hand_is_recorded(arm, teleop, robot):
    with arm.sim.connect("person") as person:
        frames = []
        for _ in range(30):
            person.jog(joints={BRAZO: 0.2})
            frames += recorded(arm, teleop, robot, 1)
        person.end_jog()
    assert frames[-1][1] > 8.0
    assert [action for _, action in frames] == sorted(action for _, action in frames)
    assert all(state <= action + 0.1 for state, action in frames)  # the arm follows what is recorded


def test_streamed_targets_are_recorded_as_they_were_sent(arm, teleop, robot):
    sent, frames = [], []
    with arm.sim.connect("leader") as leader:
        for step in range(30):
            sent.append(0.3 * step)
            leader.stream({BRAZO: math.radians(sent[-1])})
            arm.sim.sleep(0.002)
            frames += recorded(arm, teleop, robot, 1)
    assert [action for _, action in frames] == pytest.approx(sent, abs=1e-6)


def test_an_arm_that_stands_is_an_action_to_stand_there(arm, teleop, robot):
    for state, action in recorded(arm, teleop, robot, 5):
        assert action == pytest.approx(state, abs=0.02)


def test_the_gripper_s_action_is_its_target(arm, teleop, robot):
    with arm.sim.connect("person") as person:
        person.grip(0.02)
        arm.sim.sleep(0.2)
    assert teleop.get_action()["gripper.pos"] == pytest.approx(40.0, abs=1.0)


def test_it_takes_no_control_and_disconnecting_twice_is_fine(arm, teleop):
    assert not arm.control.held
    teleop.disconnect()
    teleop.disconnect()
    assert not teleop.is_connected


def test_what_one_arm_does_another_follows(plugin, options, arm, teleop):
    """The leader's actions are those of the follower: here the arm is both."""
    follower = plugin.Gemelo(plugin.GemeloConfig(**options))
    follower.connect()
    before = arm.joints
    for _ in range(20):
        follower.get_observation()
        follower.send_action(teleop.get_action())
        arm.sim.sleep(PERIOD)
    follower.disconnect()
    assert arm.joints == pytest.approx(before, abs=0.002)
