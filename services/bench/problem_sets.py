"""The fixed random problems that plans are measured on; `problem_making` has made them, once.

Every problem can be solved: a free way from its start to its goal is known, and how long the shortest known one is.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from schemas.joints import JointState
from schemas.planning import FreeMotion, JointGoal, PlanRequest, PoseGoal
from services.arm.description import Arm
from services.arm.kinematics import Kinematics

Array = NDArray[np.float64]

FILE = Path(__file__).parent / "problem_sets.json"
COUNT = 200  # a scene and arm
ALLOWED = 1.0  # [s]


class Problem(msgspec.Struct, frozen=True, array_like=True):
    """From rest to rest; joint values in the arm's order."""

    start: tuple[float, ...]
    goal: tuple[float, ...]  # a posture; what is asked for is the tool's pose there, where `is_pose`
    is_pose: bool
    length: float  # [s at full speed] of the shortest way known, to any posture that is asked for
    found_by: str


class ProblemSet(msgspec.Struct, frozen=True):
    """The problems of one arm in one scene, and how many pairs of free postures were drawn until there were so many."""

    arm: str
    scene: str
    drawn: int
    problems: tuple[Problem, ...]


@cache
def problem_sets() -> tuple[ProblemSet, ...]:
    """All of them."""
    return msgspec.json.decode(FILE.read_bytes(), type=tuple[ProblemSet, ...])


def problem_set(arm: str, scene: str) -> ProblemSet:
    """The one of that arm and scene."""
    for each in problem_sets():
        if (each.arm, each.scene) == (arm, scene):
            return each
    raise LookupError(f"there are no problems of {arm} in {scene}: python -m services.bench.problem_making")


def text_of(sets: tuple[ProblemSet, ...]) -> str:
    """As `problem_sets` reads it, a problem a line."""
    return "[\n" + ",\n".join(map(_text, sets)) + "\n]\n"


def _text(each: ProblemSet) -> str:
    head = msgspec.json.encode(msgspec.structs.replace(each, problems=())).decode().removesuffix("[]}")
    return head + "[\n" + ",\n".join(msgspec.json.encode(problem).decode() for problem in each.problems) + "]}"


def request_of(problem: Problem, arm: Arm, kinematics: Kinematics, planner_id: str = "") -> PlanRequest:
    """As a client asks it."""
    names = arm.joint_names
    return PlanRequest(
        goal=tool_pose(arm, kinematics, problem.goal)
        if problem.is_pose
        else JointGoal(name=names, position=problem.goal),
        start=JointState(name=names, position=problem.start),
        allowed_time=ALLOWED,
        motion=FreeMotion(planner_id=planner_id),
    )


def tool_pose(arm: Arm, kinematics: Kinematics, posture: tuple[float, ...]) -> PoseGoal:
    """Where the tool is in that posture, and how it is turned, for arms that can choose it."""
    pose = kinematics.link_poses(posture)[arm.tool_frame]
    return PoseGoal(position=pose.translation, orientation=pose.rotation if len(arm.joints) >= 6 else ())


def way_length(rows: Array, speeds: Array) -> float:
    """[s at full speed] of the polyline `rows` (m, n)."""
    return float(np.linalg.norm(np.diff(rows, axis=0) / speeds, axis=1).sum())
