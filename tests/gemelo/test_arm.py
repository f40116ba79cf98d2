"""The API on a simulated arm: fresh states, ends of motions, losses, and the threads that may call it."""

from __future__ import annotations

import itertools

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.schemas.device import HomeCommand
from gemelo.schemas.planning import PlanProgress
from tests.simulated import is_moving


def test_what_is_asked_right_after_a_motion_is_where_it_ended(arm: SimulatedArm) -> None:
    for goal in (0.2, -0.2, 0.3):
        motion = arm.move(joints={"brazo_joint": goal})
        assert arm.joints == pytest.approx(motion.stopped_at, abs=1e-9)
        assert arm.velocities["brazo_joint"] == 0.0
        assert arm.pose().position == pytest.approx(arm.fk(motion.stopped_at).position, abs=1e-6)


def test_a_plan_is_executed_as_it_is_and_only_from_where_it_begins(arm: SimulatedArm) -> None:
    arm.move(named="home")
    plan = arm.plan(named="left")
    back = arm.plan(named="home", from_joints=plan.end)
    motion = arm.execute(plan)
    assert motion.plan is plan
    for name, at in motion.stopped_at.items():
        assert at == pytest.approx(plan.end[name], abs=0.501 / arm.description.joint(name).steps.per_unit)
    arm.execute(back)
    with pytest.raises(gemelo.Refused, match="refused by stepper_gateway") as refused:
        arm.execute(back)
    assert refused.value.code < 0


def test_a_motion_tells_how_far_it_is_while_it_goes(arm: SimulatedArm) -> None:
    arm.move(named="home")
    shares: list[float] = []
    motion = arm.move(named="left", on_progress=lambda motion: shares.append(motion.progress))
    assert len(shares) >= 5
    assert all(a <= b for a, b in itertools.pairwise(shares))
    assert 0.0 <= shares[0] < shares[-1] <= 1.0
    assert motion.progress == 1.0


def test_planning_tells_how_it_stands(arm: SimulatedArm) -> None:
    arm.move(named="home")
    arm.scene.add_box("post", size=(0.04, 0.04, 0.16), at=(0.29, 0.27, 0.08))
    heard: list[PlanProgress] = []
    plan = arm.plan(named="left", on_progress=heard.append)
    assert plan.planner != "straight"
    assert all(progress.allowed == 5.0 for progress in heard)


def test_the_same_seed_gives_the_same_plan(arm: SimulatedArm) -> None:
    arm.move(named="home")
    arm.scene.add_box("post", size=(0.04, 0.04, 0.16), at=(0.29, 0.27, 0.08))
    assert arm.plan(named="left", seed=7).trajectory == arm.plan(named="left", seed=7).trajectory


def test_a_wait_that_times_out_leaves_the_motion_going(arm: SimulatedArm) -> None:
    arm.move(named="home")
    motion = arm.start(named="left", speed=0.3)
    with pytest.raises(TimeoutError, match="it goes on"):
        motion.wait(timeout=0.2)
    assert not motion.is_over
    motion.cancel()
    assert motion.wait().status is gemelo.GoalStatusCode.CANCELED
    assert 0.0 < motion.progress < 1.0


def test_a_newer_motion_takes_over_and_the_older_one_says_so(arm: SimulatedArm) -> None:
    arm.move(named="home")
    first = arm.start(arm.plan(joints={"brazo_joint": 1.0}, speed=0.3))
    with gemelo.connect() as other:
        other.device.command(gemelo.StopKind.STOP)
    with pytest.raises(gemelo.Aborted, match="stopped by a device command") as aborted:
        first.wait()
    assert aborted.value.status is gemelo.GoalStatusCode.ABORTED
    assert aborted.value.stopped_at == pytest.approx(arm.joints, abs=1e-9)


def test_a_motion_that_another_script_cancels_is_canceled(arm: SimulatedArm) -> None:
    arm.move(named="home")
    motion = arm.start(named="left", speed=0.3)
    with gemelo.connect() as other:
        other.node.action(gemelo.topics.FOLLOW_JOINT_TRAJECTORY).cancel_all()
    with pytest.raises(gemelo.Canceled, match="decelerated on its path"):
        motion.wait()


def test_an_emergency_stop_aborts_with_the_reason_and_the_remedy_works(arm: SimulatedArm) -> None:
    arm.move(named="home")
    motion = arm.start(named="left", speed=0.3)
    arm.device.inject("estop")
    with pytest.raises(gemelo.Aborted, match=r"(?i)estop|emergency"):
        motion.wait()
    assert "gemelo reset" in arm.device.fault
    with pytest.raises(gemelo.Refused):
        arm.move(named="home")
    arm.device.inject("estop", value=0)
    arm.device.reset()
    assert arm.device.fault == ""


