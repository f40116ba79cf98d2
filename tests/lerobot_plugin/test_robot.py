"""The robot of the plug-in, on a simulated arm: features and units, connecting, following, ending."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest

import gemelo
from gemelo.libraries.lerobot.values import WrongValue

PERIOD = 1.0 / 30.0  # [s] of LeRobot's loop
DEGREE = math.radians(1.0)
BRAZO = "brazo_joint"
HALF_A_STEP = 0.008  # [rad] of the coarsest joint


@pytest.fixture
def robot(make, arm):
    """Connected, as LeRobot does it."""
    robot = make()
    robot.connect()
    return robot


def action_of(arm, joints):
    """[rad] or [m] by joint as LeRobot has them: degrees and millimetres."""
    scale = {joint.name: DEGREE if joint.unit == "rad" else 0.001 for joint in arm.description.joints}
    return {f"{name}.pos": value / scale[name] for name, value in joints.items()}


def at(arm, **changed):
    """The action of where the arm is, with some joints elsewhere [deg]."""
    return action_of(arm, arm.joints) | {f"{name}.pos": value for name, value in changed.items()}


def loop(arm, robot, actions):
    """LeRobot's: an observation and an action in each period."""
    sent = []
    for action in actions:
        robot.get_observation()
        sent.append(robot.send_action(action))
        arm.sim.sleep(PERIOD)
    return sent


def wait_for_rest(arm):
    assert arm.wait_for(lambda: max(map(abs, arm.velocities.values())) < 1e-3, 5.0)


def test_lerobot_finds_the_robot_by_its_type_and_the_name_of_its_configuration(plugin, options):
    from lerobot.registry import make_device_from_device_class
    from lerobot.robots import RobotConfig

    config = RobotConfig.choices["gemelo"](**options)
    assert config.type == "gemelo"
    assert type(make_device_from_device_class(config)) is plugin.Gemelo


def test_features_need_no_connection_and_name_joints_in_degrees_and_the_gripper_in_per_cent(make):
    robot = make()
    names = ["brazo_joint.pos", "antebrazo_joint.pos", "efector_joint.pos", "gripper.pos"]
    assert not robot.is_connected
    assert robot.action_features == robot.observation_features == dict.fromkeys(names, float)


def test_an_observation_has_its_features_in_their_units(robot, arm):
    robot.send_action(action_of(arm, {BRAZO: 0.35, "efector_joint": 0.04}))  # far away: the arm goes there by a plan
    found = robot.get_observation()
    assert list(found) == list(robot.observation_features)
    assert found["brazo_joint.pos"] == pytest.approx(math.degrees(0.35), abs=0.05)
    assert found["efector_joint.pos"] == pytest.approx(40.0, abs=0.2)  # a prismatic joint: millimetres
    assert found["gripper.pos"] == pytest.approx(100.0 * arm.gripper.position / 0.05)


def test_radians_where_they_are_asked_for(make, arm):
    robot = make(use_degrees=False)
    robot.connect()
    assert robot.get_observation()["brazo_joint.pos"] == pytest.approx(arm.joints[BRAZO])


def test_the_arm_follows_the_actions(robot, arm):
    start = arm.joints[BRAZO] / DEGREE
    loop(arm, robot, [at(arm, brazo_joint=start + 0.3 * min(step, 30)) for step in range(1, 50)])
    assert arm.joints[BRAZO] / DEGREE == pytest.approx(start + 9.0, abs=0.1)


def test_connecting_takes_control_and_moves_nothing_and_the_end_gives_it_back(make, arm):
    robot, before = make(), arm.joints
    robot.connect()
    assert arm.control.holder == "lerobot"
    assert arm.joints == before
    robot.disconnect()
    assert not arm.control.held
    robot.disconnect()
    assert not robot.is_connected
    with pytest.raises(ConnectionError, match="connect"):
        robot.send_action({})


def test_who_moves_the_arm_by_something_else_takes_no_control_and_sends_nothing(make, arm):
    robot, before = make(external_commands=True), arm.joints
    robot.connect()
    assert not arm.control.held
    action = at(arm, brazo_joint=20.0)
    assert robot.send_action(dict(action)) == action
    arm.sim.sleep(0.3)
    assert arm.joints == before


def test_an_arm_that_does_not_know_where_it_stands_is_not_homed_but_refused_with_the_command(make, arm):
    arm.device.disarm()
    arm.device.arm()
    robot = make()
    with pytest.raises(gemelo.Refused, match=r"lerobot-calibrate --robot\.type=gemelo"):
        robot.connect()
    assert not robot.is_connected
    assert not arm.control.held
    assert not any(arm.device.state.referenced)


def test_calibrating_homes_the_arm(make, arm):
    arm.device.disarm()
    arm.device.arm()
    robot = make()
    robot.connect(calibrate=False)
    assert not robot.is_calibrated
    robot.calibrate()
    assert robot.is_calibrated
    assert all(arm.device.state.referenced)


