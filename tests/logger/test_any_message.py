"""No message that can be decoded, however odd, stops the logger or the visualizer."""

import enum
import operator
import types
import typing

import msgspec
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from gemelo.libraries.recordings.channels import Entry
from gemelo.schemas.message import Message, decode, encode
from gemelo.schemas.reasons import Reason
from gemelo.schemas.topics import TOPICS
from gemelo.services.logger.core import Logger
from gemelo.services.logger.recording import Recording
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.model.urdf import parse_urdf
from tests.profiles import examples

START = 1_795_000_000_000_000_000
SECOND = 1_000_000_000
texts = st.text(max_size=8)


HOLDING_THEIR_OWN = (Reason,)


def values(kind):
    """A strategy for a field's type: everything that fits on the wire."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        many = arguments[-1] is Ellipsis
        return st.lists(values(arguments[0]), max_size=3).map(tuple) if many else st.tuples(*map(values, arguments))
    if origin in (typing.Union, types.UnionType):
        return st.one_of(*map(values, arguments))
    if origin is dict:
        return st.dictionaries(*map(values, arguments), max_size=2)
    if kind in HOLDING_THEIR_OWN:  # at the depth of one: a reason behind a reason
        return st.just(kind())
    if issubclass(kind, Message):
        return messages(kind)
    if issubclass(kind, enum.Enum):
        return st.sampled_from(kind)
    plain = {
        bool: st.booleans(), int: st.integers(-(2**63), 2**64 - 1), str: texts, types.NoneType: st.none(),
        bytes: st.binary(max_size=8),
        float: st.floats(allow_nan=False, allow_infinity=False),
    }  # fmt: skip
    return plain[kind]


def messages(kind):
    """A strategy for whole messages."""
    hints = typing.get_type_hints(kind)
    return st.fixed_dictionaries({name: values(hints[name]) for name in kind.__struct_fields__}).map(
        lambda fields: kind(**fields)
    )


@pytest.mark.scaled
@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.key)
def test_the_logger_records_any_message_of_a_topic(topic, tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    logger, recording = Logger(), Recording(folder, "any", {})

    @examples(quick=6, full=25, suppress_health_check=list(HealthCheck))
    @given(messages(topic.message))
    def record(message):
        received = decode(topic.message, encode(message))
        logger.on_message(topic, received, START)
        for now in (START, START + 3 * SECOND):
            batch = logger.step(now)
            recording.write(batch.entries)
            recording.write_lines(batch.lines)
        assert msgspec.json.decode(msgspec.json.encode(Entry(topic, received, START).message))

    try:
        record()
        recording.close()
    finally:
        recording.abandon()


URDF = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""
HANDLERS = {
    "joint_states": "on_joint_state", "joint_commands": "on_joint_command", "step_errors": "on_step_errors",
    "planned_path": "on_planned_path", "device/status": "on_device_status", "device/state": "on_device_state",
    "device/events": "event_log.on_event", "log": "event_log.on_log",
}  # fmt: skip


@pytest.mark.scaled
@pytest.mark.parametrize("topic", [topic for topic in TOPICS if topic.key in HANDLERS], ids=lambda topic: topic.key)
def test_the_visualizer_shows_any_message_of_a_topic(topic):
    @examples(quick=8, full=40, suppress_health_check=list(HealthCheck))
    @given(st.lists(messages(topic.message), max_size=3))
    def show(received):
        core = Visualizer(parse_urdf(URDF), "r", "b")
        for message in received:
            operator.attrgetter(HANDLERS[topic.key])(core)(message)
        for update in (*core.step(START), *core.step(START + SECOND)):
            assert update.entity

    show()
