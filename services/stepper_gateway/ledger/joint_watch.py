"""The work of one joint between two states of the device: turns of its motor, and the load of it."""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from gemelo.libraries.arm.model.description import Joint
from gemelo.libraries.arm.motors.torque import NO_CURVE, torque_share
from gemelo.services.stepper_gateway.ledger.confidence import Evidence

WATCHED = 0.1  # [s] between two states, beyond which the hardest motion is assumed; chosen: five states
USUAL_FULL_STEPS = 200  # [steps/rev] of a motor without a pull-out curve; standard: motors of 1.8 deg
STILL = 1.0  # [steps/s] chosen: slower pulses are no load


class JointSample(NamedTuple):
    """One joint in one state."""

    t_us: int  # of the device's clock
    steps: int
    rate: float  # [steps/s]


class JointWatch:
    """One joint."""

    def __init__(self, joint: Joint) -> None:
        self.joint = joint
        self._motor = joint.drive.motor
        self._top_rate = joint.velocity * joint.steps.per_unit
        self._top_acceleration = joint.acceleration * joint.steps.per_unit
        self.hardest = self._load(self._top_rate, self._top_acceleration)

    @property
    def cycle(self) -> float:
        """[steps] of four full steps: a motor loses whole ones of these."""
        curve = self._motor.pull_out
        full_steps = curve.full_steps_per_turn if curve is not None else USUAL_FULL_STEPS
        return 4.0 * self._motor.pulses_per_turn / full_steps

    def travelled(self, evidence: Evidence) -> float:
        """[steps] since the verification."""
        return evidence.turns * self._motor.pulses_per_turn + abs(evidence.lost)

    def between(self, evidence: Evidence, before: JointSample, now: JointSample) -> Evidence:
        """The evidence after what the joint did from `before` to `now`."""
        moved, seconds = abs(now.steps - before.steps), (now.t_us - before.t_us) * 1e-6
        if seconds <= 0.0 or (not moved and max(abs(before.rate), abs(now.rate)) < STILL):
            return evidence
        if seconds > WATCHED:
            return self.unwatched(evidence, moved)
        acceleration = abs(now.rate - before.rate) / seconds
        load = self._load(max(abs(before.rate), abs(now.rate)), acceleration)
        return self._after(evidence, moved, load)

    def unwatched(self, evidence: Evidence, steps: float) -> Evidence:
        """The evidence after so many `steps` [steps] that nobody has seen."""
        return self._after(evidence, steps, self.hardest) if steps else evidence

    def in_time(self, seconds: float) -> float:
        """[steps] that the joint makes in `seconds` at most."""
        return self._top_rate * seconds

    def _after(self, evidence: Evidence, steps: float, load: float) -> Evidence:
        turns = evidence.turns + steps / self._motor.pulses_per_turn
        return replace(evidence, turns=turns, load=max(evidence.load, load))

    def _load(self, rate: float, acceleration: float) -> float:
        if self._motor.pull_out is None:
            return NO_CURVE * max(rate / self._top_rate, acceleration / self._top_acceleration)
        return torque_share(self._motor, rate, acceleration)
