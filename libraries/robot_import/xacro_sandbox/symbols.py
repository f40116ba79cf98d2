"""The functions and constants that an expression of a xacro file knows: those that xacro documents, and no others.

https://github.com/ros/xacro/wiki: Python's plain constructors and functions, `math`, and xacro's own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from gemelo.libraries.robot_import.xacro_sandbox.expressions import Names

DIRECT = (list, dict, map, len, str, float, int, bool, min, max, round, sorted, range)
OF_PYTHON = (*DIRECT, abs, all, any, divmod, enumerate, filter, frozenset, ord, repr, reversed, set, sum, tuple, zip)
MATH = {name: value for name, value in vars(math).items() if not name.startswith("_")}


class XacroFailed(Exception):
    """`xacro.fatal` of the file itself."""


def tokenize(text: str, sep: str = ",; ", skip_empty: bool = True) -> list[str]:
    """The parts of a text between any of the letters `sep`."""
    parts = re.split(f"[{re.escape(sep)}]", text)
    return [part for part in parts if part] if skip_empty else parts


def fatal(*parts: object) -> None:
    """Ends the expansion; raises `XacroFailed`."""
    raise XacroFailed(" ".join(map(str, parts)))


def symbols(
    load_yaml: Callable[[str], Any],
    argument: Callable[[str], Any],
    absolute: Callable[[str], str],
    note: Callable[[str], None],
) -> dict[str, Any]:
    """All names of `${...}` but the file's own; the functions read YAML, an argument and a path, and keep a message."""

    def message(*parts: object, **_: object) -> str:
        note(" ".join(map(str, parts)))
        return ""

    of_xacro = {
        "load_yaml": load_yaml, "abs_filename": absolute, "dotify": dict, "arg": argument, "tokenize": tokenize,
        "fatal": fatal, "message": message, "warning": message, "error": message, "print_location": message,
    }  # fmt: skip
    return {
        **MATH,
        **{each.__name__: each for each in DIRECT},
        **{name: of_xacro[name] for name in ("load_yaml", "abs_filename", "dotify")},
        "math": Names(MATH),
        "python": Names({each.__name__: each for each in OF_PYTHON}),
        "xacro": Names(of_xacro),
    }


def functions(names: Mapping[str, Any]) -> list[Callable[..., Any]]:
    """All that may be called among these names and in their groups."""
    groups = [each.members for each in names.values() if isinstance(each, Names)]
    return [each for members in (names, *groups) for each in members.values() if callable(each)]


def of_eval(argument: Callable[[str], Any], find: Callable[[str], str]) -> dict[str, Any]:
    """All names of `$(eval ...)` but the arguments' own."""
    plain = (list, dict, map, str, float, int)
    return {
        **MATH, **{each.__name__: each for each in plain}, "true": True, "false": False,
        "arg": argument, "find": find,
    }  # fmt: skip
