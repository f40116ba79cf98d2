"""Fields of messages by their paths, as `position[0]` or `transforms[2].transform.translation`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import get_args

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, hint_of, usage

_UNIT = re.compile(r"\[[^\]]+\](?: or \[[^\]]+\])*")
_PART = re.compile(r"([A-Za-z_][A-Za-z_0-9]*)((?:\[-?\d+\])*)")


class FieldPath:
    """The path below one kind of message; an empty one means the whole. Raises `CommandError` for one that is none."""

    def __init__(self, kind: type[Message], path: str) -> None:
        self._kind, self._path = kind, path
        self._keys: list[str | int] = []
        for part in path.split(".") if path else ():
            found = _PART.fullmatch(part)
            if found is None:
                raise usage(because("cli.field.not_one", path=path))
            self._keys += [found[1], *(int(index) for index in re.findall(r"-?\d+", found[2]))]
        if self._keys and self._keys[0] not in kind.__struct_fields__:
            self._refuse(str(self._keys[0]), kind.__struct_fields__)

    def of(self, message: Message) -> object:
        """The value there; raises `CommandError` where this message has none."""
        value: object = message
        for key in self._keys:
            if isinstance(key, int):
                if not isinstance(value, list | tuple) or not -len(value) <= key < len(value):
                    size = f"{len(value)} elements" if isinstance(value, list | tuple) else "no elements"
                    raise CommandError(
                        because("cli.field.index", message=self._kind.__name__, path=self._path, index=key, size=size)
                    )
                value = value[key]
            else:
                fields = _fields(value)
                if key not in fields:
                    self._refuse(key, tuple(fields))
                value = fields[key]
        return value

    @cached_property
    def unit(self) -> str:
        """As "m", or "rad or m", as the comment at the field's declaration says; empty where none does."""
        kind: type[msgspec.Struct] = self._kind
        unit = ""
        for name in (key for key in self._keys if isinstance(key, str)):
            unit = _declared_unit(kind, name)
            declared = next((each.type for each in msgspec.structs.fields(kind) if each.name == name), None)
            inner = next((each for each in (declared, *get_args(declared)) if _is_message(each)), None)
            if inner is None:
                break
            kind = inner
        return unit

    def _refuse(self, name: str, known: tuple[str, ...]) -> None:
        hint = hint_of(name, known, is_sorted=False)
        raise usage(because("cli.field.unknown", hint, message=self._kind.__name__, field=name))


def _is_message(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _declared_unit(kind: type[msgspec.Struct], name: str) -> str:
    try:
        source = inspect.getsource(kind)
    except (OSError, TypeError):  # of a user's node, which has told its fields only
        return ""
    said = re.search(rf"^\s+{name}:[^#\n]*#([^\n]*)$", source, re.MULTILINE)
    unit = _UNIT.search(said[1]) if said else None
    return unit[0].replace("[", "").replace("]", "") if unit else ""


def leaves(value: object, path: str = "") -> Iterator[tuple[str, object]]:
    """Every number, word and truth of a value with its path, in the order of the fields."""
    fields = _fields(value)
    if isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from leaves(item, f"{path}[{index}]")
    elif fields:
        for name, item in fields.items():
            yield from leaves(item, f"{path}.{name}" if path else name)
    else:
        yield path, value


def _fields(value: object) -> Mapping[str, object]:
    if isinstance(value, msgspec.Struct):
        return {name: getattr(value, name) for name in value.__struct_fields__}
    return value if isinstance(value, Mapping) else {}
