"""A shared stack is led back after each test: what was left is named and put right."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import gemelo
from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import gemelo as command
from tests.stacks.shared import SharedStacks


def test_what_a_test_leaves_behind_is_named_and_put_right(
    rm1_stack: Stack, arm: gemelo.Arm, shared_stacks: SharedStacks
) -> None:
    reset = shared_stacks.reset("rm1_stack")
    before = reset.before()
    program = Path(rm1_stack.deployment["GEMELO_PATHS_PROGRAMS"]) / "left.toml"
    program.write_text("version = 1\nsteps = []\n")
    command(rm1_stack, "param", "set", "stepper_gateway", "feedback_rate", "7.0")
    arm.scene.add_sphere("ball", radius=0.02, at=(0.0, 0.0, 0.9))
    arm.output("avanzar", True)
    arm.speed(0.5)
    arm.take_control("ana")
    arm.start(named="left", speed=0.05, detached=True)
    rm1_stack.kill("state_publisher", signal.SIGSTOP)
    with subprocess.Popen(["sleep", "300"]) as forgotten:
        left = reset.after(before)
        assert forgotten.wait(60.0) == -signal.SIGKILL
    for words in (
        "state_publisher is frozen", "still runs: sleep 300", "ana holds control", "the arm still moves",
        "outputs are on: avanzar", "stepper_gateway's parameter feedback_rate is 7.0",
    ):  # fmt: skip
        assert [sentence for sentence in left if words in sentence], (words, left)
    assert len(left) == 6, left
    assert not program.exists()
    assert arm.wait_for(lambda: arm.scene.objects == {}, 60.0)
    assert arm.wait_for(lambda: arm.device.state.speed == 1.0, 60.0)
    assert reset.after(reset.before()) == []
