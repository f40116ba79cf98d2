"""The promise of the device: whatever the link does, every step is made, once."""

from __future__ import annotations

import math
import random

from bench_firmware import FIRST, LAST, Bench, Row, rm1_config, smooth, traj

from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import DeviceConfig, JointConfig

OK, DUPLICATE, GAP, NO_SPACE = 0, 1, 2, 3
HALF_A_STEP = 128  # [1/256 step]


def fast_config() -> DeviceConfig:
    def joint(name: str) -> JointConfig:
        limit = 20_000 * 256
        return JointConfig(
            name=name, lower_q8=-(1 << 30), upper_q8=1 << 30, max_velocity_q8=limit, max_acceleration_q8=limit * 4
        )

    return DeviceConfig(name="bench", joints=(joint("q1"), joint("q2")))


class BadLink:
    """Loses 10 % of the chunks on their way there, and brings 20 % of them twice."""

    def __init__(self, bench: Bench, seed: int) -> None:
        self.bench = bench
        self.random = random.Random(seed)
        self.sent = self.lost = self.doubled = 0

    def send(self, frame: bytes) -> int | None:
        """The sequence number that the device wants next, or None when nothing came back."""
        self.sent += 1
        if self.random.random() < 0.1:
            self.lost += 1
            return None
        ack = self.bench.send(frame)
        assert ack is not None
        assert ack.code in (OK, DUPLICATE, GAP, NO_SPACE), ack
        if self.random.random() < 0.2:
            self.doubled += 1
            again = self.bench.send(frame)
            assert again is not None
            assert again.code == (DUPLICATE if ack.code in (OK, DUPLICATE) else ack.code)
        return ack.next_seq


def stream_over(link: BadLink, stream: int, rows: list[Row], size: int) -> None:
    """Send a whole stream as a gateway would: ahead of the device, again where it says so."""
    chunks = [rows[i : i + size] for i in range(0, len(rows), size)]
    wanted, bench = 0, link.bench
    while bench.device.mode != DeviceMode.IDLE or wanted == 0:
        for seq in range(wanted, min(wanted + 3, len(chunks))):
            flags = (FIRST if seq == 0 else 0) | (LAST if seq == len(chunks) - 1 else 0)
            answer = link.send(traj(stream, seq, chunks[seq], flags))
            wanted = wanted if answer is None else answer
        bench.run(40)


def test_a_million_random_steps_over_a_link_that_loses_and_repeats_are_made_to_the_step():
    bench = Bench(fast_config())
    link = BadLink(bench, seed=20)
    position, travelled, stream = [0, 0], 0, 0
    while travelled < 1_000_000:
        stream += 1
        goal = [link.random.randint(-40_000, 40_000) for _ in position]
        longest = max(abs(b - a) for a, b in zip(position, goal, strict=True))
        knots = max(3, round(max(longest / 9_000, 0.1) / 0.02)) + 1
        rows: list[Row] = []
        for i in range(knots):
            points = [smooth(a, b, knots - 1, i) for a, b in zip(position, goal, strict=True)]
            rows.append(([round(p * 256) for p, _ in points], [round(v * 50 * 256) for _, v in points]))
        stream_over(link, stream, rows, size=link.random.randint(4, 25))
        assert bench.device.steps == tuple(goal)
        travelled += sum(abs(b - a) for a, b in zip(position, goal, strict=True))
        position = goal
    assert bench.device.max_slot_error <= HALF_A_STEP
    assert link.lost > 0.09 * link.sent
    assert link.doubled > 0.18 * (link.sent - link.lost)


def steps_of_the_seed(acceleration: float, period: float = 0.1) -> int:
    """Where the seed's sketch ends when a far target is followed by repeats every `period` [s].

    AccelStepper's `move()` counts from the CURRENT position, so the second message ("no further move") throws away
    what is left of the first: the motor gets as far as it accelerates in one period, and as far again to stop.
    Step intervals as in Austin, "Generate stepper-motor speed profiles in real time" (2005); [steps/s^2].
    """
    interval, t, n = 0.676 * math.sqrt(2 / acceleration), 0.0, 0
    while t < period:
        n += 1
        interval -= 2 * interval / (4 * n + 1)
        t += interval
    return 2 * n


def test_a_90_degree_move_streamed_at_10_hz_arrives_whole_where_the_seed_lost_99_percent():
    assert steps_of_the_seed(acceleration=3110) == 48  # q1: 0.926 of the 90 degrees
    assert steps_of_the_seed(acceleration=100) == 4  # q2: 3.6 degrees

    bench = Bench(rm1_config())
    asked = (4665.6, 100.0)  # 90 degrees of q1 and of q2
    rows: list[Row] = []
    for i in range(251):
        (p1, v1), (p2, v2) = (smooth(0, steps, 5.0, i * 0.02) for steps in asked)
        rows.append(([round(p1 * 256), round(p2 * 256), 0], [round(v1 * 256), round(v2 * 256), 0]))
    for seq in range(51):  # 5 knots of 20 ms, ten times a second, 1.3 s ahead
        ack = bench.send(
            traj(1, seq, rows[seq * 5 : seq * 5 + 5], (FIRST if seq == 0 else 0) | (LAST if seq == 50 else 0))
        )
        assert ack is not None
        assert ack.code == OK
        bench.run(100 if seq > 12 else 0)
    bench.run(3000)
    assert bench.device.mode == DeviceMode.IDLE
    assert bench.device.steps == (4666, 100, 0)  # 4665.6 to the nearest step
    assert bench.device.max_slot_error <= HALF_A_STEP


def test_a_chunk_carries_every_joint_and_one_that_does_not_is_refused():
    bench = Bench(rm1_config())
    two_of_three = traj(1, 0, [((0, 0), (0, 0))], FIRST)
    ack = bench.send(two_of_three)
    assert ack is not None
    assert ack.code == 11  # BAD_JOINTS
    assert bench.device.mode == DeviceMode.IDLE
