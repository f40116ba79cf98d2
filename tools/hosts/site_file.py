"""Reads a site's file; every problem is a sentence with its line."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable
from enum import EnumType
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from gemelo.libraries.toml_lines import Where, nearest_line, toml_lines
from gemelo.schemas.errors import ConfigurationError, ReasonedError
from gemelo.schemas.reasons import Reason, Remedy, because, plain, remedy
from gemelo.schemas.site import Site, SiteBroker, SiteHost, SiteRecord, SiteRobot, SiteRouter
from gemelo.schemas.text_file import NotUtf8, read_text

NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,30}")  # of a host or a site: part of file names, units and certificates
WANTED = re.compile(r"Expected `(\w+)`, got `(\w+)`")  # msgspec's own sentence
TABLES: dict[str, type[SiteRecord]] = {"router": SiteRouter, "broker": SiteBroker}
TABLES_BY_NAME: dict[str, type[SiteRecord]] = {"robots": SiteRobot, "hosts": SiteHost}

R = TypeVar("R", bound=SiteRecord)


class SiteError(ConfigurationError):
    """A site that cannot be deployed; one line for each problem."""


class NotPlain(ReasonedError, ValueError):
    """A text that would end a line in the files that are written of it."""


class Problems:
    """What is wrong with a file, with lines."""

    def __init__(self, file: Path, text: str) -> None:
        self._file, self._lines = file, toml_lines(text)
        self._found: list[tuple[int, Reason]] = []

    def add(self, place: Where, why: Reason) -> None:
        """At the line of `place`, or of the nearest thing around it that stands in the file."""
        at = nearest_line(self._lines, place) or 1
        self._found.append((at, why))

    def raise_any(self) -> None:
        """Raises `SiteError` if there is any."""
        if self._found:
            found = sorted(self._found, key=lambda each: (each[0], str(each[1])))
            raise SiteError(
                because(
                    "site.problems", *(because("file.line", why, file=str(self._file), line=at) for at, why in found)
                )
            )


def read_site(file: Path) -> tuple[Site, Problems]:
    """The site, and where to add what else is wrong; raises `SiteError`."""
    try:
        text = read_text(file)
        raw = tomllib.loads(text)
    except FileNotFoundError:
        raise SiteError(because("site.none", file=str(file))) from None
    except (OSError, NotUtf8, tomllib.TOMLDecodeError) as error:
        why = error.reason if isinstance(error, NotUtf8) else plain(str(error))
        raise SiteError(because("site.unreadable", why, file=str(file))) from error
    problems = Problems(file, text)
    site = _site(raw, file.stem, problems)
    problems.raise_any()
    assert site is not None
    return site, problems


def _site(raw: dict[str, Any], name: str, problems: Problems) -> Site | None:
    if "name" in raw:
        problems.add(("name",), because("site.name.key", name=name))
    is_plain = NAME.fullmatch(name) is not None
    if not is_plain:
        problems.add((), because("site.name", name=repr(name)))
    values = {**raw, "name": name if is_plain else ""}
    for key, kind in TABLES.items():
        if isinstance(raw.get(key), dict):
            values[key] = _record(kind, raw[key], (key,), problems)
    for key, kind in TABLES_BY_NAME.items():
        if isinstance(raw.get(key), dict):
            values[key] = _named(kind, raw[key], key, problems)
    return _record(Site, values, (), problems)


def _named(kind: type[R], tables: dict[str, Any], key: str, problems: Problems) -> dict[str, R | None]:
    for name, table in tables.items():
        if not NAME.fullmatch(name):
            problems.add((key, name), because("site.name.of_table", name=repr(name), key=key))
        if not isinstance(table, dict):
            problems.add((key, name), because("site.no_table", key=key, name=name))
    return {
        name: _record(kind, table, (key, name), problems) for name, table in tables.items() if isinstance(table, dict)
    }


def _record(kind: type[R], raw: dict[str, Any], place: Where, problems: Problems) -> R | None:
    """None where something of it is wrong, which has been added to `problems`."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    for key in raw:
        if key not in fields:
            path = ".".join(map(str, (*place, key)))
            problems.add((*place, key), because("site.key.unknown", nearest(key, fields), key=path))
    values, is_whole = {}, all(key in fields for key in raw)
    for name, field in fields.items():
        if name not in raw:
            is_whole &= not field.required
            if field.required:
                problems.add(place, because("site.key.missing", key=".".join(map(str, (*place, name)))))
            continue
        try:
            values[name] = _converted(raw[name], field.type)
        except ValueError:
            is_whole = False
            if raw[name] is not None and not _is_reported(raw[name]):
                problems.add(*_wrong((*place, name), raw[name], field.type))
    return kind(**values) if is_whole else None


def _converted(value: object, kind: Any) -> Any:
    """Raises `ValueError` where the value is no `kind`, or holds what no file may hold."""
    made = msgspec.convert(value, kind)  # whose error is a ValueError
    _require_plain(value)
    return made


def _wrong(place: Where, value: object, kind: Any) -> tuple[Where, Reason]:
    """The innermost thing of a value that is no `kind`: where it stands, and what is wrong with it."""
    key, inner = ".".join(str(each) for each in place if not isinstance(each, int)), get_args(kind)
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for at, part in parts if inner else ():
        of_part = inner[1] if isinstance(value, dict) else inner[0]
        try:
            _converted(part, of_part)
        except ValueError:
            return _wrong((*place, at), part, of_part)
    try:
        _converted(value, kind)
    except ValueError as error:
        code = "site.key.element" if isinstance(place[-1], int) else "site.key"
        return place, because(code, _in_toml(error, kind), key=key)
    raise AssertionError(f"{key} is right")


def _in_toml(error: ValueError, kind: object) -> Reason:
    """What msgspec says of a value that should be a `kind`, in the words of who writes TOML."""
    if isinstance(error, NotPlain):
        return error.reason
    said = str(error)
    if isinstance(kind, EnumType):
        return because("site.value.none_of", value=said.removeprefix("Invalid enum value "), known=tuple(kind))
    if not (found := WANTED.fullmatch(said)):
        return plain(said)
    wanted, got = found.groups()
    return because("site.value.kind", wanted=wanted, got=got)


def _is_reported(value: object) -> bool:
    """True for a table of tables of which one was wrong already."""
    return isinstance(value, dict) and any(each is None for each in value.values())


def _require_plain(value: object) -> None:
    """No text may hold what ends a line in the files that are written of it."""
    if isinstance(value, str) and not value.isprintable():
        raise NotPlain(because("site.value.unprintable", value=repr(value)))
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _require_plain(inner)


def nearest(name: str, known: Iterable[str]) -> Remedy:
    """A hint for a name that is not known."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return remedy("did_you_mean", name=near[0]) if near else remedy("known_are", names=", ".join(names))
