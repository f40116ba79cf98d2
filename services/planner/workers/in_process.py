"""Plans in the planner's own process, for virtual time: each takes the same time, so that the same seed gives the same.

A plan is made when it is asked for, and answered when its time is over; a cancel comes between the two as anywhere.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial

from gemelo.libraries.runtime.clock import Clock
from gemelo.schemas.planning import PlanCancelResult, PlanCode, PlanProgress, PlanRequest, PlanResponse, Timing
from gemelo.services.planner.collision.sphere_check import counted_time
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.request.deadline import Stopwatch, endless
from gemelo.services.planner.request.refusals import failed
from gemelo.services.planner.timing.profile import NoProfile
from gemelo.services.planner.timing.toppra_speeds import load_toppra
from gemelo.services.planner.workers.jobs import Job
from gemelo.services.planner.workers.pending_plan import Answer, OnInputs, PendingPlan, PendingPlans
from gemelo.services.planner.workers.process import nothing
from gemelo.services.planner.workers.workers import (
    AGAIN,
    CHANGING,
    Present,
    Scene,
    for_process,
    inputs_of,
    longest,
)

# Measured: the time of a long native search between two questions whether its time is over, and how many times as long
# it is in Python, where a question stands before whole checks.
PER_QUESTION, OF_PYTHON = 2e-5, 5  # [s] of the allowed time, and questions
COST = 0.01  # [s] of virtual time; chosen: about what a plan takes in a process of its own


class PlansInProcess:
    """As `Workers`; everything here runs in the thread of logic."""

    are_ready = True

    def __init__(self, clock: Clock, planner: Planner, present: Present, scene: Scene) -> None:
        self._clock, self._planner, self._present, self._scene = clock, planner, present, scene
        self._prepared: World | None = None
        self._pending_plans = PendingPlans(clock)
        self._prepare()

    def plan(self, request: PlanRequest, answer: Answer, on_inputs: OnInputs = nothing) -> None:
        """`answer` is called with the response when the plan's virtual time is over."""
        pending_plan = self._pending_plans.add(request, answer, on_inputs)
        if pending_plan is not None:  # no process takes it up: a cancel ends it at once
            self._make(pending_plan, AGAIN)

    def cancel(self, request_id: str) -> PlanCancelResult:
        """Ends a plan whose time is not over."""
        return self._pending_plans.cancel(request_id)

    def progress(self, now: int) -> list[PlanProgress]:
        """Of every plan that is no short one; `now` [ns] UNIX."""
        return self._pending_plans.progress(now)

    def close(self) -> None:
        """There is nothing to end."""

    def _make(self, pending_plan: PendingPlan, tries: int) -> None:
        """Makes it in the scene as it is now, and once more where that has changed when its time is over."""
        scene, (present, age) = self._scene(), self._present()
        job = Job(request=for_process(pending_plan.request), present=present, age=age)
        response = self._planned(job)
        took = longest(pending_plan.request) if response.code is PlanCode.TIMED_OUT else COST

        def answer() -> None:
            if response.code is not PlanCode.SUCCESS or self._scene() is scene:
                pending_plan.on_inputs(inputs_of(job, scene, took))
                pending_plan.end(response)
            elif tries > 1:
                self._make(pending_plan, tries - 1)
            else:
                pending_plan.end(failed(CHANGING))

        self._clock.later(took, answer)

    def _planned(self, job: Job) -> PlanResponse:
        """Its allowed time is counted in questions, so that it finds the same on every machine, whatever else runs."""
        self._prepare()
        if job.request.timing is Timing.TIME_OPTIMAL:
            with suppress(NoProfile):  # which the plan itself will say
                load_toppra()  # seconds, the first time, which are not the plan's
        counted = counted_time(PER_QUESTION)
        clock = partial(counted.time, OF_PYTHON)
        return self._planner.plan(job.request, job.present, job.age, clock, counted, Stopwatch(endless))

    def _prepare(self) -> None:
        """What a plan would otherwise do first."""
        world = self._planner.checker.newest
        if world is not self._prepared:
            self._prepared = world
            self._planner.prepare()
