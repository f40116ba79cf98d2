"""Plans from their requests to their answers, and what can be said of them meanwhile."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.planning import (
    PlanCancelResult,
    PlanCode,
    PlanInputs,
    PlanPhase,
    PlanProgress,
    PlanRequest,
    PlanResponse,
    Refusal,
)
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.request.refusals import refusal_of

# Tuning constants: chosen, where a line does not say measured or standard.
SHORT = 0.1  # [s] until which nothing is said of a plan; chosen: a person does not see less
LONGEST_ID = 100  # characters; chosen: ours have 32, and nobody's fills the memory
MOST_PLANS = 64  # that wait or are being made; chosen: more than people ask for, little memory

Answer = Callable[[PlanResponse], None]
OnInputs = Callable[[PlanInputs], object]  # what it was planned from


class Cancelled(Exception):
    """The plan is wanted no more."""


class PendingPlan:
    """Answers exactly once; everything here may be called from any thread."""

    def __init__(
        self, request_id: str, request: PlanRequest, answer: Answer, on_inputs: OnInputs, clock: Clock = SYSTEM
    ) -> None:
        self._clock = clock
        self.request_id, self.request, self.on_inputs = request_id, request, on_inputs
        self.phase = PlanPhase.WAITING
        self._answer = answer
        self._asked = self._clock.monotonic()
        self._lock = threading.Lock()
        self._has_begun = self._is_over = self._is_cancelled = False

    @property
    def elapsed(self) -> float:
        """[s] since it was asked for."""
        return self._clock.monotonic() - self._asked

    def progress(self, now: int) -> PlanProgress:
        """`now` [ns] UNIX."""
        return PlanProgress(
            stamp=now,
            request_id=self.request_id,
            phase=self.phase,
            elapsed=self.elapsed,
            allowed=self.request.allowed_time,
        )

    def at(self, phase: PlanPhase) -> None:
        """What it is at now."""
        self.phase = phase

    def begin(self) -> bool:
        """A process takes it up, unless it has been cancelled."""
        with self._lock:
            self._has_begun = not self._is_over
            return self._has_begun

    def cancel(self) -> bool:
        """Ends it at once, or lets its process end it; False where it is over already."""
        with self._lock:
            if self._is_over:
                return False
            self._is_cancelled = True
            is_waiting = not self._has_begun
        if is_waiting:
            self.end(None)
        return True

    def require_wanted(self) -> None:
        """Raises `Cancelled`."""
        if self._is_cancelled:
            raise Cancelled

    def end(self, response: PlanResponse | None) -> None:
        """The answer; of a plan that has been cancelled it says that, whatever `response` says."""
        with self._lock:
            was_over, self._is_over = self._is_over, True
        if not was_over:
            self._answer(self._preempted() if response is None or self._is_cancelled else response)

    def _preempted(self) -> PlanResponse:
        why = because("plan.cancelled", remedy("plan_again"), time=self.elapsed, phase=self.phase)
        return PlanResponse(code=PlanCode.PREEMPTED, refusal=refusal_of(why, "cancelled", self.request_id))


class PendingPlans:
    """The plans of one maker, by id; everything here may be called from any thread."""

    def __init__(self, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self._plans: dict[str, PendingPlan] = {}
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._plans)

    def add(self, request: PlanRequest, answer: Answer, on_inputs: OnInputs) -> PendingPlan | None:
        """One more, whose `answer` is called once when it ends; None where it is refused, and answered."""
        with self._lock:
            request_id = request.request_id or f"planner-{next(self._numbers)}"
            objection = self._objection_to(request_id)
            if objection is None:

                def end(response: PlanResponse) -> None:
                    with self._lock:
                        del self._plans[request_id]
                    answer(response)

                pending_plan = self._plans[request_id] = PendingPlan(request_id, request, end, on_inputs, self._clock)
                return pending_plan
        answer(PlanResponse(code=PlanCode.INVALID_GOAL_CONSTRAINTS, refusal=objection))
        return None

    def cancel(self, request_id: str) -> PlanCancelResult:
        """Cancels the plan of that id, if there is one; the answer to who asked for it."""
        if not request_id:
            return _no_such(because("plan.cancel.empty", remedy("give_request_id")))
        with self._lock:
            pending_plan = self._plans.get(request_id)
        if pending_plan is None or not pending_plan.cancel():
            return _no_such(because("plan.cancel.none", id=request_id))
        why = because("plan.cancel.done", id=request_id, time=pending_plan.elapsed, phase=pending_plan.phase)
        return PlanCancelResult(found=True, message=str(why), why=why)

    def progress(self, now: int) -> list[PlanProgress]:
        """Of every plan that is no short one; `now` [ns] UNIX."""
        with self._lock:
            plans = list(self._plans.values())
        return [each.progress(now) for each in plans if each.elapsed > SHORT]

    def _objection_to(self, request_id: str) -> Refusal | None:
        if len(self._plans) >= MOST_PLANS:
            why = because("plan.requests.too_many", remedy("plan_when_fewer"), limit=MOST_PLANS)
            return refusal_of(why, "request", "plan")
        would_do = remedy("other_request_id"), remedy("leave_empty", name="request_id")
        if len(request_id) > LONGEST_ID:
            why = because("plan.request_id.long", *would_do, count=len(request_id), limit=LONGEST_ID)
            return refusal_of(why, "request", "request_id")
        if request_id in self._plans:
            why = because("plan.request_id.taken", *would_do, id=request_id)
            return refusal_of(why, "request", "request_id")
        return None


def _no_such(why: Reason) -> PlanCancelResult:
    return PlanCancelResult(message=str(why), why=why)
