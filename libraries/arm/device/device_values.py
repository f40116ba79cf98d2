"""Single values as a device's configuration holds them: whole numbers of 32 bits, short names, pins."""

from __future__ import annotations

import math
import re
from fractions import Fraction

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.virtual_drive import MAX_NAME
from gemelo.schemas.device_config import UNUSED

NAME = re.compile(rf"[A-Za-z0-9_-]{{1,{MAX_NAME}}}")


def nearest(value: Fraction) -> int:
    """The nearest integer (dimensionless), halves upwards."""
    return math.floor(value + Fraction(1, 2))


def int32(value: int, where: str) -> int:
    """`value`, if the wire's integers hold it; raises `DescriptionError`."""
    if not -(2**31) <= value < 2**31:
        raise DescriptionError(f"{where} is {value} on the wire, which does not fit its 32 bits: make it smaller")
    return value


def device_name(text: str, where: str) -> str:
    """`text`, if the firmware takes it as a name; raises `DescriptionError`."""
    if not NAME.fullmatch(text):
        raise DescriptionError(f'{where} "{text}" is not 1 to {MAX_NAME} letters, digits, "_" or "-"')
    return text


def pin_or_unused(pin: int | None) -> int:
    """The GPIO, or the number that stands for none."""
    return UNUSED if pin is None else pin
