"""Figures of the dialects that people's boards speak already: the text line's round trip, and a seed's move.

`seed_move_percent` is a 90 degree move at the motor's shaft, against the relative moves of the seed's Arduino sketch.
Both run on the same virtual motor with the pull-out curve of robot.toml. The seed's steps are those of the virtual
sketch, where a new target is the PRESENT position plus the message's steps, whatever is left of the move before.
"""

from __future__ import annotations

import math
import os
import re
import select
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.motor import VirtualMotor
from gemelo.firmware.platform.host.sketch import AustinStepper
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription, as_its_board_drives_it
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.links.foreign.text_exchange import TextExchange
from gemelo.services.stepper_gateway.links.foreign.text_messages import AnswerReader, line_of
from gemelo.services.stepper_gateway.links.serial_port import open_port
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, rounded
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, tcp_wire

BAUD = 115_200
ANSWER = re.compile(rb"<[AN][^>]*>\n")  # the frames of our own protocol between them are left out
BITS_OF_A_BYTE = 10  # 8N1
LINES = 200
RATE = 25.0  # [Hz]
PUBLISHED = 29.8  # [ms] mean of the old driver, at 12.5 Hz


def text_link_ms() -> Figure:
    """From a line `<SEQ,...>` to its ACK [ms], at 25 Hz over a pseudo-terminal to the firmware's text mode."""
    device = msgspec.structs.replace(rm1().device, dialect=Dialect.TEXT)
    arm = as_its_board_drives_it(replace(rm1(), device=device))
    with closing(PacedBoard(arm)) as board:
        trips = round_trips(arm, board.path)
    note = (
        f"{LINES} lines at {RATE:g} Hz; a pseudo-terminal takes no time, so the board waits for as long as line and "
        f"answer would take at {BAUD} baud; the published figure is a mean at 12.5 Hz"
    )
    return of_samples(trips, FigureGoal(median=10.0), {"published": PUBLISHED}, note)


def round_trips(arm: ArmDescription, path: str) -> list[float]:
    """[ms] of every line that was answered."""
    exchange, reader, trips = TextExchange(), AnswerReader(), list[float]()
    target = [0.0] * len(arm.joints)
    with closing(open_port(path, BAUD)) as line:
        began = time.monotonic()
        for index in range(LINES):
            while (now := time.monotonic()) < began + index / RATE:
                time.sleep(max(0.0, began + index / RATE - now))
            payload = line_of(exchange.next_seq, target, arm.device.text_decimals)
            sent = time.monotonic()
            exchange.sent(payload, sent)
            line.write(payload)
            while not (answers := reader.feed(line.read(max(1, line.in_waiting)))):
                if time.monotonic() - sent > 1.0:
                    break
            trips += [1e3 * (time.monotonic() - sent) for answer in answers if exchange.on_answer(answer, sent)]
    return trips


class PacedBoard:
    """The firmware's core at the other end of a pseudo-terminal, as slow as its baud rate."""

    def __init__(self, arm: ArmDescription) -> None:
        self._end, self._other = os.openpty()
        tty.setraw(self._other)
        self.path = os.ttyname(self._other)
        self._device = CoreDevice(device_config(arm), now_us=1_000_000)
        self._device.attach_line()
        self._began = time.monotonic()
        self._is_on = True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._is_on = False
        self._thread.join()
        os.close(self._end)
        os.close(self._other)

    def _run(self) -> None:
        while self._is_on:
            is_there = bool(select.select([self._end], [], [], 0.01)[0])
            self._device.advance(1_000_000 + int((time.monotonic() - self._began) * 1e6))
            if is_there:
                data = os.read(self._end, 4096)
                self._take_time(len(data))
                self._device.receive_serial(data)
            said = b"".join(ANSWER.findall(self._device.take_serial()))
            if said:
                self._take_time(len(said))
                os.write(self._end, said)

    def _take_time(self, count: int) -> None:
        time.sleep(count * BITS_OF_A_BYTE / BAUD)


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


def our_share(arm: ArmDescription, name: str) -> float:
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


def seed_share(arm: ArmDescription, name: str) -> float:
    """Share [%] of the turn that the shaft makes when each message discards the rest of the last one."""
    joint = arm.joint(name)
    asked = joint.steps.to_steps(TURN)
    stepper = AustinStepper(speed=joint.steps.to_steps(joint.velocity), acceleration=TURNING[name])
    motor = VirtualMotor(joint.drive.motor)
    for moment, direction in pulses(stepper, relative_moves(int(asked), PERIOD, DURATION), DURATION):
        motor.run(moment)
        motor.pulse(direction)
    motor.run(DURATION + 1.0)
    return 100.0 * motor.shaft / asked


def turn(arm: ArmDescription, index: int) -> JointTrajectory:
    """The joint `index` from rest to rest on a quintic, the others at rest."""
    points = []
    for number in range(round(DURATION / 0.05) + 1):
        moment = number * 0.05
        x = moment / DURATION
        here = [0.0] * len(arm.joints)
        speed = [0.0] * len(arm.joints)
        here[index] = TURN * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        speed[index] = TURN / DURATION * 30.0 * (x * (1.0 - x)) ** 2
        points.append(TrajectoryPoint(positions=tuple(here), velocities=tuple(speed), time_from_start=moment))
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
