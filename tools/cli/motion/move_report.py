"""The report of one move: printed as a line or, with --json, as an object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowJointTrajectoryResult, JointTrajectory
from gemelo.schemas.planning import PlanResponse
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.units import show

if TYPE_CHECKING:
    from gemelo import Plan
    from gemelo.libraries.arm.model.description import ArmDescription


class MoveReport(msgspec.Struct, frozen=True, kw_only=True):
    """The outcome of one move."""

    robot: str
    status: str = "PLANNED"
    succeeded: bool = True
    interrupted: bool = False
    reason: str = ""
    planned_s: float
    duration_s: float
    took_s: float = 0.0
    final_error_m: float | None = None  # of the tool, if it has arrived
    final_error_steps: dict[str, float] = {}
    max_following_error_steps: dict[str, float] = {}
    stopped_at: dict[str, float] = {}  # [rad] or [m]
    fraction: float = 1.0  # of a line, of which less will do
    stopped_by: str = ""  # why it is no more
    verified: bool = True  # false: all was sent, and what the device executed is not known
    why: Reason | None = None  # `reason` as data
    stopped_why: Reason | None = None  # `stopped_by` as data

    @property
    def exit_code(self) -> ExitCode:
        """OK, CANCELLED by Ctrl-C, or FAILED."""
        if self.succeeded:
            return ExitCode.OK
        return ExitCode.CANCELLED if self.interrupted and self.status == "CANCELED" else ExitCode.FAILED

    def as_json(self) -> str:
        """The report as one JSON object, in SI units."""
        return msgspec.json.encode(self).decode()


class PlanReport(MoveReport, frozen=True, kw_only=True):
    """A plan that was not executed: also the file of `gemelo move --execute`."""

    target: dict[str, object] = {}  # the arguments of `gemelo.Plan`, which can load the file too
    response: PlanResponse


def report_of(
    arm: ArmDescription,
    plan: Plan,
    status: GoalStatusCode,
    result: FollowJointTrajectoryResult,
    stopped_at: dict[str, float],
) -> MoveReport:
    """The report of a motion that has ended, from the steps that the device executed; `stopped_at` is [rad] or [m]."""
    errors = dict(zip(result.joint_names, result.final_error, strict=False))
    succeeded = status is GoalStatusCode.SUCCEEDED
    return MoveReport(
        robot=arm.name,
        status=status.name,
        succeeded=succeeded,
        reason=result.error_string,
        planned_s=plan.planning_time,
        duration_s=plan.duration,
        took_s=result.duration,
        final_error_m=tool_error(arm, plan.trajectory, errors) if succeeded and result.verified else None,
        final_error_steps=errors,
        max_following_error_steps=dict(zip(result.joint_names, result.max_following_error, strict=False)),
        stopped_at=stopped_at,
        verified=result.verified,
        why=result.why,
    )


def summary(report: MoveReport, arm: ArmDescription, plan_only: bool = False) -> str:
    """The report as one line for a person."""
    return sentence(_summary(report, arm, plan_only))


def _summary(report: MoveReport, arm: ArmDescription, plan_only: bool) -> Reason:
    planned = because("move.planned", time=1e3 * report.planned_s)
    if report.stopped_by:
        by = report.stopped_why or plain(report.stopped_by)
        planned = because("move.planned.part", planned, by, fraction=report.fraction)
    if plan_only:
        return because("move.plan_only", planned, duration=report.duration_s)
    where = ", ".join(f"{name} {show(position, arm.joint(name).unit)}" for name, position in report.stopped_at.items())
    took = report.took_s
    if report.status == "CANCELED":
        return because("move.cancelled", took=took, where=where) if where else because("move.cancelled.lost", took=took)
    why = report.why or (plain(report.reason) if report.reason else because("move.unexplained"))
    if not report.succeeded:
        ended = because("move.ended", why, status=report.status, took=took)
        return because("move.ended.at", ended, where=where) if where else ended
    if not report.verified:
        return because("move.unverified", planned, why, took=took)
    steps = ", ".join(f"{name} {error:+z.2f}" for name, error in report.final_error_steps.items())
    if report.final_error_m is None:
        return because("move.done.unknown", planned, took=took, steps=steps)
    return because("move.done", planned, took=took, error=1e3 * report.final_error_m, steps=steps)


def tool_error(arm: ArmDescription, trajectory: JointTrajectory, errors: Mapping[str, float]) -> float:
    """The tool's distance from the end of the trajectory [m], from the joints' final `errors` [steps].

    Forward kinematics of both: the goal, and the goal minus the error.
    """
    from gemelo.libraries.arm.kinematics.chain import link_transforms  # slow to load: numpy

    goals = dict(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=True))
    reached = {
        joint.name: goals[joint.name] - errors.get(joint.name, 0.0) / joint.steps.per_unit
        for joint in arm.joints
        if joint.name in goals
    }
    wanted_at, reached_at = (link_transforms(arm.model, each)[arm.tool_frame][0] for each in (goals, reached))
    return math.dist(wanted_at, reached_at)
