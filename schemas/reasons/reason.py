"""A reason why something is not so: a code with values, of which each front end makes its sentence."""

from __future__ import annotations

from math import isfinite
from typing import Any

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.reasons.sentences import PLAIN, Value, say

OWN = frozenset((float, int, str, bool))


class Remedy(Message, frozen=True, kw_only=True):
    """What would do: `home`, `wait` with a time, the nearest goal."""

    code: str = ""
    values: dict[str, Value] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        """As of any message: no number that is not finite."""
        _require_finite(self.values)


class Reason(Message, frozen=True, kw_only=True):
    """A dotted code such as `goal.limit.position`, its values, the reasons behind it, and what would do.

    The catalogue of schemas/reasons has the sentence of each code in each language; no code looks into a sentence.
    """

    code: str = ""
    values: dict[str, Value] = msgspec.field(default_factory=dict)
    causes: tuple[Reason, ...] = ()
    remedies: tuple[Remedy, ...] = ()

    def __post_init__(self) -> None:
        """As of any message: no number that is not finite."""
        _require_finite(self.values)

    def __str__(self) -> str:
        """The English sentence, which goes along with a message for readers that do not know the catalogue."""
        return say(self)


def _require_finite(values: dict[str, Value]) -> None:
    for name, value in values.items():
        for each in value.values() if type(value) is dict else value if type(value) is tuple else (value,):
            if type(each) is float and not isfinite(each):
                raise ValueError(f"field `values.{name}` is {each}: it must be finite")


def because(code: str, /, *parts: Reason | Remedy, **values: Value) -> Reason:
    """The reason `code` with its values, the reasons behind it and what would do.

    A number that is not finite goes along as its word, and one of numpy's as Python's own.
    """
    causes = tuple(part for part in parts if isinstance(part, Reason))
    remedies = tuple(part for part in parts if isinstance(part, Remedy))
    return Reason(code=code, values=_sendable(values), causes=causes, remedies=remedies)


def plain(text: str) -> Reason:
    """A sentence without a code of its own."""
    return Reason(code=PLAIN, values={"text": text})


def remedy(code: str, /, **values: Value) -> Remedy:
    """The remedy `code` with its values."""
    return Remedy(code=code, values=_sendable(values))


def _sendable(values: dict[str, Value]) -> dict[str, Value]:
    """With Python's own numbers in the place of numpy's, which no message takes, and words in that of infinite ones."""
    for name, value in values.items():
        if type(value) is tuple:
            values[name] = tuple(_own(each) for each in value)
        elif type(value) is dict:
            values[name] = {key: _own(each) for key, each in value.items()}
        elif type(value) is not str:
            own = _own(value)
            values[name] = own if type(own) is not float or isfinite(own) else str(own)
    return values


def _own(value: Any) -> Any:
    return value if type(value) in OWN or not hasattr(value, "item") else value.item()
