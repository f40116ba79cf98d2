"""Messages as a person writes and reads them: JSON in, field names and types out."""

from __future__ import annotations

from typing import Any

import msgspec

from schemas.message import Message
from services.cli.errors import nearest, usage


def fields_of(message: type[Message]) -> dict[str, str]:
    """Field names and their types, as written in `schemas`."""
    return {field.name: str(message.__annotations__.get(field.name, "")) for field in msgspec.structs.fields(message)}


def message_of(kind: type[Message], text: str) -> Any:
    """Decodes `text` (JSON) as a `kind`; raises `CommandError` for what is none, unknown fields included."""
    try:
        raw = msgspec.json.decode(text)
        if not isinstance(raw, dict):
            raise usage(f'a {kind.__name__} is written as JSON, like {{"{kind.__struct_fields__[0]}": ...}}')
        for field in raw:
            if field not in kind.__struct_fields__:
                guess = nearest(field, kind.__struct_fields__)
                hint = f'did you mean "{guess}"?' if guess else f"it has {', '.join(kind.__struct_fields__)}"
                raise usage(f'{kind.__name__} has no field "{field}": {hint}')
        return msgspec.convert(raw, kind)
    except (msgspec.DecodeError, ValueError) as error:
        raise usage(f"not a {kind.__name__}: {error}") from error
