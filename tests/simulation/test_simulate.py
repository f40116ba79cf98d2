"""`gemelo.simulate`: the same arm as that of `connect`, in one process and in virtual time."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import pytest

import gemelo
from gemelo.schemas.device import DeviceMode

STEP = 0.015  # [rad] of the coarsest joint of rm1


def test_a_planned_move_arrives_on_the_step(arm: gemelo.SimulatedArm) -> None:
    motion = arm.move(named="ready")
    assert motion.status is gemelo.GoalStatusCode.SUCCEEDED
    assert motion.result.executed_steps == motion.result.commanded_steps
    assert max(map(abs, arm.step_errors.values())) <= 0.5
    assert arm.joints == pytest.approx(arm.states["ready"], abs=STEP)


def test_an_unreferenced_arm_refuses_and_homes() -> None:
    with gemelo.simulate("rm1", start="unreferenced") as arm:
        with pytest.raises(gemelo.Refused, match="does not know where brazo_joint"):
            arm.move(named="ready")
        began = arm.sim.now
        report = arm.home()
        assert set(report.homed) == set(arm.joint_names)
        assert report.took == pytest.approx(arm.sim.now - began, abs=0.5)
        arm.move(named="ready")


@pytest.mark.parametrize("start", ["left", {"brazo_joint": 0.3}])
def test_it_starts_where_it_is_asked_to(start: str | dict[str, float]) -> None:
    with gemelo.simulate("rm1", start=start) as arm:
        values = arm.states[start] if isinstance(start, str) else start
        assert {name: arm.joints[name] for name in values} == pytest.approx(values, abs=STEP)
        arm.move(named="home")


def test_the_emergency_stop_ends_a_motion_and_a_person_leads_out(arm: gemelo.SimulatedArm) -> None:
    motion = arm.start(named="left")
    arm.sim.sleep(0.5)
    arm.sim.press("estop")
    with pytest.raises(gemelo.Aborted, match="emergency stop"):
        motion.wait()
    assert arm.device.mode is DeviceMode.ESTOP
    with pytest.raises(gemelo.Refused):
        arm.move(named="home")
    arm.sim.press("release")
    arm.device.reset()
    arm.device.arm()
    arm.sim.sleep(1.0)
    arm.home()
    arm.move(named="ready")


def test_a_stop_slows_the_arm_on_its_path(arm: gemelo.SimulatedArm) -> None:
    motion = arm.start(named="left")
    arm.sim.sleep(0.3)
    arm.stop()
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    assert 0.0 < abs(arm.joints["brazo_joint"]) < abs(arm.states["left"]["brazo_joint"])


def test_a_motor_that_loses_steps_is_found_out() -> None:
    with gemelo.simulate("rm1", motors={"brazo_joint": 0.1}) as arm:
        arm.move(named="left")
        arm.move(named="home")
        verified = arm.verify()
    assert verified.steps_off["brazo_joint"] != 0


def test_a_lossy_wire_is_only_slower() -> None:
    with gemelo.simulate("rm1", wire={"delay": 0.005, "jitter": 0.01, "loss": 0.02}) as arm:
        motion = arm.move(named="ready")
        assert motion.result.executed_steps == motion.result.commanded_steps


def test_two_arms_share_one_time() -> None:
    with gemelo.simulate("rm1", "parol6") as (first, second):
        motions = [first.start(named="left"), second.start(named="home")]
        for motion in motions:
            motion.wait()
        assert (first.name, second.name) == ("rm1", "parol6")
        assert first.sim.now == second.sim.now


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    threads = set(threading.enumerate())

    def broken_program() -> None:
        with gemelo.simulate("rm1") as arm:
            opened.append(arm)
            arm.start(named="ready")
            assert list(tmp_path.iterdir())
            raise ZeroDivisionError

    opened: list[gemelo.SimulatedArm] = []
    with pytest.raises(ZeroDivisionError):
        broken_program()
    assert not list(tmp_path.iterdir())
    assert set(threading.enumerate()) == threads
    with pytest.raises(gemelo.Lost, match="closed"):
        opened[0].joints  # noqa: B018


def test_time_passes_only_where_somebody_waits(arm: gemelo.SimulatedArm) -> None:
    now = arm.sim.now
    time.sleep(0.05)
    assert arm.sim.now == now
    arm.sim.sleep(2.5)
    assert arm.sim.now == pytest.approx(now + 2.5)


def test_a_loop_that_only_looks_comes_to_its_end(arm: gemelo.SimulatedArm) -> None:
    motion = arm.start(named="ready")
    seen = set()
    while not motion.is_over:
        seen.add(round(motion.progress, 2))
    assert len(seen) > 20
    assert motion.wait().status is gemelo.GoalStatusCode.SUCCEEDED


def test_time_can_be_real() -> None:
    with gemelo.simulate("rm1", time_scale=1.0) as arm:
        began, virtual = time.monotonic(), arm.sim.now
        arm.sim.sleep(0.5)
        assert time.monotonic() - began >= 0.5 - 0.01
        assert arm.sim.now - virtual == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"start": "leftt"}, 'start="leftt".*did you mean "left"'),
        ({"start": {"brazo_joint": 9.0}}, "brazo_joint.*beyond its limits"),
        ({"motors": {"brazo": 0.5}}, 'no joint "brazo"'),
        ({"wire": {"lose": 0.5}}, "wire=.*delay"),
        ({"time_scale": 0.0}, "time_scale=0.0"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(options: dict[str, object], reason: str) -> None:
    with pytest.raises(gemelo.BadArgument, match=reason):
        gemelo.simulate("rm1", **options)  # type: ignore[arg-type]


def test_a_part_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("gemelo.services.planner.main", "pinocchio"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(gemelo.Error, match=r'a simulated planner needs: pip install "gemelo\[planner\]"'):
        gemelo.simulate("rm1")
