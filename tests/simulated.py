"""A simulated twin, as scripts find it that call `gemelo.connect()` in the tests' process."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.topics import DEVICE_SHAFT
from gemelo.tools.cli import simulated
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

NUMBERS = itertools.count(2)
STANDS = 0.5  # [s] for which an arm that rests does not move


@contextmanager
def found_by_connect(arm: SimulatedArm) -> Iterator[None]:
    """`gemelo.connect()` gives another connection to this arm, and `gemelo.robots()` its name."""

    def connect(robot: object = "", *, name: str = "", **others: Any) -> gemelo.Arm:
        if robot and Path(str(robot)).name != arm.name:
            raise gemelo.Lost(f"no stepper_gateway of {robot} here; there is {arm.name}", (arm.name,))
        return arm.sim.connect(name or f"script-{next(NUMBERS)}")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gemelo, "connect", connect)
        patch.setattr(gemelo, "robots", lambda *_: (arm.name,))
        yield


def make_ready(arm: gemelo.Arm) -> None:
    """Does what a person would do after whatever a test has left, once the arm rests."""
    assert arm.wait_for(lambda: arm.device.mode is not gemelo.DeviceMode.RUN and not is_moving(arm), 20.0)
    put_right(arm)


def put_right(arm: gemelo.Arm) -> None:
    """Armed, referenced, at full speed, with an empty scene; what is so already is left alone."""
    if arm.device.mode is gemelo.DeviceMode.HOLD:
        arm.stop()
    if not arm.device.state.armed:
        arm.device.arm()
    if not all(arm.device.state.referenced):
        arm.reference(where_it_stands(arm))
    if arm.device.state.speed != 1.0:
        arm.speed(1.0)
    if arm.scene.present.objects or arm.scene.present.allowed:
        arm.scene.clear()


def where_it_stands(arm: gemelo.Arm) -> dict[str, float]:
    """A person looks at the arm before declaring: a virtual one says where its shafts are."""
    latest = arm.node.latest(DEVICE_SHAFT)
    assert arm.wait_for(lambda: latest.message is not None, 5.0)
    shaft, joint = latest.message, arm.description.joint
    assert shaft is not None
    return {name: joint(name).clamp(at) for name, at in zip(shaft.name, shaft.position, strict=True)}


def is_moving(arm: gemelo.Arm) -> bool:
    return any(abs(speed) > 1e-3 for speed in arm.velocities.values())


def rests(arm: SimulatedArm, timeout: float) -> bool:
    """True if it stands for half a second on end, from `timeout` [s] of its time on at the latest."""
    end, stood = arm.sim.now + timeout, arm.sim.now
    while arm.sim.now - stood < STANDS:
        arm.sim.sleep(0.02)
        if is_moving(arm):
            stood = arm.sim.now
        if stood > end:
            return False
    return True


class TypedAt:
    """The command line as it is typed at a simulated arm that outlives each command."""

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm

    def connect(self, robot: gemelo.Robot, name: str) -> gemelo.Arm:
        return self._arm.sim.connect(name)

    def node(self, robot: gemelo.Robot, name: str) -> Node:
        return self._arm.sim.node(name)

    def __call__(self, *words: str, code: ExitCode = ExitCode.OK) -> str:
        """Everything that the command has printed; it must end with `code`."""
        printed = io.StringIO()
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed), redirect_stderr(printed):
            patch.setattr(simulated, "chosen", lambda: self)
            ended = run(words)
        assert ended == code, f"{words} ended with {ended}:\n{printed.getvalue()}"
        return printed.getvalue()
