"""One plan from its request to its answer, and what can be said of it meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.planning import PlanCode, PlanInputs, PlanPhase, PlanProgress, PlanRequest, PlanResponse, Refusal

WORDS = {
    PlanPhase.WAITING: "waiting",
    PlanPhase.IK: "looking for configurations of the goal",
    PlanPhase.SEARCH: "searching",
    PlanPhase.SMOOTHING: "smoothing",
    PlanPhase.TIMING: "timing",
    PlanPhase.VERIFICATION: "verifying",
}

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

    @property
    def words(self) -> str:
        """How long it lasts, and what it is at."""
        return f"after {self.elapsed:.2f} s, while {WORDS[self.phase]}"

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
        refusal = Refusal(
            check="cancelled",
            subject=self.request_id,
            message=f"the plan was cancelled {self.words}",
            remedy="plan again, if it is wanted after all",
        )
        return PlanResponse(code=PlanCode.PREEMPTED, refusal=refusal)
