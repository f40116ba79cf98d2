"""The duration of a stepper's relative move from rest to rest, driven as AccelStepper drives it.

Its ramp is that of D. Austin, "Generate stepper-motor speed profiles in real time", Embedded Systems Programming, 2005:
a constant acceleration, approximated step by step. Its documentation says that each call of run() makes one step at
most, and only when one is due by the time since the last step: so every step waits for the next pass of loop(), and the
interval after it counts from that pass.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from fractions import Fraction
from typing import NamedTuple

from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.motors.speed import speed_limits
from gemelo.libraries.arm.motors.steps import exact_ratio, step_scale
from gemelo.schemas.robot import DeviceRecord, Sketch, StepperJoint

# The approximation is slower than the exact ramp by a few per cent in short moves, and by some steps at either end.
SLOWER = 1.10
MORE_STEPS = 2.0

MARGIN = 0.15  # [s] chosen: how much later than another one a message may arrive
LONGEST_GAP = 1.5  # words of the sketch's telemetry that may lie between two, if its loop does not stand still
GATHERING = 0.05  # [s] that the steps of a motion are gathered into its first message
PUBLISHING = 0.0015  # [s] that both messages of a word hold loop() up; assumed: 0.6 ms each on an ESP32, and a quarter
LOOP_READING = "loop_us"  # under which a sketch may say in ra/sensores how long its longest pass was


class Loop(NamedTuple):
    """The sketch's loop(), which makes at most one step of each motor in a pass."""

    pass_time: float  # [s] of the longest pass that publishes nothing
    telemetry_time: float  # [s] between two words of its telemetry


class Ramp(NamedTuple):
    """One motor in the sketch."""

    name: str
    steps_per_turn: Fraction  # [steps/rev] by which it turns degrees into steps
    speed: float  # [steps/s]
    acceleration: float  # [steps/s^2]

    def duration(self, steps: int, loop: Loop) -> float:
        """[s] that a move of so many steps takes at most: each step may wait for a whole pass."""
        if steps == 0:
            return 0.0
        count = abs(steps) + MORE_STEPS
        if count < self.speed**2 / self.acceleration:
            seconds = 2.0 * math.sqrt(count / self.acceleration)
        else:
            seconds = count / self.speed + self.speed / self.acceleration
        seconds = SLOWER * seconds + count * loop.pass_time
        return seconds * (1.0 + PUBLISHING / loop.telemetry_time) + PUBLISHING

    def most_steps(self, seconds: float, loop: Loop) -> int:
        """The longest move that surely ends within `seconds` [s]."""
        if seconds <= 0.0:
            return 0
        counts = range(1, math.ceil(self.speed * seconds) + 1)
        return bisect_right(counts, seconds, key=lambda steps: self.duration(steps, loop))

    def path_speed(self, message_time: float, loop: Loop) -> float:
        """[steps/s] at which a path may go, so that no message takes longer than `message_time` [s].

        What the path commands during one message is the next one.
        """
        seconds = message_time - MARGIN - GATHERING - LONGEST_GAP * loop.telemetry_time
        # A motor that makes less than a step in a message still makes one now and then.
        return max(self.most_steps(seconds, loop), 1) / message_time


def loop_of(device: DeviceRecord) -> Loop:
    """The loop() of the sketch on this board."""
    return Loop(device.loop_time, device.telemetry_time)


def ramp_of(drive: StepperJoint) -> Ramp:
    """The sketch's figures for a joint of robot.toml; raises `DescriptionError`."""
    own, speeds = drive.sketch or Sketch(), speed_limits(drive)
    try:
        ratio = exact_ratio(own.steps_per_turn) if own.steps_per_turn else step_scale(drive).steps_per_turn
    except DescriptionError as error:
        if not own.steps_per_turn:
            raise
        raise DescriptionError(Subject("joint", drive.name, "sketch.steps_per_turn").around(error.reason)) from error
    return Ramp(
        drive.wire_name,
        ratio,
        float(own.speed or speeds.step_rate),
        float(own.acceleration or speeds.step_acceleration),
    )