@pytest.mark.parametrize(
    ("break_it", "mend", "said"),
    [
        (lambda arm: arm.sim.press("estop"), lambda arm: (arm.sim.press("release"), arm.device.reset()), "stop"),
        (lambda arm: arm.device.disarm(), lambda arm: None, "gemelo device arm"),
    ],
)
def test_what_keeps_an_arm_from_following_is_said_at_once_with_its_remedy(make, arm, break_it, mend, said):
    break_it(arm)
    try:
        with pytest.raises(gemelo.Refused, match=said):
            make().connect()
    finally:
        mend(arm)


def test_a_target_beyond_a_limit_is_clipped_and_the_dictionary_says_so(robot, arm):
    upper = arm.description.joint(BRAZO).upper / DEGREE
    action = at(arm, brazo_joint=400.0)
    sent = robot.send_action(action)  # planned, as it is far
    assert sent["brazo_joint.pos"] == pytest.approx(upper)
    assert action["brazo_joint.pos"] == sent["brazo_joint.pos"]
    assert arm.joints[BRAZO] == pytest.approx(upper * DEGREE, abs=1e-3)


def test_numbers_of_other_kinds_are_taken_and_what_is_none_is_refused(robot, arm):
    action = {name: np.float32(value) for name, value in at(arm).items()}
    assert all(type(value) is float for value in robot.send_action(action).values())
    with pytest.raises(WrongValue) as caught:
        robot.send_action(at(arm, brazo_joint=math.nan))
    assert caught.value.reason.code == "lerobot.action.not_finite"
    with pytest.raises(WrongValue) as caught:
        robot.send_action({"codo.pos": 1.0})
    assert caught.value.reason.values["name"] == "codo.pos"


def test_the_first_target_is_planned_where_it_is_far_and_the_second_bounded(robot, arm):
    far = arm.states["ready"]
    action = action_of(arm, far)
    robot.send_action(dict(action))
    assert arm.joints == pytest.approx(far, abs=HALF_A_STEP)
    beyond = robot.send_action(action | {"brazo_joint.pos": action["brazo_joint.pos"] - 60.0})
    assert beyond["brazo_joint.pos"] == pytest.approx(action["brazo_joint.pos"] - 10.0, abs=0.1)


def test_a_far_first_target_is_refused_where_planning_is_switched_off(make, arm):
    robot, before = make(plan_first=False), arm.joints
    robot.connect()
    with pytest.raises(gemelo.Refused, match="plan_first=true") as caught:
        robot.send_action(at(arm, brazo_joint=before[BRAZO] / DEGREE + 40.0))
    assert caught.value.reason.code == "lerobot.far"
    assert caught.value.reason.values["distance"] == pytest.approx(40.0 * DEGREE)
    assert arm.joints == before


def test_bounds_by_joint_and_none(make, arm):
    robot = make(max_relative_target={BRAZO: 2.0}, plan_first=False, far=90.0)
    robot.connect()
    start = arm.joints[BRAZO] / DEGREE
    sent = robot.send_action(at(arm, brazo_joint=start + 8.0))
    assert sent["brazo_joint.pos"] == pytest.approx(start + 2.0, abs=0.01)
    for wrong, code in (({"codo": 1.0}, "lerobot.option.joint"), (0.0, "lerobot.option.above_zero")):
        with pytest.raises(WrongValue) as caught:
            make(max_relative_target=wrong)
        assert caught.value.reason.code == code


def test_a_target_in_a_box_of_the_scene_is_not_sent_where_the_guard_is_on_and_a_warning_says_why(make, arm, caplog):
    robot = make(guard=True)
    robot.connect()
    arm.scene.add_box("wall", (0.04, 0.04, 0.2), at=tool_at(arm, {BRAZO: 40.0 * DEGREE}))
    start = arm.joints[BRAZO] / DEGREE
    with caplog.at_level(logging.WARNING, "lerobot_robot_gemelo"):
        sent = loop(arm, robot, [at(arm, brazo_joint=start + 0.8 * step) for step in range(1, 60)])
    farthest = max(each["brazo_joint.pos"] for each in sent)
    assert 10.0 < farthest < 38.0
    arm.check(arm.joints)  # it stands where it may
    assert [record for record in caplog.records if "wall" in record.getMessage()]
    assert len(caplog.records) < 5  # one a second


def tool_at(arm, joints):
    return arm.fk(joints).position


def test_the_arm_stops_clear_of_a_box_in_the_way_of_its_targets_and_a_warning_says_why(robot, arm, caplog):
    """The gateway watches the stream; the actions are what was sent, and what the arm did is in the observations."""
    arm.scene.add_box("wall", (0.04, 0.04, 0.2), at=tool_at(arm, {BRAZO: 40.0 * DEGREE}))
    with caplog.at_level(logging.WARNING, "lerobot_robot_gemelo"):
        loop(arm, robot, [at(arm, brazo_joint=0.8 * min(step, 50)) for step in range(1, 90)])
    assert 10.0 * DEGREE < arm.joints[BRAZO] < 38.0 * DEGREE
    arm.check(arm.joints)  # it stands where it may
    assert [record for record in caplog.records if "wall" in record.getMessage()]
    assert len(caplog.records) < 6  # one a second


