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
from gemelo.schemas.reasons import Reason, Remedy, because, remedy
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

    name: str  # as `word.quantity` of the catalogue has it
    units: Mapping[str, float]
    bare: str = ""  # empty: only 0 needs no unit


ANGLE = Quantity("angle", {"deg": DEGREE, "rad": 1.0})
ANGULAR_SPEED = Quantity("angular_speed", {"deg/s": DEGREE, "rad/s": 1.0})
LENGTH = Quantity("length", {"m": 1.0, "mm": MILLIMETRE}, "m")
SPEED = Quantity("speed", {"m/s": 1.0, "mm/s": MILLIMETRE}, "m/s")
ACCELERATION = Quantity("acceleration", {"m/s2": 1.0, "mm/s2": MILLIMETRE}, "m/s2")
TIME = Quantity("time", {"s": 1.0, "ms": 0.001}, "s")
SHARE = Quantity("share", {"%": 0.01})
FAR = {"m": 10.0, "m/s": 10.0}  # chosen as in gemelo.api.targets: without a unit, more was meant in millimetres
QUANTITIES = (ANGLE, ANGULAR_SPEED, LENGTH, SPEED, ACCELERATION, TIME, SHARE)
POSITION_OF = {"rad": ANGLE, "m": LENGTH}  # of a joint, by its SI unit
SPEED_OF = {"rad": ANGULAR_SPEED, "m": SPEED}
OF_JOINT = {"rad": "cli.unit.of_joint.turns", "m": "cli.unit.of_joint.slides"}


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
    found = _value_of(text, quantity)
    if isinstance(found, float):
        return found
    raise usage(because("cli.unit.of", found, owner=owner) if owner else found)


def _value_of(text: str, quantity: Quantity) -> float | Reason:
    """In the SI unit, or why it is none."""
    match, units = _VALUE.fullmatch(text), tuple(quantity.units)
    if match is None:
        hint = comma_hint(text) or remedy("write_with_unit", units=units)
        return because("cli.unit.not_a_quantity", hint, text=text, quantity=quantity.name)
    number, suffix = match.groups()
    if suffix is None and not quantity.bare and float(number):
        return because("cli.unit.without", remedy("with_unit", readings=_readings(number, quantity)), number=number)
    unit = _SPELLINGS.get(suffix, suffix) or quantity.bare or next(iter(quantity.units))
    if unit not in quantity.units:
        if any(unit in each.units for each in QUANTITIES):
            return because("cli.unit.other", text=text.strip(), units=units)
        return because("cli.unit.unknown", text=text.strip(), unit=str(suffix), units=units)
    value = float(number) * quantity.units[unit]
    if suffix is None and unit in FAR and math.isfinite(value) and abs(value) > FAR[unit]:
        return because("cli.unit.large", _smaller(number, unit), number=number, unit=unit, most=FAR[unit])
    return value if math.isfinite(value) else because("cli.unit.not_finite", text=text)


def _smaller(number: str, unit: str) -> Remedy:
    """What was likely meant by a number of metres, or metres a second, that no arm has."""
    meant = f"{number}m{unit}"
    if unit != "m" or abs(float(number)) >= 100.0:
        return remedy("did_you_mean_smaller", text=meant)
    return remedy("did_you_mean_centimetres", text=meant, metres=0.01 * float(number), number=number)


def _readings(number: str, quantity: Quantity) -> tuple[str, ...]:
    """What a number without a unit might mean."""
    if quantity is SHARE:
        small = (f"{100.0 * float(number):g}%",) if abs(float(number)) <= 1.0 else ()
        return (f"{number}%", *small)
    return tuple(f"{number}{unit}" for unit in quantity.units)


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
            example = next(iter(by_name), "joint")
            raise usage(because("cli.unit.no_assignment", text=assignment, joint=example))
        joint = by_name.get(name.strip()) or by_wire_name.get(name.strip())
        if joint is None:
            raise unknown("joint", name.strip(), by_name)
        if joint.name in values:
            raise usage(because("cli.unit.joint_twice", joint=joint.name))
        found = _value_of(text, quantity_of[joint.unit])
        if isinstance(found, Reason):
            raise usage(because(OF_JOINT[joint.unit], found, joint=joint.name))
        values[joint.name] = found
    return values


def parse_rotation(text: str, owner: str = "") -> float:
    """One of roll, pitch and yaw [rad]; more than a turn in radians is refused, for degrees were meant."""
    value = parse_quantity(text, ANGLE, owner)
    if abs(value) > MOST_OF_A_TURN and "rad" in text:
        why = because("cli.unit.more_than_a_turn", text=text, degrees=text.replace("rad", "deg"))
        raise usage(because("cli.unit.of", why, owner=owner) if owner else why)
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
        raise usage(because("cli.unit.not_positive", text=text))
    return value


@argument
def positive_length(text: str) -> float:
    """An argument's type: a length [m] above 0."""
    value = parse_quantity(text, LENGTH)
    if value <= 0.0:
        raise usage(because("cli.unit.not_positive", text=text))
    return value
