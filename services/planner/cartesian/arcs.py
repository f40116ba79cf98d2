"""An arc of the tool from what was asked: a point on it, or its centre; what is no arc is refused with the figure."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose
from gemelo.schemas.planning import PlanCode
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.cartesian.tool_path import ArcPiece
from gemelo.services.planner.request.refusals import PlanRefused, refusal_of

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SAME_POINT = 1e-6  # [m] chosen: far below a motor step, far above a float's rounding
SAME_RADIUS = 1e-4  # [m] by which a centre may be nearer to one end: it is then moved to the middle
STRAIGHT = 1e-4  # sine of an angle below which three points are on a line
FARTHEST = 1e6  # [m] chosen: beyond any cell, and a float still tells a micrometre there


def arc_through(start: FramePose, interim: Array, end: FramePose) -> ArcPiece:
    """The arc from `start` through `interim` (3,) [m] in the base frame to `end`; raises `PlanRefused`."""
    to_interim, to_end = interim - start.position, end.position - start.position
    _require_way("interim", interim, start.position, end.position)
    normal = np.cross(to_interim, to_end)
    sine = float(np.linalg.norm(normal)) / float(np.linalg.norm(to_interim) * np.linalg.norm(to_end))
    if sine < STRAIGHT:
        raise _refused("interim", sine, STRAIGHT, because("plan.arc.line", remedy("by_line")))
    squares = float(to_interim @ to_interim) * to_end - float(to_end @ to_end) * to_interim
    centre = start.position + np.cross(squares, normal) / (2.0 * float(normal @ normal))
    normal = normal / float(np.linalg.norm(normal))
    return _arc(start, end, centre, normal, _angle(start.position - centre, end.position - centre, normal))


def arc_about(start: FramePose, centre: Array, end: FramePose) -> ArcPiece:
    """The shorter arc from `start` to `end` about `centre` (3,) [m] in the base frame; raises `PlanRefused`."""
    _require_way("center", centre, start.position, end.position)
    first, last = start.position - centre, end.position - centre
    radii = float(np.linalg.norm(first)), float(np.linalg.norm(last))
    if abs(radii[0] - radii[1]) > SAME_RADIUS:
        would_do = remedy("even_centre"), remedy("give_interim")
        why = because("plan.arc.radii", *would_do, of_start=radii[0], of_goal=radii[1])
        raise _refused("center", abs(radii[0] - radii[1]), SAME_RADIUS, why)
    normal = np.cross(first, last)
    sine = float(np.linalg.norm(normal)) / (radii[0] * radii[1])
    if sine < STRAIGHT:
        raise _refused("center", sine, STRAIGHT, because("plan.arc.many", remedy("give_interim")))
    chord = end.position - start.position
    centre = centre - chord * float((centre - 0.5 * (start.position + end.position)) @ chord) / float(chord @ chord)
    normal = normal / float(np.linalg.norm(normal))
    return _arc(start, end, centre, normal, _angle(start.position - centre, end.position - centre, normal))


def _arc(start: FramePose, end: FramePose, centre: Array, normal: Array, angle: float) -> ArcPiece:
    return ArcPiece(start, centre, normal, angle, pin.log3(end.rotation @ start.rotation.T))


def _angle(first: Array, last: Array, normal: Array) -> float:
    """(0, 2 pi) [rad] from one to the other about the normal."""
    return math.atan2(float(np.cross(first, last) @ normal), float(first @ last)) % math.tau


def _require_way(name: str, point: Array, start: Array, end: Array) -> None:
    if not np.abs(point).max() < FARTHEST:
        farthest = float(np.abs(point).max())
        why = because("plan.arc.far", remedy("in_metres"), name=name, value=farthest, most=FARTHEST)
        raise _refused(name, farthest, FARTHEST, why)
    for what, one, other in (("goal", start, end), (name, start, point), (name, end, point)):
        distance = float(np.linalg.norm(one - other))
        if distance < SAME_POINT:
            where = "start" if one is start else "goal"
            would_do = remedy("other_point"), remedy("by_line")
            if end is other and what == "goal":
                would_do = remedy("two_halves"), remedy("other_point")
            why = because("plan.arc.same", *would_do, point=what, other=where, distance=distance)
            raise _refused(what, distance, SAME_POINT, why)


def _refused(subject: str, value: float, limit: float, why: Reason) -> PlanRefused:
    refusal = refusal_of(why, "arc", subject, value, limit)
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)
