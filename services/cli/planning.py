"""Requests to the planner: progress is shown while it plans, and Ctrl-C cancels."""

from __future__ import annotations

import uuid
from contextlib import suppress

from msgspec.structs import replace

from schemas.planning import PlanCancel, PlanProgress, PlanRequest, PlanResponse
from schemas.topics import PLAN, PLAN_CANCEL, PLAN_PROGRESS
from services.cli.errors import CommandError, ExitCode
from services.cli.request_text import refusal_text
from services.cli.session import Session
from services.cli.terminal import Interrupt, LiveBlock, two_stage_interrupt
from services.runtime.errors import NoAnswer, Refused

MARGIN = 2.0  # [s] that a planner may take beyond its allowed time before it counts as gone
TO_CANCEL = 0.5  # [s] for its answer to a cancel


def make_plan(session: Session, request: PlanRequest, quiet: bool = False) -> PlanResponse:
    """A verified trajectory; a refusal is raised with its reason and what would do, Ctrl-C as CANCELLED."""
    request = replace(request, request_id=uuid.uuid4().hex)
    with two_stage_interrupt() as interrupt:
        plan = _asked(session, request, interrupt, quiet)
    if interrupt.is_set:
        said = plan.refusal.message if plan.refusal is not None else "cancelled when the plan was just made"
        raise CommandError(f"{said}: nothing moves", ExitCode.CANCELLED)
    if plan.refusal is not None:
        raise CommandError(refusal_text(plan.refusal, request.goal, session.arm))
    if not plan.trajectory.points:
        raise CommandError(f"refused: the planner answered {plan.code.name} without a trajectory")
    return plan


def _asked(session: Session, request: PlanRequest, interrupt: Interrupt, quiet: bool) -> PlanResponse:
    block = LiveBlock(False if quiet else None)

    def show(progress: PlanProgress) -> None:
        if progress.request_id == request.request_id:
            stand = f"{progress.phase}, {progress.elapsed:.1f} of {progress.allowed:g} s"
            block.draw(f"planning: {stand} (Ctrl-C cancels)")

    shown = session.node.subscribe(PLAN_PROGRESS, show)
    try:
        return session.node.call(
            PLAN, request, request.allowed_time + MARGIN, on_tick=lambda: _cancel_once(session, request, interrupt)
        )
    except NoAnswer:
        _cancel(session, request)  # it may be waiting behind the plans of others
        raise
    finally:
        shown.close()
        block.say()


def _cancel_once(session: Session, request: PlanRequest, interrupt: Interrupt) -> None:
    """When Ctrl-C has been pressed for the first time; the second time leaves without waiting."""
    if interrupt.is_set and not interrupt.is_answered:
        interrupt.is_answered = True
        _cancel(session, request)


def _cancel(session: Session, request: PlanRequest) -> None:
    """A planner that cannot be cancelled is waited for."""
    with suppress(NoAnswer, Refused):
        session.node.call(PLAN_CANCEL, PlanCancel(request_id=request.request_id), TO_CANCEL)
