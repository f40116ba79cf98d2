"""Further limits of motion in a URDF: soft limits, the own limits of followers, calibration marks."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.checks.urdf import follower_range
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint
from gemelo.libraries.robot_import.mended import LEFT_OUT, Mended, numbers_in, subject_of
from gemelo.schemas.reasons import Value, because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
PLACES = 9  # significant digits of a limit that is written
ROUNDING = 1e-4  # [rad] or [m] by which limits that are meant to be the same may differ


def soft_limits(mended: Mended) -> None:
    """Where a <safety_controller> lets a joint move less far than its <limit>, as MoveIt plans: that far."""
    for element, joint in joints_of(mended):
        for safety in element.findall("safety_controller"):
            element.remove(safety)
            low, high = (_number(safety, key) for key in ("soft_lower_limit", "soft_upper_limit"))
            if joint.kind is JointKind.CONTINUOUS and (low, high) not in ((0.0, 0.0), (None, None)):
                mend = remedy("left_out_revolute_limit")
                turning = because("mend.soft.continuous", mend, low=_or_none(low), high=_or_none(high))
                mended.warn(safety, subject_of(element), turning)
            elif joint.kind is not JointKind.FIXED:
                _narrow_softly(mended, element, joint, safety)


def _narrow_softly(mended: Mended, element: ET.Element, joint: UrdfJoint, safety: ET.Element) -> None:
    low, high = (_number(safety, key) for key in ("soft_lower_limit", "soft_upper_limit"))
    lower, upper = ends_of(joint.limit)
    narrow = (max(lower, -math.inf if low is None else low), min(upper, math.inf if high is None else high))
    subject = subject_of(element)
    soft: dict[str, Value] = {"low": _or_none(low), "high": _or_none(high)}
    ends: dict[str, Value] = {**soft, "lower": lower, "upper": upper}
    if (low, high) == (0.0, 0.0) or (low, high) == (None, None):
        mended.say(safety, subject, because("mend.soft.none", LEFT_OUT))
    elif not narrow[0] < narrow[1]:
        mended.warn(safety, subject, because("mend.soft.no_travel", remedy("left_out_correct_them"), **ends))
    elif _is_near(low, lower) and _is_near(high, upper):
        mended.say(safety, subject, because("mend.soft.same", LEFT_OUT, **soft))
    elif _is_near(narrow[0], lower) and _is_near(narrow[1], upper):
        mended.say(safety, subject, because("mend.soft.beyond", remedy("limits_hold"), **ends))
    else:
        mend = remedy("written", text=set_ends(element, *narrow))
        mended.say(safety, subject, because("mend.soft.within", mend, **ends))


def _is_near(value: float | None, limit: float) -> bool:
    """True where they differ by no more than rounding."""
    return value is not None and abs(value - limit) < ROUNDING


def calibrations(mended: Mended) -> None:
    """The places of reference marks, which restrict nothing and are looked for by no switch of ours."""
    found = [(element, mark) for element, _ in joints_of(mended) for mark in element.findall("calibration")]
    for element, mark in found:
        element.remove(mark)
    if found:
        element, mark = found[0]
        words = " ".join(f'{key}="{value}"' for key, value in mark.items())
        mend, written = remedy("left_out_reference"), f"<calibration {words}>"
        what = because("mend.calibration", mend, element=written)
        if found[1:]:
            what = because("mend.calibration.more", mend, element=written, more=len(found) - 1)
        mended.say(mark, subject_of(element), what)


def followers(mended: Mended) -> None:
    """A joint that leads another beyond the other's own limit moves only so far as its follower may."""
    model = mended.model
    elements = dict(zip(model.joint_names, mended.xml.root.findall("joint"), strict=True))
    for joint in model.joints:
        leader = next((each for each in mended.model.joints if joint.mimic and each.name == joint.mimic.joint), None)
        reach = None if leader is None else follower_range(joint, leader)
        if leader is None or reach is None or leader.limit is None:
            continue
        if reach.narrow is not None:  # else it is an error, which others say
            element, written = elements[joint.name], set_ends(elements[leader.name], *reach.narrow)
            led: dict[str, Value] = {"low": reach.low, "high": reach.high, "lower": reach.lower, "upper": reach.upper}
            mend = remedy("written_of_joint", joint=leader.name, text=written)
            mended.say(element, subject_of(element), because("urdf.mimic.beyond", mend, leader=leader.name, **led))


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


def _or_none(value: float | None) -> Value:
    """The word for a soft limit that is not given."""
    return "none" if value is None else value
