"""One sample of every message, made from its annotations: what the golden bytes are bytes of.

`python -m tests.schemas.samples` adds messages that are NEW to golden.json and codes that are NEW to
golden_codes.json. It changes nothing that is there: what was once spoken must keep its meaning, see test_golden.py.
"""

from __future__ import annotations

import importlib
import json
import pkgutil
import sys
from collections.abc import Iterator
from enum import Enum, IntEnum, StrEnum
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

import gemelo.schemas
from gemelo.schemas.message import Message, encode

T = TypeVar("T")
GOLDEN = Path(__file__).with_name("golden.json")
GOLDEN_CODES = Path(__file__).with_name("golden_codes.json")


def messages() -> list[type[Message]]:
    """Every message class of `schemas`, by name."""
    _import_all()
    return sorted(_subclasses(Message), key=lambda kind: kind.__name__)


def codes() -> dict[str, dict[str, int | str]]:
    """Every enumeration of `schemas` that travels: its members' names and what is said for them."""
    _import_all()
    kinds = [kind for base in (IntEnum, StrEnum) for kind in _subclasses(base)]
    return {kind.__name__: {each.name: each.value for each in kind} for kind in kinds}


def sample(kind: type[Message]) -> Message:
    """A message in which no field has its default where its type allows another value.

    An enumeration that has grown keeps the member that was recorded.
    """
    _begun.append(kind)
    try:
        return kind(**_sampled(kind))
    finally:
        _begun.pop()


_begun: list[type[Message]] = []  # of which a sample is being made


def _sampled(kind: type[Message]) -> dict[str, Any]:
    recorded = golden().get(kind.__name__, {}).get("fields", {})
    values = {}
    for field in msgspec.structs.fields(kind):
        is_recorded_code = isinstance(field.type, type) and issubclass(field.type, Enum) and field.name in recorded
        values[field.name] = field.type(recorded[field.name]) if is_recorded_code else _value(field.type, field.name)
    return values


def golden() -> dict[str, dict[str, Any]]:
    """Name of the message -> {"fields": those of `sample` when it was added, "hex": their msgpack bytes}."""
    return json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.exists() else {}


def golden_codes() -> dict[str, dict[str, int | str]]:
    """As `codes`, as they were when they were added."""
    return json.loads(GOLDEN_CODES.read_text(encoding="utf-8")) if GOLDEN_CODES.exists() else {}


def record(kind: type[Message]) -> dict[str, Any]:
    payload = encode(sample(kind))
    return {"fields": json.loads(msgspec.json.encode(msgspec.msgpack.decode(payload))), "hex": payload.hex()}


def one_a_line(records: dict[str, dict[str, Any]]) -> str:
    """JSON with one record on each line."""
    lines = (f"{json.dumps(name)}: {json.dumps(record)}" for name, record in records.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _import_all() -> None:
    for module in pkgutil.iter_modules(gemelo.schemas.__path__):
        importlib.import_module(f"gemelo.schemas.{module.name}")


def _subclasses(kind: type[T]) -> Iterator[type[T]]:
    for each in kind.__subclasses__():
        if each.__module__.startswith("gemelo.schemas."):
            yield each
            yield from _subclasses(each)


def _value(annotation: Any, name: str) -> Any:
    return _value_of(inspect.type_info(annotation), annotation, name)


def _value_of(info: inspect.Type, annotation: Any, name: str) -> Any:
    match info:
        case inspect.Metadata():
            return _value_of(info.type, annotation, name)
        case inspect.BoolType():
            return True
        case inspect.IntType():
            return 100_000 + len(name)
        case inspect.FloatType():
            return 0.5 + len(name)
        case inspect.StrType():
            return name
        case inspect.BytesType():
            return name.encode()
        case inspect.EnumType():
            return _last(info.cls)
        case inspect.StructType():
            return sample(info.cls)
        case inspect.DictType():
            return {name: 0.5 + len(name)}
        case inspect.VarTupleType(inspect.StructType(kind)) if kind in _begun:  # a message that holds its own kind
            return ()
        case inspect.UnionType():
            return _value_of(next(each for each in info.types if not isinstance(each, inspect.NoneType)), None, name)
        case inspect.VarTupleType():
            return (_value_of(info.item_type, None, name),) * 2
        case inspect.TupleType():
            return tuple(_value_of(each, None, name) for each in info.item_types)
        case inspect.RawType():
            return msgspec.Raw(b"\x80")
        case _:
            raise TypeError(f"no sample is known for field {name} of {info}")


def _last(kind: type[Enum]) -> Enum:
    return list(kind)[-1]


def main() -> int:
    """Adds what is new; 1 where something that was recorded cannot be read any more."""
    kept = golden()
    for name in sorted(set(kept) - {kind.__name__ for kind in messages()}):
        print(f"{name} is gone: remove it from golden.json by hand, if no recording and no node needs it")
        return 1
    for kind in messages():
        kept.setdefault(kind.__name__, record(kind))
    GOLDEN.write_text(one_a_line(dict(sorted(kept.items()))), encoding="utf-8")
    old = golden_codes()
    merged = {name: now | old.get(name, {}) for name, now in codes().items()}
    GOLDEN_CODES.write_text(one_a_line(old | merged), encoding="utf-8")
    print(f"{len(kept)} messages in {GOLDEN.name}, {len(merged)} enumerations in {GOLDEN_CODES.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
