"""A planner's refusal in the language and units of the page: from its check, subject, value and limit, not its text."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from gemelo.libraries.arm.model.description import Joint
from gemelo.services.panel.model.problems import Problem
from gemelo.services.panel.model.units import text_of

Joints = Mapping[str, Joint]  # by name
Show = Callable[[Problem, Joints, float], str]
ON_LINE = re.compile(r"at ([\d.]+) m of ([\d.]+) m along the path")
ON_TURN = re.compile(r"at ([\d.]+)% of the turn along the path")


def sentence_of(problem: Problem, joints: Joints, templates: Mapping[str, str]) -> str | None:
    """The template of its check with its values put in; None where there is none, or a value that it needs is missing.

    Some checks have several templates, as `_variant` says.
    """
    place, variant = key_of(problem.check), _variant(problem)
    template = templates.get(f"{place}_{variant}" if variant else place)
    if template is None and problem.value is None:
        template = templates.get(place)  # one that needs no value
        template = template if template and "{value}" not in template else None
    if template is None:
        return None
    show = SHOWN.get(problem.check)
    values = {
        name: "" if value is None or show is None else show(problem, joints, value)
        for name, value in (("value", problem.value), ("limit", problem.limit), ("beyond", _beyond(problem)))
    }
    first, _, second = problem.subject.partition(" / ")
    return template.format(subject=problem.subject, first=first, second=second, **values)


def place_of(problem: Problem) -> tuple[str, dict[str, str]] | None:
    """Where on its path a motion of the tool would end, as the key of a template and its values; None where it is no
    such motion."""
    if found := ON_LINE.search(str(problem.reason or "")):
        gone, whole = (f"{1000.0 * float(metres):.0f}" for metres in found.groups())
        return "place_on_line", {"gone": gone, "whole": whole}
    if found := ON_TURN.search(str(problem.reason or "")):
        return "place_on_turn", {"share": f"{float(found[1]):.0f}"}
    return None


def key_of(check: str) -> str:
    """The check as the tables' keys have it."""
    return check.replace("-", " ").replace(" ", "_")


def _variant(problem: Problem) -> str:
    """Of the check's template: "axis" where the subject is one of the tool's, "touch" where two things do, "inside"
    where it is known how deep, "own" where the subject is what was asked for, "unknown" without a value."""
    if problem.subject in ("x", "y", "z"):
        return "axis"
    if problem.value is None:
        return "unknown"
    if problem.subject == problem.check:
        return "" if problem.check not in PAIRS else "own"
    if problem.check not in PAIRS or problem.value > 0.0:
        return ""
    return "inside" if problem.value < 0.0 and problem.check != "clearance" else "touch"


def _beyond(problem: Problem) -> float | None:
    """How far the value is from its limit, in the unit of the check; None where one of them is not known."""
    return None if problem.value is None or problem.limit is None else abs(problem.value - problem.limit)


def _of_joint(problem: Problem, joints: Joints, value: float) -> str:
    joint = joints.get(problem.subject)
    return f"{value:g}" if joint is None else text_of(joint, value)


def _of_speed(problem: Problem, joints: Joints, value: float) -> str:
    return f"{_of_joint(problem, joints, value)}/s"


def _millimetres(problem: Problem, joints: Joints, value: float) -> str:
    return f"{1000.0 * value:.1f} mm"


def _between(problem: Problem, joints: Joints, value: float) -> str:
    """How far apart two things are, or how deep one is inside the other."""
    return _millimetres(problem, joints, abs(value))


def _degrees(problem: Problem, joints: Joints, value: float) -> str:
    return f"{math.degrees(value):.1f}°"


def _seconds(problem: Problem, joints: Joints, value: float) -> str:
    return f"{value:.1f} s"


def _per_cent(problem: Problem, joints: Joints, value: float) -> str:
    return f"{100.0 * value:.0f} %"


def _plain(problem: Problem, joints: Joints, value: float) -> str:
    return f"{value:g}"


PAIRS = ("collision", "self-collision", "clearance")
# By the planner's check: how its value and its limit are shown.
SHOWN: dict[str, Show] = {
    "joint limit": _of_joint,
    "start state": _of_joint,
    "moving start": _of_speed,
    "reach": _millimetres,
    "collision": _between,
    "self-collision": _between,
    "clearance": _millimetres,
    "orientation": _degrees,
    "joint state": _seconds,
    "allowed time": _seconds,
    "jump": _of_joint,
    "configuration": _of_joint,
    "pull-out torque": _per_cent,
    "step rate": _per_cent,
    "pulse width": _per_cent,
    "device queue": _per_cent,
    "confidence": _per_cent,
    "points": _plain,
    "tool limit": _plain,
}
