"""Limits that the URDF lacks, asked for with defaults and written into its elements."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from services.arm.model.urdf import JointKind, UrdfJoint
from services.robot_import.mending import Mended
from services.robot_import.questions import Questions, above_zero, number

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_TRAVEL = {JointKind.REVOLUTE: 8.02 * math.pi, JointKind.PRISMATIC: 5.0}  # [rad], [m]: beyond it is another unit
MOST_VELOCITY = 50.0  # [rad/s] or [m/s]
TURN, SLIDE = math.pi, 0.2  # [rad] each way, [m]
VELOCITY, SLIDE_VELOCITY = 1.0, 0.1  # [rad/s], [m/s]
EFFORT = 10.0  # [N m] or [N]


def ask_limits(mended: Mended, questions: Questions) -> None:
    """Completes every joint that moves: what is missing, zero or implausible is asked for."""
    elements = {joint.get("name"): joint for joint in mended.xml.root.findall("joint")}
    for joint in mended.model.joints:
        if joint.kind is not JointKind.FIXED and joint.mimic is None:
            _complete(joint, elements[joint.name], mended, questions)


def _complete(joint: UrdfJoint, element: ET.Element, mended: Mended, questions: Questions) -> None:
    slides, limit = joint.kind is JointKind.PRISMATIC, joint.limit
    unit = "m" if slides else "rad"
    wanted: dict[str, float] = {}

    def ask(key: str, default: float, positive: bool = True) -> None:
        question = f'joint "{joint.name}": {key} [{_unit_of(key, unit)}]'
        reader = above_zero if positive else number
        wanted[key] = questions.ask(f"{joint.name}.{key}", question, f"{default:.6g}", reader)

    travel = MOST_TRAVEL.get(joint.kind, math.inf)
    if joint.kind is not JointKind.CONTINUOUS and (limit is None or not 0.0 < limit.upper - limit.lower <= travel):
        ask("lower", 0.0 if slides else -TURN, positive=False)
        ask("upper", SLIDE if slides else TURN, positive=False)
    if limit is None or not 0.0 < limit.velocity <= MOST_VELOCITY:
        ask("velocity", SLIDE_VELOCITY if slides else VELOCITY)
    if limit is None or not limit.effort > 0.0:
        ask("effort", EFFORT)
    if wanted:
        is_given = all(questions.was_given(f"{joint.name}.{key}") for key in wanted)
        _write(joint, element, wanted, mended, is_given)


def _write(joint: UrdfJoint, element: ET.Element, wanted: dict[str, float], mended: Mended, is_given: bool) -> None:
    limit = element.find("limit")
    if limit is None:
        limit = ET.SubElement(element, "limit")
        mended.xml.lines[limit] = joint.line
    was = ", ".join(f"{key} {limit.get(key, 'missing')}" for key in wanted)
    now = " ".join(f'{key}="{value:.9g}"' for key, value in wanted.items())
    subject, message = f'joint "{joint.name}"', f"its limits lack sense ({was})"
    if is_given:
        mended.say(limit, subject, message, now)
    else:
        mended.warn(limit, subject, message, f"{now} by default: correct it in robot.urdf")
    for key, value in wanted.items():
        limit.set(key, f"{value:.9g}")


def _unit_of(key: str, unit: str) -> str:
    return {"velocity": f"{unit}/s", "effort": "N" if unit == "m" else "N m"}.get(key, unit)
