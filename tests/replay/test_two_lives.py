"""A gateway or planner that is killed and starts again while it is recorded: both of its lives are replayed."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.schemas.topics import DESCRIPTION, GATEWAY_INPUTS
from gemelo.services.state_publisher.main import describe
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.input_log import InputLog
from gemelo.services.stepper_gateway.inputs import BeganInput, LinkInput, StepInput
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Publish
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.replay.main import replay, text_of
from gemelo.tools.replay.recorded import NotReplayable
from gemelo.tools.replay.stepper_gateway import EARLIER, OUTSIDE
from gemelo.tools.virtual_arm.virtual_arm import UNIX, rm1
from tests.replay.conftest import Messages

PERIOD = 0.02  # [s]


class Life:
    """One process of the gateway, without a device; its messages and inputs go into `entries`."""

    def __init__(self, session: int, start: float, entries: list[Entry]) -> None:
        self.now, self._entries = start, entries
        began = BeganInput(session, GatewayParameters())
        core = GatewayCore(rm1(), session, began.parameters)
        self._log = InputLog(core, began, self.moment, lambda said: self._keep(GATEWAY_INPUTS, said))

    @property
    def moment(self) -> Moment:
        return Moment(UNIX + round(self.now * 1e9), 1000.0 + self.now)

    def run(self, seconds: float) -> None:
        for turn in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.give(StepInput())
            if turn % 50 == 0:
                self.give(LinkInput(turn % 100 == 0, "the broker is gone" if turn % 100 else ""))
            self._log.step(self.moment, True)

    def give(self, given) -> None:
        for output in self._log.handle(given, self.moment)[1]:
            if isinstance(output, Publish):
                self._keep(output.topic, output.message)

    def end(self) -> None:
        self._log.finish()

    def _keep(self, topic, message) -> None:
        self._entries.append(Entry(topic, message, self.moment.unix + 300_000))


def recorded(path: Path, entries: list[Entry]) -> Path:
    file = McapFile(path, {"deployment": {"json": '{"robot": "urdf/rm1"}'}})
    file.write([Entry(DESCRIPTION, describe(rm1()), UNIX), *entries])
    file.close()
    return path


def test_both_lives_are_the_same_again(tmp_path):
    entries: list[Entry] = []
    first = Life(11, 0.0, entries)
    first.run(15.3)  # its last inputs are lost with it
    second = Life(12, 20.0, entries)
    second.run(12.0)
    second.end()
    replayed = replay(recorded(tmp_path / "lives.mcap", entries), "stepper_gateway")
    assert replayed.difference is None, text_of(replayed)
    said = sum(entry.topic is not GATEWAY_INPUTS for entry in entries)
    alike = sum(count for topic, count in replayed.alike.items() if "/" in topic or topic == "control")
    assert alike > 20
    assert alike + replayed.aside.get(OUTSIDE, 0) == said


def test_a_message_that_the_first_life_never_said_is_found(tmp_path):
    entries: list[Entry] = []
    Life(11, 0.0, entries).run(15.3)
    events = [each for each in entries if each.topic.key == "device/events"]
    entries.insert(entries.index(events[3]), events[2])  # the same one twice
    found = replay(recorded(tmp_path / "lives.mcap", entries), "stepper_gateway").difference
    assert (found.topic, found.sequence) == ("device/events", 3)


def place_of(entry: Entry) -> tuple[int, int] | None:
    """Session and number of a message of inputs."""
    return (entry.message.session, entry.message.number) if entry.topic is GATEWAY_INPUTS else None


def test_a_recording_that_begins_in_the_middle_is_replayed_from_the_first_restart_on(tmp_path):
    entries: list[Entry] = []
    Life(11, 0.0, entries).run(15.3)
    second = Life(12, 20.0, entries)
    second.run(12.0)
    second.end()
    later = [
        entry for entry in entries if entry.arrival > UNIX + 5_000_000_000
    ]  # the first core's beginning is not in it
    later = [each for each in later if place_of(each) is None or place_of(each) > (11, 3)]
    replayed = replay(recorded(tmp_path / "later.mcap", later), "stepper_gateway")
    assert replayed.difference is None, text_of(replayed)
    assert replayed.aside[EARLIER] == sum(e.topic is GATEWAY_INPUTS and e.message.session == 11 for e in later) > 0
    assert replayed.alike["device/events"] == sum(
        each.topic.key == "device/events" and each.arrival > UNIX + 20_000_000_000 for each in later
    )


def test_a_second_life_whose_beginning_is_missing_is_refused(tmp_path):
    entries: list[Entry] = []
    Life(11, 0.0, entries).run(15.3)
    second = Life(12, 20.0, entries)
    second.run(12.0)
    second.end()
    entries = [each for each in entries if place_of(each) != (12, 0)]
    with pytest.raises(NotReplayable, match=r"number 0 is missing at .* \(those of a new process begin with 1\)"):
        replay(recorded(tmp_path / "hole.mcap", entries), "stepper_gateway")


def test_the_plans_of_both_lives_of_a_planner_are_made_again(changed):
    def alter(inputs, number):
        inputs["number"] -= 3 * (number > 2)

    comparison = replay(changed("planner", Messages("plan/inputs", alter)), "planner")
    assert comparison.difference is None
    assert comparison.alike["@request/plan"] > 3


def test_a_plan_whose_answer_was_lost_with_its_planner_is_left_out(changed):
    def alter(exchange, number):
        if number == 2:
            exchange["answer"] = None
            exchange["failure"] = {"kind": "lost", "message": "planner has ended", "why": None}

    comparison = replay(changed("planner", Messages("@request/plan", alter)), "planner")
    assert comparison.difference is None
    assert comparison.alike["@request/plan"] > 3
