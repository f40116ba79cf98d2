"""Text in the languages of the files that are rendered: nothing of it ends where its writer did not mean it to."""

from __future__ import annotations

import json
from collections.abc import Mapping

Value = str | int | float | bool


def systemd(text: str) -> str:
    """One word of a unit's ExecStart=, Environment= or list of paths (systemd.syntax(7))."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    return f'"{_one_line(escaped)}"'


def quoted(text: str) -> str:
    """A basic string of TOML, a double-quoted scalar of YAML, a string of JSON: equal for text that can be printed."""
    return json.dumps(_one_line(text), ensure_ascii=False)


def toml(tables: Mapping[str, Mapping[str, Value]]) -> str:
    """A TOML file; the table "" comes first and has no header."""
    parts = []
    for name, values in tables.items():
        lines = [f"{key} = {_toml_value(value)}" for key, value in values.items()]
        parts.append("\n".join([f"[{name}]", *lines] if name else lines))
    return "\n\n".join(parts) + "\n"


def _toml_value(value: Value) -> str:
    return quoted(value) if isinstance(value, str) else str(value).lower()


def _one_line(text: str) -> str:
    """Raises `ValueError` for what could end a line: the check of a site refuses it before."""
    if not text.isprintable():
        raise ValueError(f"{text!r} holds a character that cannot be printed")
    return text
