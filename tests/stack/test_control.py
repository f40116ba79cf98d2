"""Control of the arm on a whole stack: two people, one arm, and a holder that is killed in the middle of a move."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import gemelo
from gemelo.schemas.control import ControlState
from gemelo.schemas.joints import JointState
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.stack.stack import Stack
from tests.stack.person import jumps
from tests.stack.scripts import said, script

LONGEST = 30.0  # [s] of one command
AT_REST = 1e-3  # [rad/s] or [m/s]
HOLDS_AND_MOVES = """
    import time, gemelo
    arm = gemelo.connect()
    hold = arm.take_control("ana")
    motion = arm.start(joints={{"brazo_joint": {goal}}}, speed=0.3)
    while motion.progress < 0.2:
        time.sleep(0.01)
    print("moving", flush=True)
    motion.wait()
"""


@pytest.fixture
def ben(stack: Stack, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[gemelo.Arm]:
    """Another person, on another host as far as files go."""
    stack.wait_ready(120.0)
    for name, value in stack.deployment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "ben"))
    with gemelo.connect(timeout=60.0, name="ben-1") as arm:
        if not arm.device.state.armed:
            arm.device.arm()
        if not all(arm.device.state.referenced):
            arm.reference()
        yield arm


def ana(stack: Stack, home: Path) -> dict[str, str]:
    return {**stack.environment, "XDG_STATE_HOME": str(home / "ana")}


def command(stack: Stack, home: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(stack.root / ".venv/bin/gemelo"), *words], cwd=stack.root, env=ana(stack, home), text=True,
        stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST, check=False,
    )  # fmt: skip


@contextmanager
def taking(stack: Stack, home: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """`gemelo control take` in ana's terminal, from its first line on; ended at the latest with the block."""
    process = subprocess.Popen(
        [str(stack.root / ".venv/bin/gemelo"), "control", "take", "--as", "ana", *more],
        cwd=stack.root, env=ana(stack, home), text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        if not more:
            assert said(process).startswith("ana holds control of rm1 since ")
        yield process
    finally:
        process.kill()
        process.communicate()


def far(arm: gemelo.Arm) -> float:
    return -1.2 if arm.joints["brazo_joint"] > 0.0 else 1.2


def test_a_second_client_is_refused_by_name_and_takes_when_the_first_is_killed_in_a_move_and_the_arm_rests(
    stack: Stack, ben: gemelo.Arm
) -> None:
    seen: list[JointState] = []
    stood_at_loss: list[bool] = []

    def on_control(state: ControlState) -> None:
        if not state.held and seen:
            stood_at_loss.append(all(abs(speed) < AT_REST for speed in seen[-1].velocity))

    goal = far(ben)
    with script(stack, HOLDS_AND_MOVES.format(goal=goal)) as process:
        assert said(process) == "moving"
        ben.node.subscribe(gemelo.topics.JOINT_STATES, seen.append)
        ben.node.subscribe(gemelo.topics.CONTROL, on_control)
        assert ben.control.holder == "ana"
        with pytest.raises(gemelo.Refused) as refused:
            ben.start(joints={"brazo_joint": 0.0})
        assert refused.value.check == "control"
        assert "ana holds control of rm1, since " in str(refused.value.reason)
        assert "run `gemelo control take --force`" in str(refused.value.reason)
        with pytest.raises(gemelo.Refused, match="ana holds control"):
            ben.jog(joints={"brazo_joint": 0.1}, duration=0.5)
        with pytest.raises(gemelo.Refused, match="ana holds control"):
            ben.speed(0.1)
        with pytest.raises(gemelo.Refused, match="ana holds control"):
            ben.take_control("ben")
        assert max(abs(speed) for speed in seen[-1].velocity) > AT_REST, "ana's motion was disturbed"
        process.kill()
        process.wait()
        assert ben.wait_for(lambda: bool(stood_at_loss), GatewayParameters().control_grace + 5.0)
    assert stood_at_loss == [True]
    assert abs(ben.joints["brazo_joint"] - goal) > 0.1, "the move was finished"
    with ben.take_control("ben"):
        assert ben.move(joints={"brazo_joint": 0.0}).status is gemelo.GoalStatusCode.SUCCEEDED
    assert not jumps(ben.description, seen)
    assert "ana (node " in stack.logs("stepper_gateway")
    assert "has lost it, gone for" in stack.logs("stepper_gateway")


def test_what_a_person_types_shares_the_terminal_that_holds_control(
    stack: Stack, ben: gemelo.Arm, tmp_path: Path
) -> None:
    with taking(stack, tmp_path) as holder:
        told = command(stack, tmp_path, "control", "who")
        assert told.stdout.startswith("ana holds control of rm1 since ")
        moved = command(stack, tmp_path, "move", "--joints", f"brazo_joint={far(ben)}rad")
        assert moved.returncode == 0, moved.stderr
        with pytest.raises(gemelo.Refused, match="ana holds control"):
            ben.move(joints={"brazo_joint": 0.0})
        given = command(stack, tmp_path, "control", "give")
        assert given.stdout == "nobody holds control of rm1: everybody may move it\n", given.stderr
        assert holder.wait(60.0) == 0
    assert ben.move(joints={"brazo_joint": 0.0}).status is gemelo.GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda each: each.name)
