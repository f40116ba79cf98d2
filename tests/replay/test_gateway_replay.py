"""The gateway's core again: what is noticed, and what cannot be replayed."""

from __future__ import annotations

import base64
import inspect
import zlib
from typing import get_args

import msgspec
import pytest

from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import GRIPPER_STATE
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import FrameInput, Given, GoalInput, Input, packed, unpacked
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.outputs import GoalFinished, LogLine, Publish
from gemelo.services.stepper_gateway.shell import Shell
from gemelo.tools.replay.main import replay
from gemelo.tools.replay.recorded import NotReplayable
from tests.replay.conftest import RECORDINGS, Messages

GATEWAY = "stepper_gateway"
INPUTS = "device/inputs"


def altered(change):
    """A change of the inputs: `change(given, number)` returns another input, number counts all of them."""
    count = -1

    def alter(content, _number):
        nonlocal count
        kept = []
        for given in unpacked(base64.b64decode(content["inputs"])):
            count += 1
            kept.append(msgspec.msgpack.encode(change(given, count)))
        content["inputs"] = base64.b64encode(packed(kept)).decode()

    return Messages(INPUTS, alter)


def flipped(kind: Kind, which: int, place: int, mended: bool = False):
    """One bit of one byte of one frame from the device; `mended`: with the CRC-32 that is right then."""
    seen = 0

    def change(given: Given, _number: int) -> Given:
        nonlocal seen
        if isinstance(given.input, FrameInput) and given.input.kind is kind:
            seen += 1
            if seen == which:
                payload = bytearray(given.input.payload)
                payload[place] ^= 1
                if mended:
                    payload[-4:] = zlib.crc32(payload[:-4]).to_bytes(4, "little")
                return msgspec.structs.replace(
                    given, input=msgspec.structs.replace(given.input, payload=bytes(payload))
                )
        return given

    return altered(change)


@pytest.mark.parametrize("place", [0, 9, 20, 40, -1])
def test_one_bit_of_one_frame_of_the_device_is_found(changed, place):
    found = replay(changed(GATEWAY, flipped(Kind.STATE, 200, place)), GATEWAY).difference
    assert found is not None
    assert found.at > 1.0


def test_one_step_of_one_joint_of_the_device_is_named(changed):
    """A state ends with velocities (3 x 4 bytes), the servo's pulses (4) and the CRC (4): firmware/PROTOCOL.md."""
    found = replay(changed(GATEWAY, flipped(Kind.STATE, 200, -24, mended=True)), GATEWAY).difference
    assert (found.topic, found.path) == ("device/state", "steps[2]")
    assert abs(int(found.recorded) - int(found.replayed)) == 1


def test_an_acknowledgement_that_is_another_is_found(changed):
    assert replay(changed(GATEWAY, flipped(Kind.TRAJ_ACK, 50, 8)), GATEWAY).difference is not None


def test_an_answer_of_the_devices_clock_that_came_a_tenth_of_a_millisecond_later_is_found(changed):
    seen = 0

    def later(given, _number):
        nonlocal seen
        if isinstance(given.input, FrameInput) and given.input.kind is Kind.SYNC_R:
            seen += 1
            if seen == 3:
                arrival = given.input.arrival + 100_000
                return msgspec.structs.replace(given, input=msgspec.structs.replace(given.input, arrival=arrival))
        return given

    assert replay(changed(GATEWAY, altered(later)), GATEWAY).difference is not None


def test_a_core_with_another_lead_is_found_in_what_it_sends(monkeypatch):
    init = GatewayCore.__init__

    def other(core, arm, session, parameters, kept):
        init(core, arm, session, msgspec.structs.replace(parameters, trajectory_lead=0.32), kept)

    monkeypatch.setattr(GatewayCore, "__init__", other)
    found = replay(RECORDINGS / "stepper_gateway.mcap", GATEWAY).difference
    assert found.topic in ("commands", "frames, results, answers and log lines")


