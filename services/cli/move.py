"""`gemelo move`: plan, follow, and say how exactly the arm arrived."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from schemas.actions import GoalStatusCode
from schemas.motion import FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from schemas.planning import PlanRequest, PlanResponse
from schemas.topics import FOLLOW_JOINT_TRAJECTORY
from services.cli.exits import CommandError, ExitCode
from services.cli.interrupt import Interrupt, two_stage_interrupt
from services.cli.move_report import MoveReport, summary, tool_error_mm
from services.cli.planning import make_plan
from services.cli.progress import progress
from services.cli.session import Session
from services.cli.units import show
from services.runtime.actions import GoalHandle
from services.runtime.errors import GoalRefused

LONGEST_HOLD = 3600.0  # [s] that a person may hold the arm on its way


def move(session: Session, request: PlanRequest, plan_only: bool, as_json: bool) -> ExitCode:
    """Plans and, unless `plan_only`, executes; prints one line or one JSON object at the end."""
    plan = make_plan(session, request, quiet=as_json)
    if plan_only:
        report = MoveReport(robot=session.arm.name, planned_ms=plan.planning_time * 1e3, duration_s=plan.duration)
    else:
        report = follow(session, plan, quiet=as_json)
    if plan.stopped_by is not None:
        report = replace(report, fraction=plan.fraction, stopped_by=plan.stopped_by.message)
    print(report.as_json() if as_json else summary(report, plan_only))
    return report.exit_code


def follow(session: Session, plan: PlanResponse, quiet: bool = False) -> MoveReport:
    """Executes `plan`; Ctrl-C cancels and waits for where the arm came to rest."""
    client = session.node.action(FOLLOW_JOINT_TRAJECTORY)
    with progress(plan.duration, quiet) as shown, two_stage_interrupt() as interrupt:

        def on_feedback(feedback: FollowJointTrajectoryFeedback) -> None:
            shown(feedback.elapsed, feedback.duration)

        goal = FollowJointTrajectoryGoal(
            trajectory=plan.trajectory, scene_version=plan.scene_version, scene_epoch=plan.scene_epoch
        )
        try:
            handle = client.send(goal, on_feedback=on_feedback)
        except GoalRefused as error:
            raise CommandError(f"refused by {FOLLOW_JOINT_TRAJECTORY.server}: {error}") from error
        outcome = handle.wait(plan.duration + LONGEST_HOLD, on_tick=lambda: cancel_once(handle, interrupt, quiet))
    return report_of(session, plan, outcome.status, outcome.result, interrupt.is_set)


def cancel_once(handle: GoalHandle[Any, Any], interrupt: Interrupt, quiet: bool) -> None:
    """Cancels when Ctrl-C has been pressed for the first time."""
    if interrupt.is_set and not interrupt.is_answered:
        interrupt.is_answered = True
        handle.cancel()
        if not quiet:
            print("cancelling: the arm slows down on its path (Ctrl-C again leaves without waiting)", flush=True)


def report_of(
    session: Session,
    plan: PlanResponse,
    status: GoalStatusCode,
    result: FollowJointTrajectoryResult | None,
    interrupted: bool,
) -> MoveReport:
    """What became of the goal, from the steps that were read back."""
    arm = session.arm
    result = result or FollowJointTrajectoryResult()
    errors = dict(zip(result.joint_names, result.final_error, strict=False))
    stopped_at = {
        name: show(arm.joint(name).steps.to_position(steps), arm.joint(name).unit)
        for name, steps in zip(result.joint_names, result.executed_steps, strict=False)
    }
    succeeded = status is GoalStatusCode.SUCCEEDED
    return MoveReport(
        robot=arm.name,
        status=status.name,
        succeeded=succeeded,
        interrupted=interrupted,
        reason=result.error_string,
        planned_ms=plan.planning_time * 1e3,
        duration_s=plan.duration,
        took_s=result.duration,
        final_error_mm=tool_error_mm(arm, plan.trajectory, errors) if succeeded else None,
        final_error_steps=errors,
        max_following_error_steps=dict(zip(result.joint_names, result.max_following_error, strict=False)),
        stopped_at=stopped_at,
    )