def test_the_gripper_follows_its_newest_target(robot, arm):
    loop(arm, robot, [at(arm) | {"gripper.pos": 100.0}] * 40)
    assert robot.get_observation()["gripper.pos"] == pytest.approx(100.0, abs=3.0)
    loop(arm, robot, [at(arm) | {"gripper.pos": value} for value in (80.0, 60.0, 40.0, 20.0, *[20.0] * 40)])
    assert robot.get_observation()["gripper.pos"] == pytest.approx(20.0, abs=3.0)


def test_a_gripper_never_keeps_the_loop_waiting(robot, arm):
    before = arm.sim.now
    loop(arm, robot, [at(arm) | {"gripper.pos": 100.0 * (step % 2)} for step in range(30)])
    assert arm.sim.now - before < 30 * PERIOD * 1.5


def test_an_emergency_stop_ends_the_loop_with_the_reason_and_disconnecting_still_works(make, arm):
    robot = make()
    robot.connect()
    start = arm.joints[BRAZO] / DEGREE
    loop(arm, robot, [at(arm, brazo_joint=start + 0.2 * step) for step in range(10)])
    arm.sim.press("estop")
    try:
        with pytest.raises(gemelo.Error):
            loop(arm, robot, [at(arm, brazo_joint=start + 2.0)] * 20)
        robot.disconnect()
        assert not arm.control.held
    finally:
        arm.sim.press("release")
        arm.device.reset()


def test_losing_control_ends_the_loop_with_the_name_of_who_has_it(make, arm):
    robot = make()
    robot.connect()
    with arm.sim.connect("other") as other:
        hold = other.take_control("ana", force=True)
        try:
            with pytest.raises(gemelo.Refused, match="ana"):
                loop(arm, robot, [at(arm)] * 5)
            robot.disconnect()
        finally:
            hold.give()


def test_disconnecting_stops_a_moving_arm_and_waits_for_its_rest(make, arm):
    robot = make()
    robot.connect()
    start = arm.joints[BRAZO] / DEGREE
    loop(arm, robot, [at(arm, brazo_joint=start + 1.0 * step) for step in range(20)])
    assert abs(arm.velocities[BRAZO]) > 0.1
    robot.disconnect()
    assert max(map(abs, arm.velocities.values())) < 2e-3


def test_a_second_session_right_after_the_first_is_not_refused(make, arm):
    for _ in range(2):
        robot = make()
        robot.connect()
        loop(arm, robot, [at(arm)] * 5)
        robot.disconnect()


def test_a_pause_between_two_episodes_brakes_the_arm_and_the_next_action_begins_anew(robot, arm):
    start = arm.joints[BRAZO] / DEGREE
    loop(arm, robot, [at(arm, brazo_joint=start + 0.5 * step) for step in range(10)])
    arm.sim.sleep(8.0)  # LeRobot writes its videos
    wait_for_rest(arm)
    action = at(arm, brazo_joint=arm.joints[BRAZO] / DEGREE + 25.0)
    robot.send_action(dict(action))
    assert arm.joints[BRAZO] / DEGREE == pytest.approx(action["brazo_joint.pos"], abs=0.1)


def test_the_rate_that_was_reached_is_said_at_the_end(make, arm, caplog):
    robot = make()
    robot.connect()
    loop(arm, robot, [at(arm)] * 15)
    with caplog.at_level(logging.INFO, "lerobot_robot_gemelo"):
        robot.disconnect()
    assert "actions a second" in caplog.text


def test_another_arm_than_that_of_the_files_is_refused_by_both_names(plugin, options, arm, monkeypatch):
    robot = plugin.Gemelo(plugin.GemeloConfig(**options | {"arm": "parol6"}))
    monkeypatch.setattr(gemelo, "connect", lambda *_, **__: arm.sim.connect("lerobot"))
    with pytest.raises(gemelo.Error) as caught:
        robot.connect()
    assert caught.value.reason.values == {"running": "rm1", "robot": "parol6"}
    assert not robot.is_connected


def test_a_gripper_of_which_nobody_knows_is_refused_unless_it_is_left_out(make, arm, monkeypatch):
    """As after a board's start, where no sensor measures the opening."""
    unknown = gemelo.topics.GRIPPER_STATE.message()
    monkeypatch.setattr(gemelo.Arm, "gripper", property(lambda _: unknown))
    with pytest.raises(gemelo.Refused, match="gemelo grip open"):
        make().connect()
    robot = make(gripper=False)
    robot.connect()
    assert "gripper.pos" not in robot.get_observation()
