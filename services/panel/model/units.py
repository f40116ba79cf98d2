"""Joint values as a person reads them: degrees for turning joints, millimetres for sliding ones."""

from __future__ import annotations

import re
from math import degrees, inf, pi, radians

from gemelo.libraries.arm.model.description import Joint

SHOWN = {"rad": "°", "m": "mm"}
STEP = {"rad": 0.1, "m": 0.1}  # [deg] or [mm] of a slider
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
ANGLES = re.compile(rf"({NUMBER}(?:(?:, | to | and | \.\. ){NUMBER})*) rad\b")  # also of a speed, as "0.5 rad/s"
TURNS = 360.0  # [deg] both ways, that the slider of a joint without limits offers


def shown(joint: Joint, value: float) -> float:
    """[deg] or [mm] of `value` [rad] or [m]."""
    return degrees(value) if joint.unit == "rad" else 1000.0 * value


def meant(joint: Joint, value: float) -> float:
    """[rad] or [m] of `value` [deg] or [mm], within the limits: a slider's end is rounded."""
    return joint.clamp(radians(value) if joint.unit == "rad" else value / 1000.0)


def slider_range(joint: Joint) -> tuple[float, float]:
    """[deg] or [mm] where the slider begins and ends."""
    if joint.upper == inf:
        return -TURNS, TURNS
    return round(shown(joint, joint.lower), 1), round(shown(joint, joint.upper), 1)


def slider_value(joint: Joint, value: float) -> float:
    """[deg] or [mm] where the slider stands for `value` [rad] or [m]: on one of its steps, which its field has room "
    "for."""
    lower, upper = slider_range(joint)
    return round(min(max(shown(joint, value), lower), upper), 1)


def text_of(joint: Joint, value: float) -> str:
    """The value with its unit."""
    return f"{shown(joint, value):.2f} {SHOWN[joint.unit]}"


def in_degrees(text: str) -> str:
    """A sentence of another part with its angles in degrees."""

    def turned(found: re.Match[str]) -> str:
        return re.sub(NUMBER, lambda number: f"{degrees(float(number[0])):.2f}", found[1]) + " °"

    return ANGLES.sub(turned, text)


def jog_speed(joint: Joint, share: float) -> float:
    """[rad/s] or [m/s] at `share` of the joint's limit, a quarter turn a second at most."""
    return share * min(joint.velocity, pi / 2 if joint.unit == "rad" else 0.1)