def test_a_hand_that_holds_the_arm_up_does_not_end_the_motion(arm: SimulatedArm) -> None:
    arm.move(named="home")
    motion = arm.start(named="left")
    arm.hold()
    assert arm.device.mode in (gemelo.DeviceMode.HOLD, gemelo.DeviceMode.RUN)
    arm.speed(0.5)
    arm.resume()
    assert motion.wait().status is gemelo.GoalStatusCode.SUCCEEDED


def test_a_jog_into_a_limit_says_which(arm: SimulatedArm) -> None:
    joint = arm.description.joints[0]
    arm.move(joints={joint.name: joint.upper - 0.05})
    limits: set[str] = set()
    arm.jog(
        joints={joint.name: joint.velocity},
        duration=1.5,
        on_progress=lambda status: limits.update(f"{limit.check} {limit.subject}" for limit in status.limits),
    )
    assert f"joint limit {joint.name}" in limits
    assert joint.upper - 0.05 < arm.joints[joint.name] <= joint.upper


def test_streamed_targets_are_followed_and_a_refused_one_is_raised(arm: SimulatedArm) -> None:
    arm.move(named="home")
    end = arm.sim.now + 10.0
    while abs(arm.joints["brazo_joint"] - 0.1) > 0.005:
        assert arm.sim.now < end
        arm.stream({"brazo_joint": 0.1})
    with pytest.raises(gemelo.BadArgument, match=r"beyond its limits.*nearest that can"):
        arm.stream({"brazo_joint": 3.5})
    assert arm.wait_for(lambda: not is_moving(arm), 10.0)
    motion = arm.start(named="left", speed=0.3)
    with pytest.raises(gemelo.Refused, match="goal"):
        stream_until_it_is_over(arm, motion)
    motion.wait()


def test_a_chunk_of_actions_is_played_and_its_velocity_may_be_given(arm: SimulatedArm) -> None:
    arm.move(named="home")
    at = arm.joints["brazo_joint"]
    chunk = [{"brazo_joint": at + 0.01 * step} for step in range(21)]
    arm.stream(chunk[0], {"brazo_joint": 0.2}, ahead=chunk[1:], period=0.05)
    assert arm.wait_for(lambda: is_moving(arm), 1.0)
    assert arm.wait_for(lambda: abs(arm.joints["brazo_joint"] - at - 0.2) < 0.001 and not is_moving(arm), 3.0)


def test_a_plan_waits_for_an_arm_that_is_just_coming_to_rest_but_not_for_one_that_goes_on(arm: SimulatedArm) -> None:
    arm.move(named="home")
    end = arm.sim.now + 10.0
    while arm.joints["brazo_joint"] < 0.1 or not is_moving(arm):
        assert arm.sim.now < end
        arm.stream({"brazo_joint": 0.6})
    assert arm.move(named="home").status.name == "SUCCEEDED"
    motion = arm.start(named="left", speed=0.1)
    while motion.progress < 0.05:
        assert not motion.is_over, motion
    with pytest.raises(gemelo.Refused, match="moving start"):
        arm.plan(named="home")
    arm.stop()


def stream_until_it_is_over(arm: SimulatedArm, motion: gemelo.Motion) -> None:
    while not motion.is_over:
        arm.stream({"brazo_joint": 0.2})
        arm.sim.sleep(0.02)


def test_two_connections_of_one_script_do_not_disturb_one_another(arm: SimulatedArm) -> None:
    with gemelo.connect() as second:
        assert second.node.name != arm.node.name
        second.move(named="home")
        assert arm.joints == pytest.approx(second.joints, abs=1e-9)
    with pytest.raises(gemelo.Lost, match="is closed"):
        _ = second.joints
    assert arm.device.status.online


def test_waiting_in_a_handler_is_refused_instead_of_hanging(arm: SimulatedArm) -> None:
    said: list[str] = []

    def handler(message: object) -> None:
        try:
            arm.move(named="home")
        except gemelo.Error as error:
            said.append(str(error))

    arm.node.subscribe(gemelo.topics.JOINT_STATES, handler)
    assert arm.wait_for(lambda: bool(said), 5.0)
    assert "cannot be called where messages are handled" in said[0]


def test_ctrl_c_while_the_answer_to_a_homing_is_on_its_way_stops_it(
    arm: SimulatedArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = type(arm.device).command

    def interrupted(device: gemelo.Device, wanted: object, what: str = "") -> object:
        answer = command(device, wanted, what)  # type: ignore[arg-type]
        if isinstance(wanted, HomeCommand):
            raise KeyboardInterrupt
        return answer

    monkeypatch.setattr(type(arm.device), "command", interrupted)
    with pytest.raises(gemelo.Interrupted) as stopped:
        arm.home("efector_joint")
    assert stopped.value.homing is not None
    assert stopped.value.homing.homed == ()
    assert "stopped" in stopped.value.homing.reason
    assert arm.device.mode is gemelo.DeviceMode.UNREFERENCED
