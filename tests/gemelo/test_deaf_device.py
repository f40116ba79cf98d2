"""Commands and goals of a person while the device speaks and does not hear: each ends in seconds, with the reason."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import gemelo
from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config, reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.errors import GoalRefused
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.schemas.topics import DEVICE_STATUS, FOLLOW_JOINT_TRAJECTORY
from gemelo.services.stepper_gateway.links.link import Kind, Received
from tests.gemelo.test_control import Lab, refusal
from tests.runtime.support import until
from tests.stepper_gateway.harness import move

SPEAKS = "speaks and does not hear"
ENDS = 5.0  # [s] of a goal or a stop on a loaded machine; by the gateway's own clock it is 2 s
PERIOD = 0.01  # [s] between two looks at what the device has said


class DeafLink:
    """The firmware's core in real time; once it is deaf nothing that is sent arrives."""

    connected, reason = True, ""

    def __init__(self, arm: ArmDescription) -> None:
        self.is_deaf = False
        self._device = CoreDevice(device_config(arm), 77, 0, reference_steps(arm))
        self._device.report_status()
        self._began = time.monotonic()
        self._waiting: list[Received] = []

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        if not self.is_deaf:
            self._advance()
            self._device.receive_config(payload) if kind is Kind.CONFIG else self._device.receive(payload)
        return True

    def take(self, most: int) -> list[Received]:
        self._advance()
        taken, self._waiting = self._waiting[:most], self._waiting[most:]
        return taken

    def close(self) -> None:
        pass

    def _advance(self) -> None:
        self._device.advance(round((time.monotonic() - self._began) * 1e6))
        now = time.monotonic_ns()
        self._waiting += [Received(Kind(frame.kind), frame.payload, False, now) for frame in self._device.take()]


class DeafLab(Lab):
    """A gateway with a device, and who connects to it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        super().__init__(folder, stack)
        self.link = DeafLink(self.description)
        self.shell.use(self.link)
        ended = threading.Event()

        def look() -> None:
            while not ended.wait(PERIOD):
                self.shell.wake()

        threading.Thread(target=look, daemon=True).start()
        stack.callback(ended.set)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[DeafLab]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with ExitStack() as stack:
        yield DeafLab(tmp_path, stack)


@pytest.fixture
def person(lab: DeafLab) -> gemelo.Arm:
    """Connected, once the device is ready."""
    arm = lab.arm("ana-1")
    status = arm.node.latest(DEVICE_STATUS)
    assert until(lambda: status.message is not None and status.message.online, 60.0)
    return arm


def test_a_goal_that_the_device_never_receives_ends_and_the_next_is_refused(lab: DeafLab, person: gemelo.Arm) -> None:
    lab.link.is_deaf = True
    goal = FollowJointTrajectoryGoal(trajectory=move((0.0, 0.0, 0.0), (0.6, -1.2, 0.08)))
    client = person.node.action(FOLLOW_JOINT_TRAJECTORY)
    began = time.monotonic()
    told = client.send(goal).wait(ENDS)
    assert told.status is GoalStatusCode.ABORTED
    assert SPEAKS in told.result.error_string
    assert time.monotonic() - began < ENDS
    with pytest.raises(GoalRefused, match=SPEAKS) as refused:
        client.send(goal)
    assert refused.value.code == FollowErrorCode.DEVICE_FAILED


def test_a_stop_that_the_device_never_receives_says_what_is_known(lab: DeafLab, person: gemelo.Arm) -> None:
    lab.link.is_deaf = True
    began = time.monotonic()
    refused = refusal(person.stop)
    assert time.monotonic() - began < ENDS
    assert "the device has not answered STOP in time" in str(refused.reason)
    assert SPEAKS in str(refused.reason)
    assert "it stands, in mode IDLE" in str(refused.reason)
