"""Further limits of motion in a URDF: soft limits, the own limits of followers, calibration marks."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.checks.urdf import follower_range
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint
from gemelo.libraries.robot_import.mended import Mended, numbers_in

# Tuning constants: chosen, where a line does not say measured or standard.
PLACES = 9  # significant digits of a limit that is written
ROUNDING = 1e-4  # [rad] or [m] by which limits that are meant to be the same may differ


def soft_limits(mended: Mended) -> None:
    """Where a <safety_controller> lets a joint move less far than its <limit>, as MoveIt plans: that far."""
    for element, joint in joints_of(mended):
        for safety in element.findall("safety_controller"):
            element.remove(safety)
            low, high = (_number(safety, key) for key in ("soft_lower_limit", "soft_upper_limit"))
            said = f"its soft limits {_text(low)} to {_text(high)}"
            subject = f'joint "{joint.name}"'
            if joint.kind is JointKind.CONTINUOUS and (low, high) not in ((0.0, 0.0), (None, None)):
                remedy = 'left out: write type="revolute" and a <limit> where it must stay within them'
                mended.warn(safety, subject, f"{said} are of a continuous joint, which turns beyond them", remedy)
            elif joint.kind is not JointKind.FIXED:
                _narrow_softly(mended, element, joint, safety, said)


def _narrow_softly(mended: Mended, element: ET.Element, joint: UrdfJoint, safety: ET.Element, said: str) -> None:
    low, high = (_number(safety, key) for key in ("soft_lower_limit", "soft_upper_limit"))
    lower, upper = ends_of(joint.limit)
    narrow = (max(lower, -math.inf if low is None else low), min(upper, math.inf if high is None else high))
    subject = f'joint "{joint.name}"'
    if (low, high) == (0.0, 0.0) or (low, high) == (None, None):
        mended.say(safety, subject, "its <safety_controller> has no soft limits", "left out")
    elif not narrow[0] < narrow[1]:
        remedy = "left out: correct them where the joint must stay within them"
        mended.warn(safety, subject, f"{said} leave no travel within its limits {lower:g} to {upper:g}", remedy)
    elif _is_near(low, lower) and _is_near(high, upper):
        mended.say(safety, subject, f"{said} are its limits", "left out")
    elif _is_near(narrow[0], lower) and _is_near(narrow[1], upper):
        mended.say(safety, subject, f"{said} are not within its limits {lower:g} to {upper:g}", "the limits hold")
    else:
        mended.say(safety, subject, f"{said} are within its limits {lower:g} to {upper:g}", set_ends(element, *narrow))


def _is_near(value: float | None, limit: float) -> bool:
    """True where they differ by no more than rounding."""
    return value is not None and abs(value - limit) < ROUNDING


def calibrations(mended: Mended) -> None:
    """The places of reference marks, which restrict nothing and are looked for by no switch of ours."""
    found = [(element, joint, mark) for element, joint in joints_of(mended) for mark in element.findall("calibration")]
    for element, _, mark in found:
        element.remove(mark)
    if found:
        _, joint, mark = found[0]
        more = f", and of {len(found) - 1} more" if found[1:] else ""
        words = " ".join(f'{key}="{value}"' for key, value in mark.items())
        message = f"its <calibration {words}> says where a reference mark is{more}"
        remedy = "left out: `reference_position` and [joint.homing] in robot.toml say that here"
        mended.say(mark, f'joint "{joint.name}"', message, remedy)


def followers(mended: Mended) -> None:
    """A joint that leads another beyond the other's own limit moves only so far as its follower may."""
    model = mended.model
    elements = dict(zip(model.joint_names, mended.xml.root.findall("joint"), strict=True))
    for joint in model.joints:
        leader = next((each for each in mended.model.joints if joint.mimic and each.name == joint.mimic.joint), None)
        reach = None if leader is None else follower_range(joint, leader)
        if leader is None or reach is None or leader.limit is None:
            continue
        subject, element = f'joint "{joint.name}"', elements[joint.name]
        far = f'follows "{leader.name}" from {reach.low:.6g} to {reach.high:.6g}'
        message = f"{far}, beyond its own limits {reach.lower:g} to {reach.upper:g}"
        if reach.narrow is not None:  # else it is an error, which others say
            written = set_ends(elements[leader.name], *reach.narrow)
            mended.say(element, subject, message, f'joint "{leader.name}": {written}')


def joints_of(mended: Mended) -> list[tuple[ET.Element, UrdfJoint]]:
    """Each <joint>, and how it was read."""
    return list(zip(mended.xml.root.findall("joint"), mended.model.joints, strict=True))


def ends_of(limit: Limit | None) -> tuple[float, float]:
    """[rad] or [m] of a travel that has sense; else none."""
    return (limit.lower, limit.upper) if limit is not None and limit.lower < limit.upper else (-math.inf, math.inf)


def set_ends(element: ET.Element, lower: float, upper: float) -> str:
    """Writes the ends [rad] or [m] that are finite into the <limit> of a joint, and returns them as written."""
    limit = element.find("limit")
    if limit is None:
        limit = ET.SubElement(element, "limit")
    written = {key: f"{end:.{PLACES}g}" for key, end in (("lower", lower), ("upper", upper)) if math.isfinite(end)}
    limit.attrib.update(written)
    return " ".join(f'{key}="{end}"' for key, end in written.items())


def _number(element: ET.Element, key: str) -> float | None:
    found = numbers_in(element.get(key, ""))
    return found[0] if found and len(found) == 1 and math.isfinite(found[0]) else None


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"
