"""The duration of a stepper's relative move from rest to rest, driven as AccelStepper drives it.

Its ramp is that of D. Austin, "Generate stepper-motor speed profiles in real time", Embedded Systems Programming, 2005:
a constant acceleration, approximated step by step.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

from gemelo.libraries.arm.motors.speed import speed_limits
from gemelo.libraries.arm.motors.steps import exact_ratio, step_scale
from gemelo.schemas.robot import Sketch, StepperJoint

# The approximation is slower than the exact ramp by a few per cent in short moves, and by some steps at either end.
SLOWER = 1.10
MORE_STEPS = 2.0

MARGIN = 0.15  # [s] chosen: how much later than another one a message may arrive
LONGEST_GAP = 1.5  # words of the sketch's telemetry that may lie between two, if its loop does not stand still
GATHERING = 0.05  # [s] that the steps of a motion are gathered into its first message


class Ramp(NamedTuple):
    """One motor in the sketch."""

    name: str
    steps_per_turn: Fraction  # [steps/rev] by which it turns degrees into steps
    speed: float  # [steps/s]
    acceleration: float  # [steps/s^2]

    def duration(self, steps: int) -> float:
        """[s] that a move of so many steps takes at most."""
        if steps == 0:
            return 0.0
        count = abs(steps) + MORE_STEPS
        if count < self.speed**2 / self.acceleration:
            return SLOWER * 2.0 * math.sqrt(count / self.acceleration)
        return SLOWER * (count / self.speed + self.speed / self.acceleration)

    def most_steps(self, seconds: float) -> float:
        """The longest move that surely ends within `seconds` [s]."""
        seconds /= SLOWER
        if seconds < 2.0 * self.speed / self.acceleration:
            return max(0.0, self.acceleration * seconds**2 / 4.0 - MORE_STEPS)
        return max(0.0, self.speed * (seconds - self.speed / self.acceleration) - MORE_STEPS)

    def path_speed(self, message_time: float, telemetry_time: float) -> float:
        """[steps/s] at which a path may go, so that no message takes longer than `message_time` [s].

        The sketch says something every `telemetry_time` [s]. What the path commands during one message is the next one.
        """
        seconds = message_time - MARGIN - GATHERING - LONGEST_GAP * telemetry_time
        # A motor that makes less than a step in a message still makes one now and then.
        return max(self.most_steps(seconds), 1.0) / message_time


def ramp_of(drive: StepperJoint) -> Ramp:
    """The sketch's figures for a joint of robot.toml; raises `DescriptionError`."""
    own, speeds = drive.sketch or Sketch(), speed_limits(drive)
    where = f'joint "{drive.name}": sketch.steps_per_turn'
    ratio = exact_ratio(own.steps_per_turn, where) if own.steps_per_turn else step_scale(drive).steps_per_turn
    return Ramp(
        drive.wire_name,
        ratio,
        float(own.speed or speeds.step_rate),
        float(own.acceleration or speeds.step_acceleration),
    )
