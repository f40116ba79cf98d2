"""Carries out the script on a running stack, as a user's script would, and keeps the ledger."""

from __future__ import annotations

import time
from collections.abc import Callable

import gemelo
from gemelo import topics
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.demo.ledger import StepTotals
from gemelo.tools.demo.report import Move
from gemelo.tools.demo.script import SINE_RATE, SINE_TIME, Sine, TourMove, sine_of, tour

REST = 5.0  # [s] that the arm may take to come to rest after the stream
SINE_REACHED = 0.9  # of both amplitudes, or the sine was not followed
SETTLE = 0.3  # [s] for the last states and acknowledgements


class Performance:
    """One run of the script."""

    def __init__(self, arm: gemelo.Arm, say: Callable[[Reason], None]) -> None:
        self.ledger = StepTotals()
        self.moves: list[Move] = []
        self._arm, self._say = arm, say
        arm.node.subscribe(topics.STEP_ERRORS, self.ledger.on_errors)
        arm.node.subscribe(topics.COMMANDS, self.ledger.on_chunk)
        arm.node.subscribe(topics.COMMAND_ACKS, self.ledger.on_ack)
        arm.node.subscribe(topics.DEVICE_STATE, self.ledger.on_state)

    def run(self) -> None:
        """The sine, then the tour."""
        self._keep(self.sine())
        for stop in tour(self._arm.description):
            self._keep(self.go(stop))
        time.sleep(SETTLE)

    def sine(self) -> Move:
        """Streams targets on all joints at 10 Hz, as the seed did on one."""
        start = self._arm.joints
        sines = [sine_of(joint, start[joint.name]) for joint in self._arm.description.joints]
        travel = {sine.joint: (sine.centre, sine.centre) for sine in sines}
        began = time.monotonic()
        for beat in range(int(SINE_TIME * SINE_RATE) + 1):
            at = beat / SINE_RATE
            time.sleep(max(0.0, began + at - time.monotonic()))
            self._arm.stream({sine.joint: sine.at(at) for sine in sines})
            for name, position in self._arm.joints.items():
                low, high = travel[name]
                travel[name] = (min(low, position), max(high, position))
        rested = self._comes_to_rest()
        took = time.monotonic() - began
        lazy = [sine.joint for sine in sines if not was_followed(sine, *travel[sine.joint])]
        causes = [] if rested else [because("demo.not_at_rest", time=REST)]
        causes += [because("demo.not_followed", joints=", ".join(lazy))] if lazy else []
        why = because("demo.sine.failed", *causes) if causes else None
        return Move(name=because("demo.sine", rate=SINE_RATE), succeeded=why is None, why=why, took_s=took)

    def go(self, stop: TourMove) -> Move:
        """Plans and follows one goal; the move has the reason if it failed."""
        try:
            motion = self._arm.move(**stop.target)
        except gemelo.Error as error:
            return Move(name=stop.name, succeeded=False, why=error.reason)
        return Move(
            name=stop.name,
            succeeded=True,
            plan_ms=motion.plan.planning_time * 1e3,
            took_s=motion.result.duration,
            final_error_steps=max(abs(error) for error in motion.result.final_error),
        )

    def _keep(self, move: Move) -> None:
        self.moves.append(move)
        if move.why is None:
            self._say(because("demo.went", move.name, time=move.took_s))
        else:
            self._say(because("demo.went_wrong", move.name, move.why, time=move.took_s))

    def _comes_to_rest(self) -> bool:
        """True once the device stands, within `REST` [s]."""
        end = time.monotonic() + REST
        while not (rests := is_at_rest(self._arm.device.state)) and time.monotonic() < end:
            time.sleep(0.02)
        return rests


def was_followed(sine: Sine, low: float, high: float) -> bool:
    """True if the joint's extremes `low` and `high` [rad] or [m] reach SINE_REACHED of the amplitude on both sides."""
    reach = SINE_REACHED * sine.amplitude
    return low <= sine.centre - reach and high >= sine.centre + reach


def is_at_rest(state: DeviceState) -> bool:
    return state.mode is DeviceMode.IDLE and state.buffered == 0.0 and not any(state.velocity)
