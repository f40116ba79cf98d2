"""Between joint units and motor steps, by exact ratios: the error is never above half a step, over any distance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.robot import StepperJoint, Transmission

TAU = 2.0 * math.pi
Q8 = 256  # the wire's positions are 1/256 steps
MAX_RATIO = Fraction(10**9)
MIN_RATIO = 1 / MAX_RATIO


@dataclass(frozen=True)
class StepScale:
    """The ratio of motor steps to a joint's travel; positions are absolute, so errors do not accumulate.

    The sign of an inverted motor is applied by the device, not here.
    """

    steps_per_turn: Fraction  # [steps/rev] of the output shaft, exact
    travel_per_turn: float  # [rad] or [m] of the joint for one turn of the output shaft

    @cached_property
    def per_unit(self) -> float:
        """[steps/rad] or [steps/m]."""
        return float(self.steps_per_turn) / self.travel_per_turn

    @cached_property
    def _steps(self) -> float:
        return float(self.steps_per_turn)

    @cached_property
    def _q8(self) -> float:
        return float(self.steps_per_turn * Q8)

    @property
    def degrees_per_step(self) -> Fraction:
        """[deg] of the output shaft, exact: 25/1296 for q1 of rm1."""
        return 360 / self.steps_per_turn

    @property
    def resolution(self) -> float:
        """[rad] or [m] of one step."""
        return self.travel_per_turn / self._steps

    def to_steps(self, position: float) -> float:
        """Steps, with their fraction, at `position` [rad] or [m]."""
        return position / self.travel_per_turn * self._steps

    def to_position(self, steps: float) -> float:
        """Position [rad] or [m] of so many steps."""
        return steps / self._steps * self.travel_per_turn

    def to_q8(self, position: float) -> int:
        """The nearest 1/256 step to `position` [rad] or [m]."""
        return round(position / self.travel_per_turn * self._q8)

    def from_q8(self, steps: int) -> float:
        """Position [rad] or [m] of so many 1/256 steps."""
        return steps / self._q8 * self.travel_per_turn


def step_scale(drive: StepperJoint) -> StepScale:
    """The scale of one joint of robot.toml; raises `DescriptionError` naming the joint."""
    pulses = drive.motor.pulses_per_turn
    if pulses <= 0:
        raise _wrong(drive.name, because("robot.motor.pulses_per_turn", value=pulses))
    try:
        ratio = exact_ratio(drive.motor.gear_ratio)
    except DescriptionError as error:
        raise _wrong(drive.name, error.reason) from error
    return StepScale(pulses * ratio, travel_per_turn(drive))


def _wrong(joint: str, what: Reason) -> DescriptionError:
    return DescriptionError(because("robot.joint", what, joint=joint))


def travel_per_turn(drive: StepperJoint) -> float:
    """[rad] or [m] that the joint moves for one turn of the output shaft."""
    match drive.transmission:
        case Transmission.ROTARY:
            if drive.pinion_radius is not None:
                raise _wrong(drive.name, because("robot.motor.no_pinion"))
            return TAU
        case Transmission.RACK_AND_PINION:
            if drive.pinion_radius is None or not 1e-4 <= drive.pinion_radius <= 10.0:
                if drive.pinion_radius is None:
                    raise _wrong(drive.name, because("robot.motor.pinion_missing"))
                raise _wrong(drive.name, because("robot.motor.pinion", value=drive.pinion_radius))
            return TAU * drive.pinion_radius


def exact_ratio(text: str) -> Fraction:
    """ "46.656" or "380/21" as a positive ratio (dimensionless); raises `DescriptionError`."""
    try:
        if "e" in text.lower():
            raise ValueError("an exponent may be longer than any memory")
        ratio = Fraction(text.replace(" ", ""))
    except (ValueError, ZeroDivisionError) as error:
        raise DescriptionError(because("robot.gear_ratio.number", text=text)) from error
    if ratio <= 0:
        raise DescriptionError(because("robot.gear_ratio.negative", text=text))
    if not MIN_RATIO <= ratio <= MAX_RATIO:
        raise DescriptionError(because("robot.gear_ratio.range", text=text))
    return ratio