def test_ctrl_c_and_a_closed_terminal_give_control_back_at_once(
    stack: Stack, ben: gemelo.Arm, tmp_path: Path, number: signal.Signals
) -> None:
    with taking(stack, tmp_path) as holder:
        assert ben.wait_for(lambda: ben.control.held, 60.0)
        holder.send_signal(number)
        assert holder.wait(60.0) == 0
    assert ben.wait_for(lambda: ben.control.state.given, 60.0)
    assert not list((tmp_path / "ana").rglob("*.json"))


def test_a_command_after_the_dashes_runs_under_control_and_its_exit_code_counts(
    stack: Stack, ben: gemelo.Arm, tmp_path: Path
) -> None:
    with taking(
        stack,
        tmp_path,
        "--",
        "sh",
        "-c",
        "$GEMELO control who; exit 7".replace("$GEMELO", str(stack.root / ".venv/bin/gemelo")),
    ) as process:
        output, errors = process.communicate(timeout=LONGEST)
    assert output.startswith("ana holds control of rm1 since ")
    assert "sh has ended with exit code 7" in errors
    assert process.returncode == 1
    assert ben.wait_for(lambda: not ben.control.held, 60.0)


def test_a_terminal_from_which_control_was_forced_says_who_has_it(
    stack: Stack, ben: gemelo.Arm, tmp_path: Path
) -> None:
    with taking(stack, tmp_path) as holder:
        moved = command(stack, tmp_path, "move", "--joints", f"brazo_joint={far(ben)}rad")
        assert moved.returncode == 0, moved.stderr
        ben.take_control("ben", force=True)
        _, errors = holder.communicate(timeout=60.0)
        assert holder.returncode == 1
        assert "control is lost: ben holds control of rm1" in errors
        told = command(stack, tmp_path, "output", "avanzar", "on")
        assert told.returncode == 1
        assert "ben holds control of rm1" in told.stderr
        assert command(stack, tmp_path, "stop").returncode == 0
    ben.control.give()


def test_a_frozen_terminal_loses_control_and_says_so_when_it_wakes(
    stack: Stack, ben: gemelo.Arm, tmp_path: Path
) -> None:
    with taking(stack, tmp_path) as holder:
        holder.send_signal(signal.SIGSTOP)
        frozen = time.monotonic()
        assert ben.wait_for(lambda: not ben.control.held, GatewayParameters().control_grace + 10.0)
        assert time.monotonic() - frozen >= GatewayParameters().control_grace
        ben.take_control("ben")
        holder.send_signal(signal.SIGCONT)
        _, errors = holder.communicate(timeout=20.0)
        assert holder.returncode == 1
        assert "control is lost: ben holds control of rm1" in errors
    assert ben.control.is_mine
    ben.control.give()
