"""Values of reasons in writing: in SI units, as commands and scripts take them, or in those of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import degrees

Written = Callable[[float, int | None], str]  # a value in SI units, and to how many digits behind the point


def _unit(name: str, digits: int, convert: Callable[[float], float] = float) -> Written:
    """Writes a value with its unit; `digits` where the template says none. A blank stands before all but degrees."""
    text = name if name.startswith("°") else f" {name}".rstrip()
    return lambda value, wanted: f"{convert(value):.{digits if wanted is None else wanted}f}{text}"


def _in_display(name: str, digits: int, convert: Callable[[float], float]) -> Written:
    """The digits of the template are those of the SI unit, so they do not count."""
    written = _unit(name, digits, convert)
    return lambda value, wanted: written(value, None)


def _thousand(value: float) -> float:
    return 1000.0 * value


def _hundred(value: float) -> float:
    return 100.0 * value


def _typed(name: str, factor: float = 1.0) -> Written:
    """As a person types it: 25mm, 30deg, 50%."""
    return lambda value, _: f"{factor * value:g}{name}"


def _short(name: str, convert: Callable[[float], float]) -> Written:
    """To four digits in all, or more where it is large: a clearance is given in this unit, at a command too."""

    def written(value: float, wanted: int | None) -> str:
        shown = convert(value)
        return f"{shown:.0f}{name}" if abs(shown) >= 10_000.0 else f"{shown:.{wanted or 4}g}{name}"

    return written


_SAME: dict[str, Written] = {
    "read m": _unit("mm", 1, _thousand),
    "typed ": _typed(""),
    "typed s": _typed("s"),
    "typed m": _typed("mm", 1000.0),
    "typed m/s": _typed("mm/s", 1000.0),
    "typed m/s^2": _typed("mm/s2", 1000.0),
    "typed rad or m": _typed("deg", degrees(1.0)),
    "typed share": _typed("%", 100.0),
    "mm": _short(" mm", _thousand),
    "whole mm": _unit("mm", 0, _thousand),
    "bare mm": _unit("", 0, _thousand),
    "mm/s": _short(" mm/s", _thousand),
    "s": _unit("s", 3),
    "ms": _unit("ms", 1, _thousand),
    "mrad": _short(" mrad", _thousand),
    "us": _short(" us", lambda value: 1e6 * value),
    "%": _unit("%", 0, _hundred),
    "steps": _unit("steps", 0),
    "steps/s": _unit("steps/s", 0),
    "N": _unit("N", 1),
}
in_si_units: Mapping[str, Written] = {  # `read`: as a person compares it, with one digit behind the point
    **_SAME,
    "deg": _short(" deg", degrees),
    "deg/s": _short(" deg/s", degrees),
    "read rad": _unit("deg", 1, degrees),
    "rad": _unit("rad", 4),
    "m": _unit("m", 4),
    "rad/s": _unit("rad/s", 4),
    "m/s": _unit("m/s", 4),
    "rad/s2": _unit("rad/s^2", 4),
    "m/s2": _unit("m/s^2", 4),
}
in_display_units: Mapping[str, Written] = {
    **_SAME,
    "deg": _short("°", degrees),
    "deg/s": _short("°/s", degrees),
    "read rad": _unit("°", 1, degrees),
    "rad": _in_display("°", 1, degrees),
    "m": _in_display("mm", 1, _thousand),
    "rad/s": _in_display("°/s", 1, degrees),
    "m/s": _in_display("mm/s", 1, _thousand),
    "rad/s2": _in_display("°/s²", 1, degrees),
    "m/s2": _in_display("mm/s²", 1, _thousand),
}
