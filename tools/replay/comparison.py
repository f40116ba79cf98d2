"""Recorded and replayed messages side by side, and the first place where they differ. Pure."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import msgspec

from gemelo.schemas.message import Message, encode
from gemelo.tools.replay.recorded import Heard

ABSENT = "(nothing)"
LONGEST = 200  # characters of a value that are shown
Differing = tuple[str, object, object]  # the path of a field, and its two values


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """The first place where a replay is not what was recorded."""

    topic: str
    sequence: int  # of the recorded message in its topic, from 0; -1: it has none
    at: float  # [s] into the recording
    path: str  # of the field, as `transforms[2].transform.rotation[0]`; empty: the whole message
    recorded: str
    replayed: str


@dataclass
class Comparison:
    """What has been compared so far; after the first difference nothing more is.

    Without a `tolerance` messages are alike to the byte; with one, a float may differ by that share of it.
    """

    tolerance: float = 0.0
    alike: Counter[str] = field(default_factory=Counter)  # messages by topic
    aside: Counter[str] = field(default_factory=Counter)  # messages that are not compared, by why
    difference: Difference | None = None

    def hold(self, topic: str, heard: Heard[Any], recorded: Message, replayed: Message | None) -> bool:
        """True if `replayed` is `recorded`, of the message `heard`; else it is the difference.

        Fields that the recording is older than do not count.
        """
        if replayed is not None and encode(recorded) == encode(replayed):
            self.alike[topic] += 1
            return True
        found = differing(recorded, replayed, self.tolerance, heard.added)
        if found is None:
            self.alike[topic] += 1
            return True
        self.differ(topic, heard.sequence, heard.at, *found)
        return False

    def differ(self, topic: str, sequence: int, at: float, path: str, was: object, now: object) -> None:
        """Keeps the first difference, `at` [s]."""
        if self.difference is None:
            self.difference = Difference(
                topic=topic, sequence=sequence, at=at, path=path, recorded=_short(was), replayed=_short(now)
            )


def differing(
    recorded: Message, replayed: Message | None, tolerance: float = 0.0, added: frozenset[str] = frozenset()
) -> Differing | None:
    """The path of the first field that differs by more than the share `tolerance`, and both values; None if none.

    `added`: names of fields that are not compared.
    """
    if replayed is None:
        return "", recorded, ABSENT
    ours, theirs = (_without(added, msgspec.to_builtins(message)) for message in (recorded, replayed))
    return _differing("", ours, theirs, tolerance)


def _without(names: frozenset[str], value: Any) -> Any:
    """The value without fields of these names, at any depth."""
    if not names:
        return value
    if isinstance(value, dict):
        return {key: _without(names, each) for key, each in value.items() if key not in names}
    return [_without(names, each) for each in value] if isinstance(value, list | tuple) else value


def _differing(path: str, one: object, other: object, tolerance: float) -> Differing | None:
    match one, other:
        case float(), float() if tolerance and math.isclose(one, other, rel_tol=tolerance, abs_tol=tolerance):
            return None
        case dict(), dict():
            for key in (*one, *(key for key in other if key not in one)):
                inner = f"{path}.{key}" if path else str(key)
                if found := _differing(inner, one.get(key, ABSENT), other.get(key, ABSENT), tolerance):
                    return found
        case ((list() | tuple()), (list() | tuple())):
            for index in range(max(len(one), len(other))):
                ours, theirs = (each[index] if index < len(each) else ABSENT for each in (one, other))
                if found := _differing(f"{path}[{index}]", ours, theirs, tolerance):
                    return found
        case _ if msgspec.msgpack.encode(one) != msgspec.msgpack.encode(other):
            return path, one, other
    return None


def _short(value: object) -> str:
    """A value for a person; floats with all their digits."""
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
