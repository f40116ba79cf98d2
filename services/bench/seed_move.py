"""The figure of a 90 degree move at the motor's shaft, against the relative moves of the seed's Arduino sketch.

Both run on the same virtual motor with the pull-out curve of robot.toml. The seed's step intervals are those of Austin,
"Generate stepper-motor speed profiles in real time" (Embedded Systems Programming, 2005), with the rule of its library
that a new target is the PRESENT position plus the message's steps, whatever is left of the move before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from firmware.bindings.motor import VirtualMotor
from schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from services.arm.model.description import Arm
from services.bench.figures import Figure, NotMeasured, rounded
from services.bench.scenes import rm1
from services.virtual_arm.virtual_arm import VirtualArm, tcp_wire

TURN = math.pi / 2  # [rad]
DURATION = 5.0  # [s] of our move
PERIOD = 0.1  # [s] of the seed's messages
TURNING = {"brazo_joint": 3110.0, "antebrazo_joint": 100.0}  # [steps/s^2] of the seed's sketch


def seed_move_percent() -> Figure:
    """Share [%] of a 90 degree move that the shaft makes, in virtual time."""
    arm = rm1()
    ours = {name: our_share(arm, name) for name in TURNING}
    seed = {f"seed: {name}": rounded(seed_share(arm, name)) for name in TURNING}
    least = rounded(min(ours.values()))
    note = (
        f"at the shaft of the virtual motors, in virtual time; ours as one goal of {DURATION:g} s through gateway and "
        f"firmware, the seed's first message with all of it and one of nothing every {PERIOD:g} s after"
    )
    return Figure(
        median=least, p99=least, goal="100, to the nearest step", met=least == 100.0, reference=seed, note=note
    )


def our_share(arm: Arm, name: str) -> float:
    """Share [%] of the turn, to the nearest step, that the shaft makes through gateway and firmware."""
    index = arm.joint_names.index(name)
    world = VirtualArm(tcp_wire(), arm=arm, motors=[joint.drive.motor for joint in arm.joints])
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=turn(arm, index))
    verdict = world.goal(goal)
    if not verdict.accepted:
        raise NotMeasured(f"the move was refused: {verdict.reason}")
    world.run(DURATION + 2.0)
    return 100.0 * world.device.shaft[index] / round(arm.joints[index].steps.to_steps(TURN))


def seed_share(arm: Arm, name: str) -> float:
    """Share [%] of the turn that the shaft makes when each message discards the rest of the last one."""
    joint = arm.joint(name)
    asked = joint.steps.to_steps(TURN)
    stepper = SeedStepper(speed=joint.steps.to_steps(joint.velocity), acceleration=TURNING[name])
    motor = VirtualMotor(joint.drive.motor)
    for time, direction in stepper.pulses(relative_moves(int(asked), PERIOD, DURATION), DURATION):
        motor.run(time)
        motor.pulse(direction)
    motor.run(DURATION + 1.0)
    return 100.0 * motor.shaft / asked


def turn(arm: Arm, index: int) -> JointTrajectory:
    """The joint `index` from rest to rest on a quintic, the others at rest."""
    points = []
    for number in range(round(DURATION / 0.05) + 1):
        time = number * 0.05
        x = time / DURATION
        here = [0.0] * len(arm.joints)
        speed = [0.0] * len(arm.joints)
        here[index] = TURN * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        speed[index] = TURN / DURATION * 30.0 * (x * (1.0 - x)) ** 2
        points.append(TrajectoryPoint(positions=tuple(here), velocities=tuple(speed), time_from_start=time))
    return JointTrajectory(joint_names=arm.joint_names, points=tuple(points))


FIRST_INTERVAL = 0.676  # Austin's correction of the first of the equal-acceleration intervals


@dataclass(frozen=True)
class RelativeMove:
    """One message of the seed."""

    time: float  # [s] of its arrival
    steps: int


def relative_moves(steps: int, period: float, duration: float) -> list[RelativeMove]:
    """A move as the seed streams it: all `steps` in the first message, none in the others, `period` [s] apart."""
    return [RelativeMove(number * period, 0 if number else steps) for number in range(round(duration / period))]


class SeedStepper:
    """One motor of the sketch; `speed` [steps/s], `acceleration` [steps/s^2]."""

    def __init__(self, speed: float, acceleration: float) -> None:
        self._shortest = 1.0 / speed  # [s] between steps
        self._acceleration = acceleration  # [steps/s^2]
        self._position = self._target = 0
        self._ramp = 0  # steps since rest; negative: steps left until rest
        self._interval = 0.0  # [s] to the next step; 0: at rest
        self._direction = 1

    def pulses(self, messages: Sequence[RelativeMove], until: float) -> Iterator[tuple[float, int]]:
        """Time [s] and direction (1 or -1) of every step before `until` [s]."""
        waiting, now = sorted(messages, key=lambda message: message.time), 0.0
        while True:
            due = now + self._interval if self._interval else math.inf
            if waiting and waiting[0].time <= due:
                message = waiting.pop(0)
                was_resting = self._interval == 0.0
                self._target = self._position + message.steps
                self._plan()
                # Intervals count from the last step; after a rest that is long ago, so the first step is due at once.
                now = message.time - self._interval if was_resting else now
                continue
            if due >= until:
                return
            now = due
            self._position += self._direction
            yield now, self._direction
            self._plan()

    def _plan(self) -> None:
        to_go = self._target - self._position
        to_stop = self._steps_to_stop()
        if to_go == 0 and to_stop <= 1:
            self._interval, self._ramp = 0.0, 0
            return
        is_on_its_way = to_go * self._direction > 0
        if self._ramp > 0 and (to_stop >= abs(to_go) or not is_on_its_way):
            self._ramp = -to_stop
        elif self._ramp < 0 and to_stop < abs(to_go) and is_on_its_way:
            self._ramp = -self._ramp
        self._next_interval(to_go)

    def _next_interval(self, to_go: int) -> None:
        if self._ramp == 0:
            self._direction = 1 if to_go > 0 else -1
            self._interval = FIRST_INTERVAL * math.sqrt(2.0 / self._acceleration)
        else:
            self._interval -= 2.0 * self._interval / (4.0 * self._ramp + 1.0)
            self._interval = max(self._interval, self._shortest)
        self._ramp += 1

    def _steps_to_stop(self) -> int:
        speed = 1.0 / self._interval if self._interval else 0.0
        return int(speed * speed / (2.0 * self._acceleration))
