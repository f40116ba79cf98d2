"""The measurement of the wire that `gemelo link bench` asks for, and what it makes of it."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gemelo.schemas.device import EchoResponse
from gemelo.tools.cli.device.link_bench import plot, result_of, text_of, write_csv
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
    assert "answers nothing" in echo(SketchArm().referenced()).reason


def test_the_figures_the_table_and_the_files(tmp_path: Path) -> None:
    trips = [0.004, 0.006, None, 0.005, 0.005]
    result = result_of(trips, 25.0, 0.2)
    assert (result.count, result.lost, result.reached) == (5, 1, 25.0)
    assert result.median == pytest.approx(5.0)
    assert result.p99 == pytest.approx(6.0)
    assert result.jitter == pytest.approx(1.0)
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
    result = result_of([None, None], 25.0, 1.0)
    assert (result.lost, result.median) == (2, None)
    assert plot([None])
