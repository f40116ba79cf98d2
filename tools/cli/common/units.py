"""Numbers with units as a person writes them (`30deg`, `40mm`, `50%`), to SI and back.

A length or speed without a unit is in m or m/s. An angle or a share without a unit is refused with its readings, unless
it is 0. A unit of another quantity is refused: a metre is never taken for a radian.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, Protocol

import gemelo
from gemelo.tools.cli.common.errors import CommandError, unknown, usage
from gemelo.tools.cli.parser import comma_hint

DEGREE = gemelo.deg(1.0)
MILLIMETRE = gemelo.mm(1.0)
# What a person reads for an SI unit, and its factor.
SHOWN = {"rad": ("deg", 1.0 / DEGREE), "m": ("mm", 1.0 / MILLIMETRE)}
MOST_OF_A_TURN = 2.0 * math.pi  # [rad]

_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z°%][A-Za-z0-9/^²]*)?\s*")
_SPELLINGS = {"°": "deg", "°/s": "deg/s", "m/s^2": "m/s2", "m/s²": "m/s2", "mm/s^2": "mm/s2", "mm/s²": "mm/s2"}


class Quantity(NamedTuple):
    """A physical quantity: its units with their factors to SI, and the unit of a number without one."""

    noun: str
    units: Mapping[str, float]
    bare: str = ""  # empty: only 0 needs no unit

    @property
    def choice(self) -> str:
        """The units, as `deg or rad`."""
        return " or ".join(self.units)


ANGLE = Quantity("an angle", {"deg": DEGREE, "rad": 1.0})
ANGULAR_SPEED = Quantity("an angular speed", {"deg/s": DEGREE, "rad/s": 1.0})
LENGTH = Quantity("a length", {"m": 1.0, "mm": MILLIMETRE}, "m")
SPEED = Quantity("a speed", {"m/s": 1.0, "mm/s": MILLIMETRE}, "m/s")
ACCELERATION = Quantity("an acceleration", {"m/s2": 1.0, "mm/s2": MILLIMETRE}, "m/s2")
TIME = Quantity("a time", {"s": 1.0, "ms": 0.001}, "s")
SHARE = Quantity("a share", {"%": 0.01})
FAR = {"m": 10.0, "m/s": 10.0}  # chosen as in gemelo.api.targets: without a unit, more was meant in millimetres
QUANTITIES = (ANGLE, ANGULAR_SPEED, LENGTH, SPEED, ACCELERATION, TIME, SHARE)
POSITION_OF = {"rad": ANGLE, "m": LENGTH}  # of a joint, by its SI unit
SPEED_OF = {"rad": ANGULAR_SPEED, "m": SPEED}
VERB_OF = {"rad": "turns", "m": "slides"}


class NamedJoint(Protocol):
    """The properties of a joint that are needed here; `gemelo.libraries.arm` has them."""

    @property
    def name(self) -> str: ...
    @property
    def wire_name(self) -> str: ...
    @property
    def unit(self) -> str: ...


def parse_quantity(text: str, quantity: Quantity, owner: str = "") -> float:
    """`text` in the SI unit of `quantity`; raises `CommandError` naming `owner`, the units and the readings."""
    lead = f"{owner}: " if owner else ""
    match = _VALUE.fullmatch(text)
    if match is None and (hint := comma_hint(text)):
        raise usage(f'{lead}"{text}" is not {quantity.noun}: {hint}')
    if match is None:
        raise usage(f'{lead}"{text}" is not {quantity.noun}: write a number and a unit, {quantity.choice}')
    number, suffix = match.groups()
    if suffix is None and not quantity.bare and float(number):
        raise usage(f"{lead}{number} what: {_readings(number, quantity)}?")
    unit = _SPELLINGS.get(suffix, suffix) or quantity.bare or next(iter(quantity.units))
    if unit not in quantity.units:
        known = any(unit in each.units for each in QUANTITIES)
        said = text.strip() if known else f'"{suffix}" is not a unit: {text.strip()}'
        raise usage(f"{lead}{said} must be in {quantity.choice}")
    value = float(number) * quantity.units[unit]
    if suffix is None and unit in FAR and math.isfinite(value) and abs(value) > FAR[unit]:
        most = f"{FAR[unit]:g} {unit}"
        raise usage(f"{lead}{number} without a unit is in {unit}, and more than {most}: {_smaller(number, unit)}?")
    if not math.isfinite(value):
        raise usage(f"{lead}{text} is not finite")
    return value


def _smaller(number: str, unit: str) -> str:
    """What was likely meant by a number of metres, or metres a second, that no arm has."""
    centimetres = f" or {0.01 * float(number):g} for {number} cm" if unit == "m" and abs(float(number)) < 100.0 else ""
    return f"did you mean {number}m{unit}{centimetres}"


def _readings(number: str, quantity: Quantity) -> str:
    """What a number without a unit might mean."""
    if quantity is SHARE:
        return f"{number}% or {100.0 * float(number):g}%" if abs(float(number)) <= 1.0 else f"{number}%"
    return " or ".join(f"{number}{unit}" for unit in quantity.units)


def parse_joints(
    assignments: Iterable[str], joints: Iterable[NamedJoint], quantity_of: Mapping[str, Quantity] = POSITION_OF
) -> dict[str, float]:
    """`["brazo_joint=30deg", "q3=40mm"]` to values in [rad] or [m] by joint name; wire names are known too.

    With `SPEED_OF`, values are speeds in [rad/s] or [m/s]. Raises `CommandError` naming the joint.
    """
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
        owner = f'joint "{joint.name}" {VERB_OF[joint.unit]}'
        values[joint.name] = parse_quantity(text, quantity_of[joint.unit], owner)
    return values


def parse_rotation(text: str, owner: str = "") -> float:
    """One of roll, pitch and yaw [rad]; more than a turn in radians is refused, for degrees were meant."""
    value = parse_quantity(text, ANGLE, owner)
    if abs(value) > MOST_OF_A_TURN and "rad" in text:
        lead = f"{owner}: " if owner else ""
        raise usage(f"{lead}{text} is more than a turn: write {text.replace('rad', 'deg')} for degrees")
    return value


def show(value: float, unit: str, digits: int = 3) -> str:
    """An SI value in `unit` ("rad" or "m") as a person reads it: degrees or millimetres."""
    shown, factor = SHOWN[unit]
    return f"{value * factor:z.{digits}f} {shown}"  # z: no "-0.00"


def argument(parse: Callable[[str], float]) -> Callable[[str], float]:
    """`parse`, from text to a value in its SI unit, as the type of an argument of argparse, which names the argument
    itself."""

    def parsed(text: str) -> float:
        try:
            return parse(text)
        except CommandError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parsed


def _argument_in(quantity: Quantity) -> Callable[[str], float]:
    return argument(lambda text: parse_quantity(text, quantity))


length, speed, acceleration = _argument_in(LENGTH), _argument_in(SPEED), _argument_in(ACCELERATION)
angle, angular_speed = _argument_in(ANGLE), _argument_in(ANGULAR_SPEED)
seconds, share = _argument_in(TIME), _argument_in(SHARE)
rotation = argument(parse_rotation)


@argument
def positive_seconds(text: str) -> float:
    """An argument's type: a time [s] above 0."""
    value = parse_quantity(text, TIME)
    if value <= 0.0:
        raise usage(f"{text} is not above 0")
    return value


@argument
def positive_length(text: str) -> float:
    """An argument's type: a length [m] above 0."""
    value = parse_quantity(text, LENGTH)
    if value <= 0.0:
        raise usage(f"{text} is not above 0")
    return value
