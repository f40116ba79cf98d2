"""How much of a 90 degree move arrives at the shaft, beside the seed's way: relative moves, ten times a second.

Both go through the same virtual motor, with the pull-out curve that robot.toml gives it.
"""

from __future__ import annotations

import math

from firmware.bindings.motor import VirtualMotor
from schemas.message import Message
from schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from services.arm.description import Arm
from services.bench.arms import rm1
from services.bench.figure import Figure, NotMeasured, rounded
from services.bench.seed_sketch import SeedStepper, relative_moves
from services.bench.virtual_arm import VirtualArm

UNIT = "%"
TURN = math.pi / 2  # [rad]
DURATION = 5.0  # [s] of our move
PERIOD = 0.1  # [s] of the seed's messages
TURNING = {"brazo_joint": 3110.0, "antebrazo_joint": 100.0}  # [steps/s^2] of the seed's sketch


def measure() -> Figure:
    arm = rm1()
    ours = {name: our_share(arm, name) for name in TURNING}
    seed = {f"seed: {name}": rounded(seed_share(arm, name)) for name in TURNING}
    least = rounded(min(ours.values()))
    note = (
        f"at the shaft of the virtual motors, in virtual time; ours as one goal of {DURATION:g} s through gateway and "
        f"firmware, the seed's first message with all of it and one of nothing every {PERIOD:g} s after"
    )
    return Figure(
        unit=UNIT, median=least, p99=least, goal="100, to the nearest step", met=least == 100.0, reference=seed,
        note=note,
    )  # fmt: skip


def our_share(arm: Arm, name: str) -> float:
    """[%] of the turn that the shaft makes; the half step that nothing can make counts as made."""
    index = arm.joint_names.index(name)
    world = VirtualArm(arm, _ignore, motors=[joint.drive.motor for joint in arm.joints])
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=turn(arm, index))
    verdict, outputs = world.gateway.on_goal("turn", goal, world.moment)
    world.carry_out(outputs)
    if not verdict.accepted:
        raise NotMeasured(f"the move was refused: {verdict.reason}")
    world.run(DURATION + 2.0)
    return 100.0 * world.device.shaft[index] / round(arm.joints[index].steps.to_steps(TURN))


def seed_share(arm: Arm, name: str) -> float:
    """[%] of the turn that is left of it where each message discards the rest of the last one."""
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
    """One joint from rest to rest on a quintic, the others still."""
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


def _ignore(_message: Message) -> None:
    """Nothing of what the gateway says is measured here."""
