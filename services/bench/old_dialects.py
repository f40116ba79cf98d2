"""Figures of the dialects that people's boards speak already: remainders, and the text line's round trip."""

from __future__ import annotations

import json
import os
import random
import re
import select
import threading
import time
import tty
from contextlib import closing
from dataclasses import replace

import msgspec

from firmware.bindings.device import Device
from firmware.platform.host.sketch import Sketch
from schemas.robot import Dialect
from services.arm.device.device_config import device_config
from services.arm.model.description import Arm, heard_by_the_board
from services.arm.motors.relative_moves import ramp_of
from services.bench.figures import Figure, Goal, of_samples
from services.bench.scenes import rm1
from services.stepper_gateway.links.foreign.ra_messages import joints_message
from services.stepper_gateway.links.foreign.text_exchange import TextExchange
from services.stepper_gateway.links.foreign.text_messages import AnswerReader, line_of
from services.stepper_gateway.links.serial_port import open_port

MESSAGES = 10_000
LARGEST_MOVE = 20_000  # [steps] more than a turn of rm1's first joint
BAUD = 115_200
ANSWER = re.compile(rb"<[AN][^>]*>\n")  # the frames of our own protocol between them are left out
BITS_OF_A_BYTE = 10  # 8N1
LINES = 200
RATE = 25.0  # [Hz]
PUBLISHED = 29.8  # [ms] mean of the old driver, at 12.5 Hz


def ra_remainder_steps() -> Figure:
    """Commanded steps minus those that a sketch makes of random messages, the largest of all joints [steps]."""
    rng = random.Random(3)
    ramps = tuple(ramp_of(joint.drive) for joint in rm1().joints)
    worst = 0
    for truncates in (True, False):
        sketch, left = Sketch(ramps, truncates), [0] * len(ramps)
        for _ in range(MESSAGES):
            move = [rng.randint(-LARGEST_MOVE, LARGEST_MOVE) for _ in ramps]
            message = json.loads(joints_message(move, ramps, False))
            left = [
                old + steps - sketch.steps(message[ramp.name], ramp)
                for old, steps, ramp in zip(left, move, ramps, strict=True)
            ]
        worst = max(worst, *map(abs, left))
    note = f"of {MESSAGES} random messages to a sketch that truncates and to one that rounds, with floats of 24 bits"
    return Figure(median=worst, p99=worst, goal="0", met=worst == 0, note=note)


def text_link_ms() -> Figure:
    """Round trip [ms] of `<SEQ,...>` at 25 Hz, over a pseudo-terminal, to the firmware's text mode."""
    device = msgspec.structs.replace(rm1().device, dialect=Dialect.TEXT)
    arm = heard_by_the_board(replace(rm1(), device=device))
    with closing(PacedBoard(arm)) as board:
        trips = round_trips(arm, board.path)
    note = (
        f"{LINES} lines at {RATE:g} Hz; a pseudo-terminal takes no time, so the board waits for as long as line and "
        f"answer would take at {BAUD} baud; the published figure is a mean at 12.5 Hz"
    )
    return of_samples(trips, Goal(median=10.0), {"published": PUBLISHED}, note)


def round_trips(arm: Arm, path: str) -> list[float]:
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

    def __init__(self, arm: Arm) -> None:
        self._end, self._other = os.openpty()
        tty.setraw(self._other)
        self.path = os.ttyname(self._other)
        self._device = Device(device_config(arm), now_us=1_000_000)
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
