"""The base of every message: frozen, named, evolvable, and finite.

A message travels as a msgpack map. Unknown fields are ignored and missing ones take their
defaults, so a message evolves by adding fields. A float that is not finite never gets in:
neither by decoding nor by construction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from math import isfinite
from operator import attrgetter
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

Vector = tuple[float, ...]
UNSURE = frozenset((float, tuple, list))  # what may not be finite, or hold what is not: messages have seen to that


class BadMessage(ValueError):
    """A payload that is not the message it claims to be; the text names the field and the value."""


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """A frozen record with defaults for every field and no NaN or infinity anywhere in it."""

    def __post_init__(self) -> None:
        kind = type(self)
        try:
            read = _values_of[kind]
        except KeyError:
            read = _look_at(kind)
        if read is None:
            return
        values = read(self)
        for value in values:
            found = type(value)
            if found is float:
                if not isfinite(value):
                    break
            elif (found is tuple or found is list) and value:
                # A quick answer first; the sum is finite only where each number is.
                if type(value[0]) is float:
                    try:
                        if not isfinite(sum(value)):
                            break
                    except (TypeError, OverflowError):
                        break
                elif not UNSURE.isdisjoint(map(type, value)):
                    break
        else:
            return
        for field, value in zip(_fields_of[kind], values, strict=True):
            if type(value) is float and not isfinite(value):
                raise ValueError(f"field `{field}` is {value}: it must be finite")
            if type(value) is tuple or type(value) is list:
                _require_finite(field, value)


WITHOUT_FLOATS = (str, bytes, int, Enum, type(None), Message)

_fields_of: dict[type[Message], tuple[str, ...]] = {}  # that a float may be in, by its type as it is declared
_values_of: dict[type[Message], Callable[[Message], tuple[Any, ...]] | None] = {}  # of these fields; None: it has none


def _look_at(kind: type[Message]) -> Callable[[Message], tuple[Any, ...]] | None:
    """Finds the fields of a kind of message that may hold a float, once; messages within it look at their own."""
    fields = tuple(name for name, declared in _declared(kind).items() if _may_hold_a_float(declared))
    _fields_of[kind] = fields
    if len(fields) > 1:
        _values_of[kind] = attrgetter(*fields)
    elif fields:
        only = attrgetter(*fields)
        _values_of[kind] = lambda message: (only(message),)
    else:
        _values_of[kind] = None
    return _values_of[kind]


def _declared(kind: type[Message]) -> dict[str, object]:
    """The types of the fields; of what cannot be found where it is declared, anything."""
    try:
        found = get_type_hints(kind)
    except NameError:
        found = {}
    return {name: found.get(name, object) for name in kind.__struct_fields__}


def _may_hold_a_float(declared: object) -> bool:
    if within := get_args(declared):
        return any(_may_hold_a_float(each) for each in within if each is not ...)
    return not (isinstance(declared, type) and issubclass(declared, WITHOUT_FLOATS))


M = TypeVar("M", bound=Message)


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
