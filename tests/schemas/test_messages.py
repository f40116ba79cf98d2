"""Every message: unknown fields are ignored, missing ones take defaults, nothing that is not finite gets in."""

from __future__ import annotations

import contextlib
import math
import struct
from functools import cache
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.joints import JointState
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import JointGoal, NamedGoal, PlannedPath, PlanRequest, PoseGoal
from gemelo.schemas.system import Parameters, SetParameter
from tests.schemas.samples import messages, sample
from tests.table import table

KINDS = st.sampled_from(messages())
NOT_FINITE = st.sampled_from([math.nan, math.inf, -math.inf])
SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text() | st.binary()
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=8)


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_it_comes_back_as_it_went(kind: type[Message]) -> None:
    message = sample(kind)
    assert encode(decode(kind, encode(message))) == encode(message)


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_missing_fields_take_their_defaults(kind: type[Message]) -> None:
    assert encode(decode(kind, msgspec.msgpack.encode(_tagged(kind, {})))) == encode(kind())


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_it_is_frozen_documented_and_has_defaults(kind: type[Message]) -> None:
    assert kind.__struct_config__.frozen
    assert kind.__doc__
    assert not any(field.required for field in msgspec.structs.fields(kind))


@given(KINDS, st.dictionaries(st.text(min_size=1).map(lambda name: f"x_{name}"), VALUES, max_size=3))
def test_unknown_fields_are_ignored(kind: type[Message], unknown: dict[str, object]) -> None:
    known = msgspec.msgpack.decode(encode(sample(kind)))
    assert encode(decode(kind, msgspec.msgpack.encode(known | unknown))) == encode(sample(kind))


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_unknown_fields_are_ignored_at_any_depth(kind: type[Message]) -> None:
    grown = _with_an_unknown_field(msgspec.msgpack.decode(encode(sample(kind))))
    assert encode(decode(kind, msgspec.msgpack.encode(grown))) == encode(sample(kind))


def test_missing_fields_take_their_defaults_at_any_depth() -> None:
    goal, trajectory = {"type": "joints"}, {"points": [{"positions": [1.0]}]}
    assert decode(PlanRequest, msgspec.msgpack.encode({"goal": goal, "start": {}})) == PlanRequest(
        goal=JointGoal(), start=JointState()
    )
    assert decode(FollowJointTrajectoryGoal, msgspec.msgpack.encode({"trajectory": trajectory})).trajectory == (
        JointTrajectory(points=(TrajectoryPoint(positions=(1.0,)),))
    )


@table(
    ("kind", "fields"),
    [
        (PlanRequest, {"goal": {"type": "pose", "position": [0.1, math.nan, 0.1]}}),
        (PlanRequest, {"goal": {"type": "joints", "name": ["brazo_joint"], "position": [math.inf]}}),
        (PlanRequest, {"start": {"name": ["brazo_joint"], "position": [math.nan]}}),
        (FollowJointTrajectoryGoal, {"path_tolerance": [{"name": "brazo_joint", "position": -math.inf}]}),
        (PlannedPath, {"points": [[0.0, 0.0, math.nan]]}),
        (SetParameter, {"name": "rate", "value": math.nan}),
        (Parameters, {"parameters": [{"name": "rate", "maximum": math.inf}]}),
    ],
)
def test_what_is_not_finite_is_refused_in_nests_unions_and_optional_fields(
    kind: type[Message], fields: dict[str, object]
) -> None:
    with pytest.raises(BadMessage, match="finite"):
        decode(kind, msgspec.msgpack.encode(fields))


def test_a_single_precision_nan_is_none_either() -> None:
    payload = msgspec.msgpack.encode({"position": [1.5]}).replace(
        b"\xcb" + struct.pack(">d", 1.5), b"\xca" + struct.pack(">f", math.nan)
    )
    with pytest.raises(BadMessage, match=r"position\[0\].* is nan"):
        decode(JointState, payload)


@given(st.data(), NOT_FINITE)
def test_a_float_that_is_not_finite_is_refused_wherever_it_stands(data: st.DataObject, value: float) -> None:
    kind = data.draw(st.sampled_from(list(floats_of_all())))
    payload, places = floats_of_all()[kind]
    payload = bytearray(payload)
    place = data.draw(st.sampled_from(places))
    struct.pack_into(">d", payload, place, value)
    with pytest.raises(BadMessage, match="finite"):
        decode(kind, bytes(payload))