def test_a_core_that_logs_another_word_is_found_by_its_digest(changed_core):
    def another_word(given, outputs):
        return [*outputs, LogLine(LogLevel.INFO, "another word")] if isinstance(given, GoalInput) else outputs

    changed_core(another_word)
    found = replay(RECORDINGS / "stepper_gateway.mcap", GATEWAY).difference
    assert (found.topic, found.path) == ("frames, results, answers and log lines", "outputs of Goal")
    assert "another word" in found.replayed


def test_another_result_of_a_goal_is_named_by_its_field(changed_core):
    def renamed(ended):
        return GoalFinished(ended.goal_id, ended.status, msgspec.structs.replace(ended.result, error_string="another"))

    changed_core(lambda _, outputs: [renamed(each) if isinstance(each, GoalFinished) else each for each in outputs])
    found = replay(RECORDINGS / "stepper_gateway.mcap", GATEWAY).difference
    assert (found.topic, found.path) == ("follow_joint_trajectory/ended", "result.error_string")
    assert found.replayed == "another"


def test_a_core_that_says_nothing_any_more_is_found(changed_core):
    """Of a LATEST topic the recorder may lack what was said, but the core must not lack what was recorded."""
    changed_core(lambda _, outputs: [each for each in outputs if not is_gripper(each)])
    found = replay(RECORDINGS / "stepper_gateway.mcap", GATEWAY).difference
    assert (found.topic, found.replayed) == ("gripper_state", "(nothing)")


def is_gripper(output):
    return isinstance(output, Publish) and output.topic is GRIPPER_STATE


def test_a_core_that_ends_by_an_error_is_shown_with_it(changed_core):
    def broken(given, outputs):
        if isinstance(given, GoalInput):
            raise ZeroDivisionError("by zero")
        return outputs

    changed_core(broken)
    found = replay(RECORDINGS / "stepper_gateway.mcap", GATEWAY).difference
    assert found.replayed == "the core ends by ZeroDivisionError: by zero"


@pytest.fixture
def changed_core(monkeypatch):
    """Has every core return what `change(given, outputs)` makes of its outputs."""

    def with_change(change):
        handle = GatewayCore.handle

        def other(core, given, moment):
            reply, outputs = handle(core, given, moment)
            return reply, change(given, outputs)

        monkeypatch.setattr(GatewayCore, "handle", other)

    return with_change


def test_inputs_that_are_missing_are_refused(changed):
    def alter(content, number):
        content["number"] += number > 5

    with pytest.raises(NotReplayable, match=r"device/inputs number 6 is missing at .* s \(after 5 comes 7\)"):
        replay(changed(GATEWAY, Messages(INPUTS, alter)), GATEWAY)


def test_a_recording_that_begins_in_the_middle_of_the_gateways_life_is_refused(changed):
    with pytest.raises(NotReplayable, match="restart stepper_gateway while it is recorded, with"):
        replay(changed(GATEWAY, Messages(INPUTS, lambda _, number: number > 2)), GATEWAY)


def test_inputs_of_another_version_are_refused(changed):
    def alter(content, number):
        if number == 3:
            content["inputs"] = base64.b64encode(packed([msgspec.msgpack.encode(["Unknown"])])).decode()

    with pytest.raises(NotReplayable, match=r"device/inputs number 3 cannot be read here: .*make recordings"):
        replay(changed(GATEWAY, Messages(INPUTS, alter)), GATEWAY)


def test_every_way_into_the_core_is_an_input_that_a_recording_keeps():
    """The other public names change nothing."""
    public = {name for name in vars(GatewayCore) if not name.startswith("_")}
    assert public == {
        "handle", "is_state_due", "ledger_record", "not_ready", "prepare_goal", "scenes_dropped", "watched_clients",
    }  # fmt: skip
    handled, shell = inspect.getsource(GatewayCore.handle), inspect.getsource(Shell)
    assert [kind.__name__ for kind in get_args(Input) if f"case {kind.__name__}(" not in handled] == []
    assert "_inputs.handle(" in shell
    assert "_core.handle(" not in shell
