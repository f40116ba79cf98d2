"""The parts of an `Arm` that wait or that others answer, against a simulated twin."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.runtime.bus.pace import OF_ALL_REQUESTS
from gemelo.programs import Points, ProgramRun, Programs, RunStatus
from gemelo.schemas.ledger import VerifiedBy

ROOT = Path(__file__).parents[2]


def test_lines_keep_their_speed(arm: gemelo.SimulatedArm) -> None:
    arm.move(position=(0.25, 0.15, 0.10))
    began = arm.sim.now
    arm.line(offset=(0.0, 0.0, -0.02), speed=0.02)
    assert arm.sim.now - began > 1.0
    assert arm.pose().position == pytest.approx((0.25, 0.15, 0.08), abs=0.002)


def test_a_jog_ends_with_its_last_word(arm: gemelo.SimulatedArm) -> None:
    arm.jog(joints={"brazo_joint": 0.2}, duration=0.5)
    moved = arm.joints["brazo_joint"]
    arm.sim.sleep(1.0)
    assert 0.05 < moved < 0.2
    assert arm.joints["brazo_joint"] == moved


def test_a_stream_is_followed(arm: gemelo.SimulatedArm) -> None:
    for tenth in range(1, 11):
        arm.stream({"brazo_joint": 0.02 * tenth})
        arm.sim.sleep(0.1)
    arm.sim.sleep(1.0)
    assert arm.joints["brazo_joint"] == pytest.approx(0.2, abs=0.01)


def test_what_is_in_the_way_is_named(arm: gemelo.SimulatedArm) -> None:
    arm.move(named="ready")
    x, y, z = arm.pose().position
    arm.scene.add_box("crate", (0.1, 0.1, 0.1), at=(x, y, z))
    with pytest.raises(gemelo.Refused, match="crate"):
        arm.move(named="left")


def test_control_is_for_one(arm: gemelo.SimulatedArm) -> None:
    with arm.sim.connect("other") as other:
        other.control.shares = False
        with arm.take_control("ana"), pytest.raises(gemelo.Refused, match="ana holds control"):
            other.move(named="left")
        other.move(named="left")


def test_a_connection_that_closes_stops_its_motion(arm: gemelo.SimulatedArm) -> None:
    with arm.sim.connect("other") as other:
        motion = other.start(named="left")
        arm.sim.sleep(0.5)
    assert motion.status is gemelo.GoalStatusCode.CANCELED


def test_a_cut_wire_holds_the_arm_and_says_so(arm: gemelo.SimulatedArm) -> None:
    motion = arm.start(named="left")
    arm.sim.sleep(0.5)
    arm.sim.cut_wire()
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    arm.sim.restore_wire()
    arm.sim.sleep(2.0)
    arm.move(named="home")


def test_the_ledger_says_what_was_verified(arm: gemelo.SimulatedArm) -> None:
    arm.home()
    assert {page.verified_by for page in arm.ledger.joints.values()} == {VerifiedBy.HOMING}


def test_a_gripper_holds_what_is_between_its_jaws(arm: gemelo.SimulatedArm) -> None:
    arm.move(named="ready")
    arm.grip("open")
    at, orientation = arm.pose()
    arm.scene.add_box("part", (0.02, 0.02, 0.02), at=at, orientation=orientation)
    gripped = arm.grip("close")
    assert (gripped.stalled, gripped.held) == (True, "part")
    assert gripped.position == pytest.approx(0.02, abs=0.001)


def test_cameras_see_the_cell() -> None:
    with gemelo.simulate("rm1", cell=ROOT / "urdf/rm1/cell.toml") as arm:
        seen = {each.name: each for each in arm.detect()}
    assert seen["cup"].pose.position == pytest.approx((0.26, 0.16, 0.04), abs=0.002)


def test_a_program_runs_pauses_and_goes_on(arm: gemelo.SimulatedArm) -> None:
    run = program_run(arm)
    run.start()
    arm.sim.sleep(1.0)
    run.pause()
    assert run.wait(timeout=60.0).status is RunStatus.PAUSED
    run.resume()
    assert run.wait(timeout=120.0).status is RunStatus.DONE


def test_a_program_takes_the_same_time_again() -> None:
    took = []
    for _ in range(2):
        with gemelo.simulate("rm1") as arm:
            run = program_run(arm)
            run.start()
            assert run.wait().status is RunStatus.DONE
            took.append(arm.sim.now)
    assert took[0] == took[1]


def test_what_asks_in_a_loop_is_slowed_down_and_gets_all_its_answers(arm: gemelo.SimulatedArm) -> None:
    """As on a real bus: of a client without a pace the server would drop what is above its limit."""
    began = arm.sim.now
    for _ in range(700):
        arm.fk({"brazo_joint": 0.1})
    assert arm.sim.now - began == pytest.approx((700 - OF_ALL_REQUESTS.burst) / OF_ALL_REQUESTS.per_second, abs=0.1)


def test_threads_take_turns(arm: gemelo.SimulatedArm) -> None:
    ended = []

    def move() -> None:
        arm.move(named="left")
        ended.append(arm.sim.now)

    thread = threading.Thread(target=move)
    thread.start()
    arm.sim.sleep(0.5)
    arm.wait_for(lambda: bool(ended), 30.0)
    thread.join(60.0)
    assert not thread.is_alive()
    assert ended


def test_ctrl_c_slows_the_arm_and_nothing_else(arm: gemelo.SimulatedArm) -> None:
    pressed: list[bool] = []

    def press_once(_motion: gemelo.Motion) -> None:
        if not pressed:
            pressed.append(True)
            os.kill(os.getpid(), signal.SIGINT)

    motion = arm.start(named="left")
    with pytest.raises(gemelo.Interrupted, match="stopped by Ctrl-C"):
        motion.wait(on_progress=press_once)
    assert motion.status is gemelo.GoalStatusCode.CANCELED
    arm.move(named="home")


def program_run(arm: gemelo.SimulatedArm) -> ProgramRun:
    """The tour that stands beside rm1."""
    programs = Programs(Path(arm.deployment.paths.programs))
    return ProgramRun(arm, programs["tour"], Points.load(programs.folder, arm.description), programs)
