"""Six joints at 50 knots a second: ten minutes in virtual time, and in real time through mosquitto.

`GEMELO_SIX_JOINTS_SECONDS=60 pytest tests/firmware/test_six_joints.py -s` is the real minute.
"""

from __future__ import annotations

import math
import os
import struct
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import pytest
from bed_firmware import Bed, open_bed, wait_for
from bench_firmware import FIRST, LAST, Bench, Row, traj

from gemelo.libraries.arm.device.device_config import device_config, reference_steps
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import DeviceConfig
from gemelo.schemas.robot import Motor, PullOut

SECONDS = 600
REAL_SECONDS = int(os.environ.get("GEMELO_SIX_JOINTS_SECONDS", "10"))
DT, CHUNK, AHEAD = 0.02, 10, 1.5  # [s], knots, [s]
PERIOD = 4.0  # [s] of the swing
HALF_A_STEP = 128  # [1/256 step]
OK, NO_SPACE = 0, 3
# Of a NEMA 17 with 32 microsteps; nobody has measured PAROL6's.
CURVE = PullOut(speed=(0.0, 16_000.0, 32_000.0, 64_000.0), torque=(0.45, 0.4, 0.25, 0.1), inertia=1e-5, friction=0.02)
RESTS_WITHIN = 2  # [steps] asin(0.02 / 0.45) of a cycle of 128


@pytest.fixture(scope="module")
def parol6(rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder.parent / "parol6")


def motors(arm: ArmDescription) -> list[Motor]:
    return [msgspec.structs.replace(joint.drive.motor, pull_out=CURVE) for joint in arm.joints]


def swing(config: DeviceConfig, middle: Sequence[int], seconds: float) -> Iterator[tuple[int, list[Row], int]]:
    """Chunks of a swing of all joints about `middle`, from rest to rest: number, rows and flags."""
    rate, knots = math.tau / PERIOD, round(seconds / DT)
    widths = [_width(config, j, here, rate) for j, here in enumerate(middle)]
    for number, first in enumerate(range(0, knots + 1, CHUNK)):
        rows: list[Row] = []
        for k in range(first, min(first + CHUNK, knots + 1)):
            angle = rate * k * DT
            position = [round((m + w * (1 - math.cos(angle))) * 256) for m, w in zip(middle, widths, strict=True)]
            rows.append((position, [round(w * rate * math.sin(angle) * 256) for w in widths]))
        flags = (FIRST if first == 0 else 0) | (LAST if first + CHUNK > knots else 0)
        if flags & FIRST:
            rows[0] = (rows[0][0], [0] * len(middle))
        if flags & LAST:
            rows[-1] = (rows[-1][0], [0] * len(middle))
        yield number, rows, flags


def _width(config: DeviceConfig, j: int, here: int, rate: float) -> float:
    """[steps] half of the swing: within the way to the farther limit, and 0.6 of the velocity and acceleration."""
    joint = config.joints[j]
    up, down = joint.upper_q8 / 256 - here, here - joint.lower_q8 / 256
    fastest = 0.6 * min(joint.max_velocity_q8 / rate, joint.max_acceleration_q8 / rate**2) / 256
    return min(fastest, 0.45 * up) if up >= down else -min(fastest, 0.45 * down)


@pytest.mark.full
def test_ten_minutes_of_six_joints_make_every_step_at_the_shafts_too(parol6: ArmDescription):
    config, middle = device_config(parol6), reference_steps(parol6)
    bench = Bench(config, motors=motors(parol6), steps=middle)
    bench.run(config.enable_lead_ms + 100)
    began, cpu = bench.device.now_us, time.process_time()
    for number, rows, flags in swing(config, middle, SECONDS):
        due = number * CHUNK * DT - AHEAD
        bench.run(max(0, round(began / 1e3 + due * 1e3 - bench.device.now_us / 1e3)))
        ack = bench.send(traj(1, number, rows, flags))
        assert ack is not None
        assert ack.code == OK, ack
    bench.run(round((AHEAD + 1.0) * 1000))
    cpu = time.process_time() - cpu
    print(f"\n{SECONDS} s of six joints: {cpu:.1f} s of CPU, {cpu / SECONDS * 100:.2f} % of a core")
    assert bench.device.mode == DeviceMode.IDLE
    assert "underrun" not in bench.names()
    assert bench.names()[-1] == "finished"
    assert bench.device.steps == middle
    assert max(abs(a - b) for a, b in zip(bench.device.shaft, middle, strict=True)) <= RESTS_WITHIN
    assert bench.device.max_slot_error <= HALF_A_STEP
    assert cpu < 60.0


def cpu_seconds(pid: int) -> float:
    """[s] of CPU that a process has used so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def steps_in(state: bytes) -> tuple[int, ...]:
    """Each joint's steps in a STATE frame."""
    return struct.unpack(f"<{state[3]}i", state[60 : 60 + 4 * state[3]])


class Lateness:
    """How much later than the quickest of them the device's states arrive [s]."""

    def __init__(self) -> None:
        self._delays: list[float] = []
        self.underruns = 0

    def take(self, arrived: float, state: bytes) -> None:
        self._delays.append(arrived - struct.unpack("<Q", state[8:16])[0] / 1e6)
        self.underruns = struct.unpack("<I", state[40:44])[0]

    def quantile(self, share: float) -> float:
        ordered = sorted(self._delays)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))] - ordered[0]


@pytest.fixture
def six(tmp_path: Path) -> Iterator[Bed]:
    with open_bed(tmp_path, "parol6", "urdf/parol6") as bed:
        yield bed


@pytest.mark.full
def test_six_joints_in_real_time_through_mosquitto_make_every_step(six: Bed, parol6: ArmDescription):
    config, middle = device_config(parol6), reference_steps(parol6)
    six.start_device()
    boot, process = six.status["boot_id"], six.process
    assert isinstance(boot, int)
    assert process is not None
    time.sleep(config.enable_lead_ms / 1e3 + 0.1)
    lateness = Lateness()
    cpu, began = cpu_seconds(process.pid), time.monotonic()
    with six.beating():
        for number, rows, flags in swing(config, middle, REAL_SECONDS):
            time.sleep(max(0.0, began + number * CHUNK * DT - AHEAD - time.monotonic()))
            chunk = traj(1, number, rows, flags, boot=boot)
            six.publish("traj", chunk)
            while (code := six.answer("traj/ack")[20]) == NO_SPACE:  # the machine has kept the device waiting
                time.sleep(DT)
                six.publish("traj", chunk)
            assert code == OK
        assert six.event("finished")["stream"] == 1
        cpu, took = cpu_seconds(process.pid) - cpu, time.monotonic() - began
    end = [(position + HALF_A_STEP) >> 8 for position in rows[-1][0]]
    wait_for(lambda: list(steps_in(six.states[-1][1])) == end, f"a state that has the end's steps, {end}")
    for arrived, state in six.states:
        lateness.take(arrived, state)
    print(
        f"\n{took:.0f} s of six joints through mosquitto: {cpu / took * 100:.1f} % of a core; states late by "
        f"{lateness.quantile(0.5) * 1e3:.1f} ms (median), {lateness.quantile(0.99) * 1e3:.1f} ms (p99)"
    )
    assert lateness.underruns == 0
    report = six.shaft()
    assert report["steps"] == report["shaft"] == end
