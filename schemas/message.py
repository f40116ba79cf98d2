"""The base of every message: frozen, named, evolvable, and finite.

A message travels as a msgpack map. Unknown fields are ignored and missing ones take their
defaults, so a message evolves by adding fields. A float that is not finite never gets in:
neither by decoding nor by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TypeVar

import msgspec
from msgspec.structs import astuple

Vector = tuple[float, ...]
UNSURE = frozenset((float, tuple, list))  # what may not be finite, or hold what is not: messages have seen to that


class BadMessage(ValueError):
    """A payload that is not the message it claims to be; the text names the field and the value."""


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """A frozen record with defaults for every field and no NaN or infinity anywhere in it."""

    def __post_init__(self) -> None:
        values = astuple(self)
        for value in values:
            kind = type(value)
            if kind is float:
                if not isfinite(value):
                    break
            elif (kind is tuple or kind is list) and value and not _is_plainly_finite(value):
                break
        else:
            return
        for field, value in zip(self.__struct_fields__, values, strict=True):
            if type(value) is float and not isfinite(value):
                raise ValueError(f"field `{field}` is {value}: it must be finite")
            if type(value) is tuple or type(value) is list:
                _require_finite(field, value)


M = TypeVar("M", bound=Message)


def _is_plainly_finite(values: Sequence[object]) -> bool:
    """A quick answer: True only where nothing in `values` can be anything but finite."""
    return has_finite_sum(values) if type(values[0]) is float else UNSURE.isdisjoint(map(type, values))


def _require_finite(field: str, values: Sequence[object]) -> None:
    if values and type(values[0]) is float and has_finite_sum(values):
        return
    for index, value in enumerate(values):
        if type(value) is float:
            if not isfinite(value):
                raise ValueError(f"field `{field}[{index}]` is {value}: it must be finite")
        elif type(value) is tuple or type(value) is list:
            _require_finite(f"{field}[{index}]", value)


def has_finite_sum(values: Sequence[object]) -> bool:
    """True only for numbers of which each is finite: what is not stays in the sum. A quick answer for long vectors."""
    try:
        return isfinite(sum(values))  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return False


_encoder = msgspec.msgpack.Encoder()
_decoders: dict[type[Message], msgspec.msgpack.Decoder[Message]] = {}


def encode(message: Message) -> bytes:
    """The message as a msgpack map."""
    return _encoder.encode(message)


def decode(kind: type[M], payload: bytes | memoryview) -> M:
    """The message in `payload`; raises `BadMessage` naming the kind, the field and the value."""
    decoder = _decoders.get(kind)
    if decoder is None:
        decoder = _decoders[kind] = msgspec.msgpack.Decoder(kind)
    try:
        return decoder.decode(payload)  # type: ignore[return-value]
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadMessage(f"not a {kind.__name__} ({len(payload)} bytes): {error}") from error
