"""Loads the fixed random problems that `problem_making` has made, and turns them into plan requests.

Every problem can be solved: a free path from its start to its goal is known, and the length of the shortest known one.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JointGoal, PlanRequest, PoseGoal

Array = NDArray[np.float64]

FILE = Path(__file__).parent / "problem_sets.json"
COUNT = 200  # a scene and arm
ALLOWED = 1.0  # [s]


class PlanningProblem(msgspec.Struct, frozen=True, array_like=True):
    """From rest to rest; joint values [rad] or [m] in the arm's order."""

    start: tuple[float, ...]
    goal: tuple[float, ...]  # joint values; with `is_pose` the tool's pose there is asked for
    is_pose: bool
    length: float  # [s at full speed] of the shortest known path to any configuration of the goal
    found_by: str  # planner id, or "straight"


class ProblemSet(msgspec.Struct, frozen=True):
    """The problems of one arm in one scene."""

    arm: str
    scene: str
    drawn: int  # pairs of free configurations, until COUNT had a known path
    problems: tuple[PlanningProblem, ...]


@cache
def problem_sets() -> tuple[ProblemSet, ...]:
    """All sets; read from the file on the first call."""
    return msgspec.json.decode(FILE.read_bytes(), type=tuple[ProblemSet, ...])


def problem_set(arm: str, scene: str) -> ProblemSet:
    """The problems of `arm` in `scene`; raises LookupError if there are none."""
    for each in problem_sets():
        if (each.arm, each.scene) == (arm, scene):
            return each
    raise LookupError(
        f"there are no problems of {arm} in {scene}: python -m gemelo.tools.bench.problems.problem_making"
    )


def text_of(sets: tuple[ProblemSet, ...]) -> str:
    """The file's JSON, one problem on each line."""
    return "[\n" + ",\n".join(map(_text, sets)) + "\n]\n"


def _text(each: ProblemSet) -> str:
    head = msgspec.json.encode(msgspec.structs.replace(each, problems=())).decode().removesuffix("[]}")
    return head + "[\n" + ",\n".join(msgspec.json.encode(problem).decode() for problem in each.problems) + "]}"


def request_of(
    problem: PlanningProblem,
    arm: ArmDescription,
    kinematics: Kinematics,
    planner_id: str = "",
    allowed: float = ALLOWED,
) -> PlanRequest:
    """The request that a client sends for `problem`, with `allowed` [s] for it."""
    names = arm.joint_names
    return PlanRequest(
        goal=tool_pose(arm, kinematics, problem.goal)
        if problem.is_pose
        else JointGoal(name=names, position=problem.goal),
        start=JointState(name=names, position=problem.start),
        allowed_time=allowed,
        motion=FreeMotion(planner_id=planner_id),
    )


def tool_pose(arm: ArmDescription, kinematics: Kinematics, positions: tuple[float, ...]) -> PoseGoal:
    """The tool's position [m] in the base frame at the joint values (n,) [rad] or [m], with its orientation if the arm
    can choose it (six joints)."""
    pose = kinematics.link_poses(positions)[arm.tool_frame]
    return PoseGoal(position=pose.translation, orientation=pose.rotation if len(arm.joints) >= 6 else ())


def path_length(rows: Array, speeds: Array) -> float:
    """Length [s at full speed] of the polyline `rows` (m, n); `speeds` (n,) are the joints' velocity limits."""
    return float(np.linalg.norm(np.diff(rows, axis=0) / speeds, axis=1).sum())
