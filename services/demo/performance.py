"""Carries out the script on a running stack and keeps the ledger; the clients are those of `gemelo move`."""

from __future__ import annotations

from collections.abc import Callable

from schemas.actions import GoalStatusCode
from schemas.device import DeviceMode, DeviceState
from schemas.joints import JointState, JointTargets
from schemas.motion import FollowJointTrajectoryGoal
from schemas.planning import PlanRequest
from schemas.topics import (
    COMMAND_ACKS,
    COMMANDS,
    DEVICE_STATE,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_STATES,
    JOINT_TARGETS,
    PLAN,
    STEP_ERRORS,
)
from services.arm.description import Arm
from services.demo.ledger import Ledger
from services.demo.report import Move
from services.demo.script import SINE_RATE, SINE_TIME, Sine, Stop, sine_of, tour
from services.runtime.errors import GoalRefused, NoAnswer, Refused, ServerLost
from services.runtime.node import Node

FIRST_MESSAGES = 5.0  # [s] to wait for the arm's state
REST = 5.0  # [s] that the arm may take to come to rest after the stream
MOVE_MARGIN = 10.0  # [s] beyond a plan's own duration
SINE_REACHED = 0.9  # of both amplitudes, or the sine was not followed
SETTLE = 0.3  # [s] for the last states and acknowledgements


class Performance:
    """One run of the script."""

    def __init__(self, node: Node, arm: Arm, say: Callable[[str], None]) -> None:
        self.arm = arm
        self.ledger = Ledger()
        self.moves: list[Move] = []
        self._node = node
        self._say = say
        self._joints = node.latest(JOINT_STATES)
        self._device = node.latest(DEVICE_STATE)
        self._targets = node.publisher(JOINT_TARGETS)
        self._follow = node.action(FOLLOW_JOINT_TRAJECTORY)
        node.subscribe(STEP_ERRORS, self.ledger.on_errors)
        node.subscribe(COMMANDS, self.ledger.on_chunk)
        node.subscribe(COMMAND_ACKS, self.ledger.on_ack)
        node.subscribe(DEVICE_STATE, self.ledger.on_state)

    def run(self) -> None:
        """The sine, then the tour."""
        self._wait_until(lambda: self._joints.message is not None and self._device.message is not None, FIRST_MESSAGES)
        self._keep(self.sine())
        for stop in tour(self.arm):
            self._keep(self.go(stop))
        self._node.wait(SETTLE)

    def sine(self) -> Move:
        """The seed's demonstration: targets 10 times a second, here on all joints at once."""
        start = self._positions()
        sines = [sine_of(joint, start[joint.name]) for joint in self.arm.joints]
        travel = {sine.joint: (sine.centre, sine.centre) for sine in sines}
        began = self._node.monotonic()
        for beat in range(int(SINE_TIME * SINE_RATE) + 1):
            time = beat / SINE_RATE
            self._node.wait(max(0.0, began + time - self._node.monotonic()))
            self._targets.put(targets_of(sines, time, self._node.now()))
            for name, position in self._positions().items():
                low, high = travel[name]
                travel[name] = (min(low, position), max(high, position))
        rested = self._wait_until(self._is_at_rest, REST)
        took = self._node.monotonic() - began
        lazy = [sine.joint for sine in sines if not was_followed(sine, *travel[sine.joint])]
        reason = "" if rested else f"not at rest after {REST:g} s; "
        reason += f"not followed by {', '.join(lazy)}" if lazy else ""
        return Move(name="sine, streamed at 10 Hz", succeeded=not reason, reason=reason, took_s=took)

    def go(self, stop: Stop) -> Move:
        """Plans and follows one goal."""
        try:
            plan = self._node.call(PLAN, PlanRequest(goal=stop.goal), timeout=3.0)
            if plan.refusal is not None:
                return Move(name=stop.name, succeeded=False, reason=plan.refusal.message)
            handle = self._follow.send(
                FollowJointTrajectoryGoal(
                    trajectory=plan.trajectory, scene_version=plan.scene_version, scene_epoch=plan.scene_epoch
                )
            )
            outcome = handle.wait(plan.duration + MOVE_MARGIN)
        except (GoalRefused, Refused, NoAnswer, ServerLost) as error:
            return Move(name=stop.name, succeeded=False, reason=str(error))
        result = outcome.result
        return Move(
            name=stop.name,
            succeeded=outcome.status is GoalStatusCode.SUCCEEDED,
            reason=result.error_string if result else outcome.status.name,
            plan_ms=plan.planning_time * 1e3,
            took_s=result.duration if result else 0.0,
            final_error_steps=max((abs(error) for error in result.final_error), default=0.0) if result else 0.0,
        )

    def _keep(self, move: Move) -> None:
        self.moves.append(move)
        self._say(f"{move.name}: {'ok' if move.succeeded else move.reason}, {move.took_s:.2f} s")

    def _positions(self) -> dict[str, float]:
        message = self._joints.message or JointState()
        return dict(zip(message.name, message.position, strict=True))

    def _is_at_rest(self) -> bool:
        return is_at_rest(self._device.message)

    def _wait_until(self, is_so: Callable[[], bool], patience: float) -> bool:
        deadline = self._node.monotonic() + patience
        while not is_so() and self._node.monotonic() < deadline:
            self._node.wait(0.02)
        return is_so()


def targets_of(sines: list[Sine], time: float, now: int) -> JointTargets:
    return JointTargets(
        stamp=now, name=tuple(sine.joint for sine in sines), position=tuple(sine.at(time) for sine in sines)
    )


def was_followed(sine: Sine, low: float, high: float) -> bool:
    """Whether the joint went most of the way to both sides."""
    reach = SINE_REACHED * sine.amplitude
    return low <= sine.centre - reach and high >= sine.centre + reach


def is_at_rest(state: DeviceState | None) -> bool:
    return state is not None and state.mode is DeviceMode.IDLE and state.buffered == 0.0 and not any(state.velocity)
