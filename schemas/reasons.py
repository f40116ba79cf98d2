"""Why something is not so: a code with values, from which each front end makes its sentence (libraries/reasons)."""

from __future__ import annotations

from math import isfinite

from gemelo.schemas.message import Message

Value = bool | int | float | str | tuple[str, ...]  # SI units; names of joints, links, objects and hosts as they are


class Remedy(Message, frozen=True, kw_only=True):
    """What would do: `home`, `wait` with a time, the nearest goal."""

    code: str = ""
    values: dict[str, Value] = {}


class Reason(Message, frozen=True, kw_only=True):
    """A dotted code such as `goal.limit.position`, its values, the reasons behind it, and what would do.

    The catalogue of libraries/reasons has the sentence of each code in each language; no code looks into a sentence.
    """

    code: str = ""
    values: dict[str, Value] = {}
    causes: tuple[Reason, ...] = ()
    remedies: tuple[Remedy, ...] = ()


def because(code: str, /, *causes: Reason, remedies: tuple[Remedy, ...] = (), **values: Value) -> Reason:
    """The reason `code` with its values; a number that is not finite goes along as its word."""
    return Reason(code=code, values=_finite(values), causes=causes, remedies=remedies)


def remedy(code: str, /, **values: Value) -> Remedy:
    """The remedy `code` with its values."""
    return Remedy(code=code, values=_finite(values))


def _finite(values: dict[str, Value]) -> dict[str, Value]:
    for name, value in values.items():
        if type(value) is float and not isfinite(value):
            values[name] = str(value)
    return values
