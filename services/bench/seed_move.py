"""The figure of a 90 degree move at the motor's shaft, against the relative moves of the seed's Arduino sketch.

Both run on the same virtual motor with the pull-out curve of robot.toml. The seed's steps are those of the virtual
sketch, where a new target is the PRESENT position plus the message's steps, whatever is left of the move before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from firmware.bindings.motor import VirtualMotor
from firmware.platform.host.sketch import AustinStepper
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
    stepper = AustinStepper(speed=joint.steps.to_steps(joint.velocity), acceleration=TURNING[name])
    motor = VirtualMotor(joint.drive.motor)
    for time, direction in pulses(stepper, relative_moves(int(asked), PERIOD, DURATION), DURATION):
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


@dataclass(frozen=True)
class RelativeMove:
    """One message of the seed."""

    time: float  # [s] of its arrival
    steps: int


def relative_moves(steps: int, period: float, duration: float) -> list[RelativeMove]:
    """A move as the seed streams it: all `steps` in the first message, none in the others, `period` [s] apart."""
    return [RelativeMove(number * period, 0 if number else steps) for number in range(round(duration / period))]


def pulses(stepper: AustinStepper, messages: Sequence[RelativeMove], until: float) -> Iterator[tuple[float, int]]:
    """Time [s] and direction (1 or -1) of every step before `until` [s]."""
    waiting, now = sorted(messages, key=lambda message: message.time), 0.0
    while True:
        # After a rest its last step is long ago, so the first one is due at once.
        due = math.inf if stepper.due is None else max(now, stepper.due)
        if waiting and waiting[0].time <= due:
            message = waiting.pop(0)
            now = message.time
            stepper.move(message.steps)
            continue
        if due >= until:
            return
        now, before = due, stepper.position
        stepper.step(now)
        yield now, stepper.position - before
