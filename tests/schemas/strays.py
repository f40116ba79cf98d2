"""Messages that anybody may put on a key: extreme numbers, stamps, sessions and epochs, and no message at all."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import msgspec

from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.system import Empty
from tests.schemas.samples import sample

INTEGERS = (0, -1, 2**31, -(2**62), 2**63 - 1)
FLOATS = (0.0, -1.0, 1e308, -1e308)


def strays_for(kind: type[Message]) -> Iterator[tuple[str, bytes]]:
    """(schema, payload) pairs: every readable `kind` with an extreme number, then what cannot be read as one."""
    name = kind.__name__
    usual = msgspec.msgpack.decode(encode(sample(kind)))
    yield name, encode(sample(kind))
    for value in (*INTEGERS, *FLOATS):
        yield from ((name, payload) for payload in _readable(kind, [_with(usual, value)]))
        yield from ((name, payload) for payload in _readable(kind, _each_with(usual, value)))
    yield name, b""
    yield name, random.Random(name).randbytes(300)
    yield Empty.__name__, encode(Empty())


def _readable(kind: type[Message], contents: Any) -> Iterator[bytes]:
    """Payloads of those contents that are a `kind`; an enumeration or a range may forbid a number."""
    for content in contents:
        payload = msgspec.msgpack.encode(content)
        try:
            decode(kind, payload)
        except BadMessage:
            continue
        yield payload


def _each_with(fields: dict[str, Any], value: float) -> Iterator[dict[str, Any]]:
    """`fields` with `value` in place of the numbers of one field after the other."""
    for field, usual in fields.items():
        changed = _with(usual, value)
        if changed != usual:
            yield fields | {field: changed}


def _with(usual: Any, value: float) -> Any:
    """`usual` with `value` in place of every number of its type."""
    if type(usual) is type(value):
        return value
    if isinstance(usual, list):
        return [_with(each, value) for each in usual]
    if isinstance(usual, dict):
        return {key: _with(each, value) for key, each in usual.items()}
    return usual