@given(NOT_FINITE)
def test_it_cannot_be_made_with_a_float_that_is_not_finite(value: float) -> None:
    with pytest.raises(ValueError, match=r"position\[1\]"):
        JointState(position=(0.0, value))
    with pytest.raises(ValueError, match="time_from_start"):
        TrajectoryPoint(time_from_start=value)


@given(KINDS, st.binary(max_size=200))
def test_random_bytes_are_a_message_or_a_bad_message(kind: type[Message], payload: bytes) -> None:
    with contextlib.suppress(BadMessage):
        assert isinstance(decode(kind, payload), kind)


@given(KINDS, st.dictionaries(st.text(), VALUES, max_size=4), st.data())
def test_wrong_types_are_a_bad_message(kind: type[Message], other: dict[str, object], data: st.DataObject) -> None:
    names = list(kind.__struct_fields__)
    wrong = data.draw(st.dictionaries(st.sampled_from(names), VALUES, max_size=3)) if names else {}
    try:
        message = decode(kind, msgspec.msgpack.encode(other | wrong))
    except BadMessage:
        return
    assert encode(decode(kind, encode(message))) == encode(message)


def test_a_deep_nest_is_a_bad_message() -> None:
    with pytest.raises(BadMessage):
        decode(PlanRequest, b"\x81\xa4goal" + b"\x91" * 100_000)


def test_a_refusal_names_the_message_the_field_and_the_value() -> None:
    nan = TrajectoryPoint(positions=(0.0,))
    payload = encode(JointTrajectory(points=(nan,))).replace(struct.pack(">d", 0.0), struct.pack(">d", math.nan), 1)
    with pytest.raises(BadMessage, match=r"JointTrajectory.*positions\[0\].* is nan.*points"):
        decode(JointTrajectory, payload)
    with pytest.raises(BadMessage, match=r"JointState.*`int`.*name"):
        decode(JointState, msgspec.msgpack.encode({"name": [1]}))


def test_a_goal_travels_as_what_it_is() -> None:
    for goal in (PoseGoal(position=(0.1, 0.2, 0.3)), JointGoal(name=("q",), position=(0.5,)), NamedGoal(name="home")):
        assert decode(PlanRequest, encode(PlanRequest(goal=goal))).goal == goal


def _tagged(kind: type[Message], fields: dict[str, object]) -> dict[str, object]:
    tag, name = kind.__struct_config__.tag, kind.__struct_config__.tag_field
    return fields if tag is None else {name: tag, **fields}


def _with_an_unknown_field(value: Any) -> Any:
    """The same with one field more in every map; an empty one is a payload that is not ours to read."""
    match value:
        case {"code": str(), "values": dict() as values, **others}:  # a reason's values have no fields of their own
            grown = {name: _with_an_unknown_field(inner) for name, inner in others.items()}
            return grown | {"code": value["code"], "values": values, "x_new": {"more": [1]}}
        case dict() if value:
            return {name: _with_an_unknown_field(inner) for name, inner in value.items()} | {"x_new": {"more": [1]}}
        case list():
            return [_with_an_unknown_field(inner) for inner in value]
        case _:
            return value


@cache
def floats_of_all() -> dict[type[Message], tuple[bytes, list[int]]]:
    """Every message that has floats: its sample's payload, and where they stand in it."""
    payloads = {kind: encode(sample(kind)) for kind in messages()}
    return {kind: (payload, places) for kind, payload in payloads.items() if (places := _floats(payload))}


def _floats(payload: bytes | bytearray) -> list[int]:
    """Where the samples' floats stand: 0xcb and eight bytes, of which the sample's are 0.5 + a small integer."""
    places = []
    for place in range(1, len(payload) - 7):
        value = struct.unpack_from(">d", payload, place)[0]
        if payload[place - 1] == 0xCB and 1.0 <= value < 100.0 and value % 1.0 == 0.5:
            places.append(place)
    return places


SENTENCES = {"reason", "error_string", "pending", "message", "problem", "detail"}
WITHOUT_REASON = {
    "CommandAck": "the name of the device's code",
    "TopicInterface": "the name of a class",
}


def test_whoever_says_why_in_a_sentence_says_it_as_data_too() -> None:
    found = {kind.__name__ for kind in messages() if SENTENCES & set(kind.__struct_fields__)}
    lacking = {kind.__name__ for kind in messages() if "why" not in kind.__struct_fields__} & found
    assert lacking == set(WITHOUT_REASON)
    assert len(found) > 20
