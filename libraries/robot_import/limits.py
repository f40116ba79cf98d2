"""Limits that the URDF lacks, asked for with defaults and written into its elements."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint
from gemelo.libraries.robot_import.mended import Mended, subject_of
from gemelo.libraries.robot_import.questions import Questions, above_zero, number
from gemelo.schemas.reasons import because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_TRAVEL = {JointKind.REVOLUTE: 8.02 * math.pi, JointKind.PRISMATIC: 5.0}  # [rad], [m]: beyond it is another unit
MOST_VELOCITY = 50.0  # [rad/s] or [m/s]
TURN, SLIDE = math.pi, 0.2  # [rad] each way, [m]
VELOCITY, SLIDE_VELOCITY = 1.0, 0.1  # [rad/s], [m/s]
EFFORT = 10.0  # [N m] or [N]
DEGREE, MILLIMETRE = math.pi / 180.0, 0.001  # [rad], [m]
LEAST_SHARE = 0.1  # of the default: a velocity that would be less is no other unit


def ask_limits(mended: Mended, questions: Questions) -> None:
    """Completes every joint that moves: what is missing, zero or implausible is asked for."""
    for element, joint in zip(mended.xml.root.findall("joint"), mended.model.joints, strict=True):
        if joint.kind is not JointKind.FIXED and joint.mimic is None:
            _complete(joint, element, mended, questions)


def _complete(joint: UrdfJoint, element: ET.Element, mended: Mended, questions: Questions) -> None:
    slides, limit = joint.kind is JointKind.PRISMATIC, joint.limit
    unit = "m" if slides else "rad"
    wanted: dict[str, float] = {}

    def ask(key: str, default: float, positive: bool = True) -> None:
        question = because("import.ask.limit", joint=joint.name, limit=key, unit=_unit_of(key, unit))
        reader = above_zero if positive else number
        wanted[key] = questions.ask(f"{joint.name}.{key}", question, f"{default:.6g}", reader)

    travel = MOST_TRAVEL.get(joint.kind, math.inf)
    if joint.kind is not JointKind.CONTINUOUS and (limit is None or not 0.0 < limit.upper - limit.lower <= travel):
        lower, upper = _likely_travel(limit, slides)
        ask("lower", lower, positive=False)
        ask("upper", upper, positive=False)
    if limit is None or not 0.0 < limit.velocity <= MOST_VELOCITY:
        ask("velocity", _likely_velocity(limit, slides))
    if limit is None or not limit.effort > 0.0:
        ask("effort", EFFORT)
    if wanted:
        is_given = all(questions.was_given(f"{joint.name}.{key}") for key in wanted)
        _write(joint, element, wanted, mended, is_given)


def _likely_travel(limit: Limit | None, slides: bool) -> tuple[float, float]:
    """[rad] or [m] what limits without sense were meant to be: turned about, in degrees, or in millimetres."""
    unknown = (0.0, SLIDE) if slides else (-TURN, TURN)
    if limit is None or limit.lower == limit.upper:
        return unknown
    low, high = sorted((limit.lower, limit.upper))
    kind = JointKind.PRISMATIC if slides else JointKind.REVOLUTE
    scales = (1.0, MILLIMETRE if slides else DEGREE)
    return next(((low * x, high * x) for x in scales if (high - low) * x <= MOST_TRAVEL[kind]), unknown)


def _likely_velocity(limit: Limit | None, slides: bool) -> float:
    """[rad/s] or [m/s] what a velocity without sense was meant to be, in degrees or millimetres per second."""
    meant = (limit.velocity if limit is not None else 0.0) * (MILLIMETRE if slides else DEGREE)
    unknown = SLIDE_VELOCITY if slides else VELOCITY
    return meant if LEAST_SHARE * unknown < meant <= MOST_VELOCITY else unknown


def _write(joint: UrdfJoint, element: ET.Element, wanted: dict[str, float], mended: Mended, is_given: bool) -> None:
    limit = element.find("limit")
    if limit is None:
        limit = ET.SubElement(element, "limit")
        mended.xml.lines[limit] = joint.line
    was = tuple(f"{key} {limit.get(key)}" if key in limit.attrib else key for key in wanted)  # else it is missing
    now = " ".join(f'{key}="{value:.9g}"' for key, value in wanted.items())
    if is_given:
        mended.say(limit, subject_of(element), because("mend.limits", remedy("written", text=now), was=was))
    else:
        mend = remedy("written_by_default", text=now)
        mended.warn(limit, subject_of(element), because("mend.limits", mend, was=was))
    for key, value in wanted.items():
        limit.set(key, f"{value:.9g}")


def _unit_of(key: str, unit: str) -> str:
    return {"velocity": f"{unit}/s", "effort": "N" if unit == "m" else "N m"}.get(key, unit)
