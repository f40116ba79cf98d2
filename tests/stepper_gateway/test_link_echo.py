"""The measurement of the wire that `gemelo link bench` asks for, and what it makes of it."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gemelo.schemas.device import EchoResponse
from gemelo.tools.cli.device.link_bench import Measured, plot, result_of, text_of, write_csv
from gemelo.tools.virtual_arm.gateway_driver import EchoInput, GatewayDriver
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire


def echo(arm: GatewayDriver, ticket: int = 1) -> EchoResponse:
    arm.handle(EchoInput(ticket))
    assert arm.run(3.0, lambda: ticket in arm.echoed)
    return arm.echoed.pop(ticket)


def test_a_round_trip_is_what_the_wire_takes_both_ways() -> None:
    answer = echo(VirtualArm(VirtualWire(delay=0.007)).ready())
    assert answer.answered
    assert answer.round_trip == pytest.approx(0.014, abs=0.0021)


def test_a_measurement_moves_nothing() -> None:
    arm = VirtualArm().ready()
    before = arm.device.steps
    for ticket in range(25):
        echo(arm, ticket)
    assert arm.device.steps == before
    assert not [kind for _, kind, _ in arm.sent if kind == "traj"]


def test_an_answer_that_does_not_come_is_lost_after_a_second() -> None:
    arm = VirtualArm().ready()
    arm.lost.add("sync/r")
    answer = echo(arm)
    assert not answer.answered
    assert "no answer in 1 s" in answer.reason


def test_a_sketch_cannot_be_measured_and_the_reason_is_said() -> None:
    reason = echo(SketchArm().referenced()).reason
    assert "answers nothing" in reason
    assert '"loop_us" in ra/sensores' in reason


@pytest.mark.parametrize(("micros", "verdict"), [(143, "which is enough"), (260, "so write loop_time = 0.000260")])
def test_the_pass_of_a_sketch_is_what_its_telemetry_says(micros: int, verdict: str) -> None:
    arm = SketchArm().referenced()
    arm.sketch.sensors = b'{"ultra": 42, "loop_us": 90}'
    arm.run(0.3)
    arm.sketch.sensors = b'{"ultra": 42, "loop_us": %d}' % micros
    arm.run(0.3)
    assert f"took {micros} us, robot.toml says 200 us, {verdict}" in echo(arm).reason
    arm.sketch.sensors = b'{"ultra": 42}'
    arm.run(11.0)
    assert "loop_us" in echo(arm).reason, "what it said before has passed"


def test_the_figures_the_table_and_the_files(tmp_path: Path) -> None:
    trips: list[float | None] = [0.004, 0.006, None, 0.005, 0.005]
    result = result_of(Measured(trips, [0.03, 0.02, 0.025, 0.03], 0.2), 25.0)
    assert (result.count, result.lost, result.reached) == (5, 1, 25.0)
    assert result.median == pytest.approx(5.0)
    assert result.p99 == pytest.approx(6.0)
    assert result.jitter == pytest.approx(1.0)
    assert result.waiting == pytest.approx(27.5)
    assert "27.500 ms until the board's next line" in text_of(result, tmp_path)
    assert "1 of 5" in text_of(result, tmp_path)
    assert "29.8" in text_of(result, tmp_path)
    write_csv(tmp_path / "bench.csv", trips, 25.0)
    with (tmp_path / "bench.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[3] == ["2", "0.080", ""]
    drawn = ElementTree.fromstring(plot(trips))
    circles = [each for each in drawn.iter() if each.tag.endswith("circle")]
    assert [circle.get("fill") for circle in circles].count("#e03131") == 1
    assert len(circles) == 5


def test_nothing_but_losses_gives_no_figures() -> None:
    result = result_of(Measured([None, None], [], 1.0), 25.0)
    assert (result.lost, result.median) == (2, None)
    assert plot([None])
