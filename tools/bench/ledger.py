"""The calibration of the step ledger: what it calls sure, against the shafts of motors of random weakness.

`python -m gemelo.tools.bench.ledger --moves 10000` prints the table of docs/ledger.md: virtual time, equal for equal
seeds. Motors give a random share of the torque that robot.toml states, which the ledger does not know. After every move
its confidence is compared with the truth: whether a shaft stands half a cycle of its field or more from its counter.
Now and then the joints are verified: that tells the ledger what a homing would tell it.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import random
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from msgspec.structs import replace

from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.robot import Motor
from gemelo.schemas.topics import STEP_LEDGER
from gemelo.tools.bench.figures import Figure, rounded
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.bench.stopping import random_place, smooth_move
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.virtual_arm.gateway_driver import Kind
from gemelo.tools.virtual_arm.virtual_arm import BOOTED, PERIOD, VirtualArm

MOVES = 10_000
QUICK = 300  # moves of `make bench`
SEED = 16
LEVEL = 0.95
EDGES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
MOST_MOVES = 12  # between two verifications
VERIFICATIONS = 4  # of one arm
REACH = 0.12  # of a joint's travel, within which moves are drawn

Weakness = Callable[[random.Random], float]
POPULATIONS: dict[str, Weakness] = {  # share of the stated torque that a motor gives
    "uniform 0.15 to 1.2": lambda rng: rng.uniform(0.15, 1.2),
    "log-normal about 0.6": lambda rng: rng.lognormvariate(-0.51, 0.5),
    "log-uniform 0.1 to 1.2": lambda rng: 0.1 * 12.0 ** rng.random(),
    "1.2 times beta (2, 3)": lambda rng: 1.2 * rng.betavariate(2.0, 3.0),
    "one in three 0.15, the others 1.0": lambda rng: 0.15 if rng.random() < 1.0 / 3.0 else 1.0,
}


class StateAfterMove(NamedTuple):
    """One state after a move."""

    confidence: float  # of the arm, 0 to 1
    is_lost: bool  # a joint has lost steps


def ledger() -> Figure:
    """Share [%] of the states called 95 % sure in which no joint had lost a step."""
    seen = simulate(QUICK, POPULATIONS["uniform 0.15 to 1.2"], SEED)
    sure = [one for one in seen if one.confidence >= LEVEL]
    share = 100.0 * (1.0 - sum(one.is_lost for one in sure) / max(1, len(sure)))
    lost = sum(one.is_lost for one in seen)
    note = f"virtual time, {len(seen)} moves; {len(sure)} states called sure; steps lost in {lost} of all states"
    return Figure(median=rounded(share), goal=">= 95", met=share >= 95.0, note=note)


def simulate(moves: int, weakness: Weakness, seed: int) -> list[StateAfterMove]:
    """So many moves of arms whose motors are drawn from `weakness`."""
    rng, seen = random.Random(seed), list[StateAfterMove]()
    while len(seen) < moves:
        arm, motors = _arm(rng), [_weakened(joint, weakness(rng)) for joint in rm1().joints]
        rig: VirtualArm | None = None
        for _ in range(VERIFICATIONS):
            rig = _verified(arm, motors, rig, rng)
            for _ in range(rng.randint(1, MOST_MOVES)):
                seen.append(_moved(rig, rng))
    return seen[:moves]


def text_of(seen: Sequence[StateAfterMove]) -> str:
    """How many states fell into each range of confidence, and in how many no step was lost."""
    rows = []
    for low, high in pairwise(EDGES):
        within = [one for one in seen if low <= one.confidence < high or one.confidence == high == 1.0]
        rows.append(_row(f"{low:.2f} to {high:.2f}", within))
    rows.append(_row(f">= {LEVEL}", [s for s in seen if s.confidence >= LEVEL]))
    rows.append(_row("all", list(seen)))
    return table(("confidence of the arm", "states", "no step lost", "share", "mean confidence"), rows)


def _row(name: str, seen: Sequence[StateAfterMove]) -> tuple[str, ...]:
    if not seen:
        return name, "0", "-", "-", "-"
    kept = sum(not one.is_lost for one in seen)
    mean = sum(one.confidence for one in seen) / len(seen)
    return name, str(len(seen)), str(kept), f"{100.0 * kept / len(seen):.2f} %", f"{mean:.3f}"


def _arm(rng: random.Random) -> ArmDescription:
    """rm1 with limits that ask more of its motors, differently for each joint."""
    joints = tuple(_quicker(joint, rng) for joint in rm1().joints)
    return dataclasses.replace(rm1(), joints=joints)


def _quicker(joint: Joint, rng: random.Random) -> Joint:
    speed, ramp = 2.0 ** rng.random(), 1.5 * 25.0 ** rng.random()
    return dataclasses.replace(
        joint,
        velocity=joint.velocity * speed,
        acceleration=joint.acceleration * ramp,
        jerk=joint.jerk * 3.0 * ramp,
    )


def _weakened(joint: Joint, share: float) -> Motor:
    curve = joint.drive.motor.pull_out
    if curve is None:
        return joint.drive.motor
    weak = replace(curve, torque=tuple(torque * share for torque in curve.torque))
    return replace(joint.drive.motor, pull_out=weak)


def _verified(
    arm: ArmDescription, motors: Sequence[Motor], before: VirtualArm | None, rng: random.Random
) -> VirtualArm:
    """The arm with counters that agree with its shafts, and a ledger that has been told what a homing found."""
    off: list[int] | None = None
    start = tuple(random_place(joint, rng, REACH) for joint in arm.joints)
    if before is not None:
        off = [true - count for true, count in zip(before.device.shaft, before.device.steps, strict=True)]
    rig = VirtualArm(arm=arm, start=start, motors=motors, step_us=PERIOD, seed=rng.randrange(1 << 30))
    if before is not None:
        rig.kept = before.kept
        record = before.core.ledger_record()
        if record is not None:  # as if it went on: nothing moves between the two
            rig.kept.append(replace(record, is_moving=False, steps=rig.device.steps))
        rig.new_gateway()
    rig.ready()
    for index, joint in enumerate(arm.joints):
        detail = joint.wire_name if off is None else f"{joint.wire_name}: {off[index]:+d} steps off"
        event = {"event": "homed", "t_us": BOOTED + rig.now_us, "detail": detail}
        rig.receive(Kind.EVENT, json.dumps(event).encode())
    rig.run(0.1)
    return rig


def _moved(rig: VirtualArm, rng: random.Random) -> StateAfterMove:
    goal = tuple(random_place(joint, rng, REACH) for joint in rig.arm.joints)
    trajectory = smooth_move(rig.arm, rig.position, goal, 1.0 + rng.random() ** 2)
    name = f"move {rig.now_us}"
    verdict = rig.goal(trajectory, name)
    if not verdict.accepted:
        raise ValueError(f"a move was refused: {verdict.reason}")
    rig.finish(name)
    rig.run(0.24)  # the ledger is told five times a second
    told = rig.messages(STEP_LEDGER)[-1]
    rig.published.clear()
    return StateAfterMove(told.arm_confidence, any(_is_lost(rig, index) for index in range(len(rig.arm.joints))))


def _is_lost(rig: VirtualArm, index: int) -> bool:
    motor = rig.arm.joints[index].drive.motor
    full_steps = motor.pull_out.full_steps_per_turn if motor.pull_out is not None else 200
    return abs(rig.device.shaft[index] - rig.device.steps[index]) >= 2.0 * motor.pulses_per_turn / full_steps


def main() -> None:
    """Prints the table of every population."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=MOVES)
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    for name, weakness in POPULATIONS.items():
        print(f"motors {name} of the stated torque, {options.moves} moves, seed {options.seed}")
        print(text_of(simulate(options.moves, weakness, options.seed)), flush=True)


if __name__ == "__main__":
    main()
