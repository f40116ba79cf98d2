"""Messages as a person writes and reads them: JSON in, and out as YAML, a subset that any YAML reader takes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import hint_of, usage

INDENT = "  "
_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./ -]*[A-Za-z0-9_./]|[A-Za-z_/]")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n"}
_SPECIAL = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}


def fields_of(message: type[Message]) -> dict[str, str]:
    """Field names and their types, as written in `schemas`."""
    return {field.name: str(message.__annotations__.get(field.name, "")) for field in msgspec.structs.fields(message)}


def message_of(kind: type[Message], text: str) -> Any:
    """Decodes `text` (JSON) as a `kind`; raises `CommandError` for a text that is not one, unknown fields included."""
    try:
        raw = msgspec.json.decode(text)
        if not isinstance(raw, dict):
            raise usage(
                because("cli.message.json", message=kind.__name__, example=f'{{"{kind.__struct_fields__[0]}": ...}}')
            )
        for field in raw:
            if field not in kind.__struct_fields__:
                hint = hint_of(field, kind.__struct_fields__, is_sorted=False)
                raise usage(because("cli.field.unknown", hint, message=kind.__name__, field=field))
        return msgspec.convert(raw, kind)
    except (msgspec.DecodeError, ValueError) as error:
        raise usage(because("cli.message.not_one", message=kind.__name__, error=str(error))) from error


def dump(value: object) -> str:
    """`value` (a message, mapping, sequence or scalar) as one YAML document without its `---`."""
    return "\n".join(_lines(value)) + "\n"


def _lines(value: object) -> Iterator[str]:
    if _is_scalar(value) or _is_flat(value):
        yield _inline(value)
    elif isinstance(value, list | tuple):
        for item in value:
            first, *rest = _lines(item)
            yield f"- {first}"
            yield from (INDENT + line for line in rest)
    else:
        yield from _mapping(_fields(value))


def _mapping(fields: Mapping[str, object]) -> Iterator[str]:
    for name, value in fields.items():
        if isinstance(value, str) and "\n" in value:
            yield f"{_scalar(name)}: {_quoted(value)}" if _needs_quotes(value) else f"{_scalar(name)}: |-"
            if not _needs_quotes(value):
                yield from (INDENT + line if line else "" for line in value.split("\n"))
        elif _is_scalar(value) or _is_flat(value):
            yield f"{_scalar(name)}: {_inline(value)}"
        else:
            yield f"{_scalar(name)}:"
            yield from (INDENT + line for line in _lines(value))


def _fields(value: object) -> Mapping[str, object]:
    if isinstance(value, Mapping):
        return {str(name): item for name, item in value.items()}
    if isinstance(value, msgspec.Struct):
        return {name: getattr(value, name) for name in value.__struct_fields__}
    raise TypeError(f"a {type(value).__name__} has no place in YAML")


def _is_scalar(value: object) -> bool:
    return value is None or isinstance(value, bool | int | float | str)


def _is_flat(value: object) -> bool:
    """True if `value` fits on one line: empty, or a sequence of scalars."""
    if isinstance(value, list | tuple):
        return all(_is_scalar(item) for item in value)
    return not _is_scalar(value) and not _fields(value)


def _inline(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_scalar(item) for item in value)}]"
    if not _is_scalar(value):
        return "{}"
    if isinstance(value, IntEnum):
        return f"{int(value)}  # {value.name}"
    return _scalar(value)


def _scalar(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case int():
            return str(int(value))
        case float():
            return _float(value)
        case _:
            text = str(value)
            plain = _PLAIN.fullmatch(text) is not None and text.lower() not in _SPECIAL
            return text if plain else _quoted(text)


def _float(value: float) -> str:
    text = repr(value)
    # YAML 1.1 reads an exponent only after a decimal point.
    mantissa, exponent, power = text.partition("e")
    return f"{mantissa}.0e{power}" if exponent and "." not in mantissa else text


def _quoted(text: str) -> str:
    return '"' + "".join(_escaped(character) for character in text) + '"'


def _escaped(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    return character if character.isprintable() else f"\\U{ord(character):08x}"


def _needs_quotes(text: str) -> bool:
    """True if a text of several lines would not survive as a block."""
    return text != text.strip() or not all(line.isprintable() for line in text.split("\n"))
