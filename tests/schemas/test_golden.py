"""Messages evolve by adding fields with defaults: bytes once spoken stay readable, with the same meaning.

A new message is added to golden.json by `python -m tests.schemas.samples`. A new field needs nothing: the old
bytes still decode, the field takes its default. A test that fails here is an incompatible change.
"""

from __future__ import annotations

import base64
from typing import Any

import msgspec

from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message, decode, encode
from tests.schemas.samples import (
    GOLDEN,
    GOLDEN_CODES,
    codes,
    golden,
    golden_codes,
    messages,
    one_a_line,
    sample,
)
from tests.table import table

RECORDED = golden()


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_the_golden_bytes_keep_their_meaning(kind: type[Message]) -> None:
    assert kind.__name__ in RECORDED, "a new message: run `python -m tests.schemas.samples`"
    recorded = RECORDED[kind.__name__]
    message = decode(kind, bytes.fromhex(recorded["hex"]))
    assert _contains(msgspec.msgpack.decode(encode(message)), recorded["fields"])


@table("kind", messages(), ids=lambda kind: kind.__name__)
def test_what_is_said_now_has_every_recorded_field_under_its_name_and_type(kind: type[Message]) -> None:
    """An old reader must find what it knows: a field that was renamed, removed or retyped fails here."""
    assert _contains(msgspec.msgpack.decode(encode(sample(kind))), RECORDED[kind.__name__]["fields"])


def test_no_recorded_message_is_gone() -> None:
    assert set(RECORDED) == {kind.__name__ for kind in messages()}


def test_the_files_have_one_record_on_each_line() -> None:
    assert GOLDEN.read_text(encoding="utf-8") == one_a_line(dict(sorted(golden().items())))
    assert GOLDEN_CODES.read_text(encoding="utf-8") == one_a_line(golden_codes())


@table("name", sorted(codes().keys() | golden_codes().keys()))
def test_every_code_keeps_its_number(name: str) -> None:
    """New codes may come; one that is renumbered, renamed or gone would be misread by who knows the old one."""
    assert name in golden_codes(), "a new enumeration: run `python -m tests.schemas.samples`"
    assert _contains(codes().get(name, {}), golden_codes()[name])


def test_an_incompatible_change_would_be_noticed() -> None:
    class Renamed(Message, frozen=True, kw_only=True):
        stamp: int = 0
        names: tuple[str, ...] = ()

    class Retyped(Message, frozen=True, kw_only=True):
        stamp: float = 0.5
        name: tuple[str, ...] = ()

    class Grown(JointState, frozen=True, kw_only=True):
        temperature: float = 20.0  # [degC]

    recorded = RECORDED["JointState"]
    payload, meaning = bytes.fromhex(recorded["hex"]), recorded["fields"]
    assert not _contains(msgspec.msgpack.decode(encode(decode(Renamed, payload))), meaning)
    assert not _contains(msgspec.msgpack.decode(encode(sample(Retyped))), {"stamp": meaning["stamp"]})
    assert _contains(msgspec.msgpack.decode(encode(decode(Grown, payload))), meaning)


def _contains(now: Any, recorded: Any) -> bool:
    """Whether `now` says all that `recorded` says; maps may have grown."""
    if isinstance(recorded, dict):
        return isinstance(now, dict) and all(key in now and _contains(now[key], recorded[key]) for key in recorded)
    if isinstance(recorded, list):
        return isinstance(now, list) and len(now) == len(recorded) and all(map(_contains, now, recorded))
    if isinstance(now, bytes):
        now = base64.b64encode(now).decode()
    return type(now) is type(recorded) and bool(now == recorded)
