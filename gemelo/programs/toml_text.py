"""Programs and points as TOML that a person can read: one line for a step, repeats indented."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from decimal import Decimal

import msgspec

from gemelo.programs.steps import AnyStep, Play, Repeat, Speed

BARE = re.compile(r"[A-Za-z0-9_-]+")
INDENT = "  "


def program_text(version: int, robot: str, steps: Iterable[AnyStep]) -> str:
    """The text of a program's file."""
    head = [f"version = {version}"] + ([f"robot = {value_text(robot)}"] if robot else [])
    return "\n".join([*head, "", "steps = [", *_lines(steps, INDENT), "]", ""])


def value_text(value: object) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key_text(key)} = {value_text(each)}" for key, each in value.items()) + "}"
    assert isinstance(value, list | tuple)
    return "[" + ", ".join(value_text(each) for each in value) + "]"


def key_text(key: str) -> str:
    """A key, in quotes where it needs them."""
    return key if BARE.fullmatch(key) else _string(key)


def _lines(steps: Iterable[AnyStep], indent: str) -> Iterable[str]:
    for step in steps:
        given = msgspec.to_builtins(step)
        if isinstance(step, Repeat):
            yield f'{indent}{{do = "repeat", count = {step.count}, steps = ['
            yield from _lines(step.steps, indent + INDENT)
            yield f"{indent}]}},"
            continue
        if isinstance(step, Play | Speed) and "share" in given:
            given["share"] = percent_text(step.share)
        yield f"{indent}{value_text(given)},"


def percent_text(share: float) -> str:
    """A share as per cent, exact: it reads back as the same number."""
    return f"{(Decimal(repr(share)) * 100).normalize():f}%"


def _string(text: str) -> str:
    """A basic string: quotes, backslashes and control characters are escaped."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(each if _is_plain(each) else f"\\u{ord(each):04X}" for each in escaped) + '"'


def _is_plain(character: str) -> bool:
    return ord(character) >= 32 and ord(character) != 127
