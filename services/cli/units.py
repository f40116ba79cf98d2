"""What a person writes (`brazo_joint=30deg`, `efector_joint=40mm`) to SI, and back.

A bare number is SI: rad for a turning joint, m for a sliding one. A unit of the wrong kind is refused: a metre
is never taken for a radian.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable
from typing import Protocol

from services.cli.errors import CommandError, unknown, usage

SI_PER_UNIT = {"deg": math.radians(1.0), "rad": 1.0, "m": 1.0, "mm": 0.001}
SI_UNIT = {"deg": "rad", "rad": "rad", "m": "m", "mm": "m"}
SHOWN = {"rad": ("deg", 180.0 / math.pi), "m": ("mm", 1000.0)}

_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z°]*)\s*")


class NamedJoint(Protocol):
    """What is asked of a joint here; `services.arm` has it."""

    @property
    def name(self) -> str: ...
    @property
    def wire_name(self) -> str: ...
    @property
    def unit(self) -> str: ...


def parse_value(text: str, unit: str, owner: str) -> float:
    """`text` in [rad] or [m] as `unit` ("rad" or "m") says; `owner` is named where it cannot be."""
    match = _VALUE.fullmatch(text)
    if match is None:
        raise usage(f'"{text}" is not a value for {owner}: write a number and a unit, as 30deg, 0.5rad, 40mm or 0.04m')
    number, suffix = match.groups()
    suffix = "deg" if suffix == "°" else suffix or unit
    if suffix not in SI_PER_UNIT:
        raise usage(f'"{suffix}" is not a unit for {owner}: use {units_of(unit)}')
    if SI_UNIT[suffix] != unit:
        raise usage(f"{owner} {'turns' if unit == 'rad' else 'slides'}: {text} must be in {units_of(unit)}")
    value = float(number) * SI_PER_UNIT[suffix]
    if not math.isfinite(value):
        raise usage(f"{text} for {owner} is not finite")
    return value


def units_of(unit: str) -> str:
    """The units that a person may use where SI has `unit`."""
    return " or ".join(name for name, base in SI_UNIT.items() if base == unit)


def parse_joints(assignments: Iterable[str], joints: Iterable[NamedJoint]) -> dict[str, float]:
    """`["brazo_joint=30deg", "q3=40mm"]` to values in [rad] or [m] by joint name; wire names will do too."""
    by_name = {joint.name: joint for joint in joints}
    by_wire_name = {joint.wire_name: joint for joint in by_name.values()}
    values: dict[str, float] = {}
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        if not equals:
            raise usage(f'"{assignment}" is not a joint and its value: write {next(iter(by_name), "joint")}=30deg')
        joint = by_name.get(name.strip()) or by_wire_name.get(name.strip())
        if joint is None:
            raise unknown("joint", name.strip(), by_name)
        if joint.name in values:
            raise usage(f'joint "{joint.name}" is given twice')
        values[joint.name] = parse_value(text, joint.unit, f'joint "{joint.name}"')
    return values


def show(value: float, unit: str, digits: int = 3) -> str:
    """An SI value as a person reads it: degrees or millimetres."""
    shown, factor = SHOWN[unit]
    return f"{value * factor:z.{digits}f} {shown}"  # z: no "-0.00"


def length(text: str) -> float:
    """[m], from 0.3 or 300mm."""
    return _measured(text, "m")


def turn(text: str) -> float:
    """[rad], from 90deg or 1.57rad; a bare number is in degrees."""
    return _measured(f"{text}deg" if text[-1:].isdecimal() else text, "rad")


def _measured(text: str, unit: str) -> float:
    try:
        return parse_value(text, unit, "it")
    except CommandError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
