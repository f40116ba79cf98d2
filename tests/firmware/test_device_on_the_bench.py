"""The binding, the shared vectors, starvation and heartbeats through Python."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from bench_firmware import FIRST, LAST, Bench, Row, command, rm1_config, smooth, traj
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.bindings.device import ConfigError, CoreDevice
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import DeviceConfig, JointConfig
from tests.profiles import examples
from tests.table import table

VECTORS = Path(__file__).resolve().parents[2] / "firmware/tests/vectors"
HOLD, RESUME, STOP = 1, 2, 3


def vectors() -> list[Any]:
    files = sorted(VECTORS.glob("*.json"))
    cases = [case for file in files if file.name != "device.json" for case in json.loads(file.read_text())]
    return [pytest.param(case, id=case["name"]) for case in cases]


def vector_device() -> CoreDevice:
    described = json.loads((VECTORS / "device.json").read_text())
    return CoreDevice(msgspec.convert(described["config"], DeviceConfig), boot_id=described["boot_id"])


@table("case", vectors())
def test_every_shared_vector_is_answered_as_expected(case: dict[str, Any]):
    device = vector_device()
    device.take()
    device.receive(bytes.fromhex(case["frame"]), case["retained"])
    answers = [frame for frame in device.take() if frame.kind not in ("event", "status")]
    expected = case["expected"]
    assert [frame.kind for frame in answers] == ([expected["answer"]] if expected["answer"] else [])
    if expected["answer"] == "traj/ack":
        assert answers[0].payload[20] == expected["code"]
    elif expected["answer"] == "cmd/ack":
        assert answers[0].payload[13] == expected["code"]


def rows_of_a_move(goal: int, duration: float) -> list[Row]:
    knots = round(duration * 50) + 1
    points = [smooth(0, goal, duration, i * 0.02) for i in range(knots)]
    return [([round(p * 256), 0, 0], [round(v * 256), 0, 0]) for p, v in points]


def test_a_starved_device_stands_on_its_last_knot_and_goes_on_when_fed():
    bench = Bench(rm1_config())
    rows = rows_of_a_move(2000, 3.0)
    bench.send(traj(1, 0, rows[:60], FIRST))
    bench.run(5000)
    assert bench.names().count("underrun") == 1
    assert bench.device.commanded_q8 == tuple(rows[59][0])
    assert bench.device.mode == DeviceMode.RUN
    bench.send(traj(1, 1, rows[60:], LAST))
    bench.run(6000)
    assert bench.device.mode == DeviceMode.IDLE
    assert bench.device.steps == (2000, 0, 0)
    assert bench.names()[-2:] == ["resumed", "finished"]
    assert bench.device.max_slot_error <= 128


def test_a_silent_gateway_holds_the_arm_on_its_path_until_a_person_resumes():
    bench = Bench(rm1_config())
    bench.send(traj(1, 0, rows_of_a_move(2000, 2.5), FIRST | LAST))
    bench.run(600)
    bench.run(3000, silent=True)
    assert bench.device.mode == DeviceMode.HOLD
    assert bench.device.time_scale == 0
    assert [event["detail"] for event in bench.events if event["event"] == "hold"] == ["heartbeat"]
    stood = bench.device.steps
    assert 0 < stood[0] < 2000
    bench.run(3000)
    assert bench.device.steps == stood
    bench.send(command(RESUME, 1))
    bench.run(6000)
    assert bench.device.steps == (2000, 0, 0)


def test_a_stop_ends_the_stream_on_the_path_and_the_next_one_starts_there():
    bench = Bench(rm1_config())
    bench.send(traj(1, 0, rows_of_a_move(2000, 2.5), FIRST | LAST))
    bench.run(1000)
    bench.send(command(STOP, 1))
    bench.run(2000)
    assert bench.device.mode == DeviceMode.IDLE
    assert bench.names()[-1] == "stopped"
    at = bench.device.steps[0]
    ack = bench.send(traj(2, 0, [([at * 256, 0, 0], [0, 0, 0])], FIRST | LAST))
    assert ack is not None
    assert ack.code == 0


@examples(full=200)
@given(st.binary(max_size=300), st.booleans())
def test_no_bytes_at_all_move_a_device(data: bytes, retained: bool):
    device = vector_device()
    device.receive(data, retained)
    device.advance(100_000)
    assert device.steps == (0, 0)
    assert device.mode == DeviceMode.IDLE


def one_joint(lower_q8: int, upper_q8: int) -> DeviceConfig:
    joint = JointConfig(name="q1", lower_q8=lower_q8, upper_q8=upper_q8, max_velocity_q8=1, max_acceleration_q8=1)
    return DeviceConfig(name="x", joints=(joint,))


def test_a_configuration_that_cannot_be_is_refused_with_the_joint_and_the_reason():
    with pytest.raises(ConfigError, match="'q1' of device 'x': its lower limit is not below its upper limit"):
        CoreDevice(one_joint(5, 5))
    with pytest.raises(ConfigError, match="2 start positions for 1 joints"):
        CoreDevice(one_joint(0, 5), steps=(1, 2))
