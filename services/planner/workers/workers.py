"""Plans in processes of their own: several at a time, each stopped when its time is over or it is cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue

from msgspec.structs import replace

from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    PlanCancelResult,
    PlanCode,
    PlanInputs,
    PlanProgress,
    PlanRequest,
    PlanResponse,
)
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.core import LONGEST
from gemelo.services.planner.request.refusals import failed, refusal_of
from gemelo.services.planner.workers.jobs import Job
from gemelo.services.planner.workers.pending_plan import Answer, Cancelled, OnInputs, PendingPlan, PendingPlans
from gemelo.services.planner.workers.process import Late, PlannerProcess, WorkerDied, nothing

MOST = 2  # processes; chosen: as many as small computers have cores for it
LATEST = 0.08  # of the allowed time, beyond it, when the plan is answered whatever its process does; chosen: little
LEAST_LATE = 0.008  # [s] of that at least; chosen: shorter plans than 0.1 s may be later
WAY, MOST_WAY = (
    0.01,
    0.1,
)  # [s] to the process and back; of short times that share; chosen: a busy small computer
GRACE = 1.0  # [s] after that answer in which a process ends its plan by itself; chosen: a new process costs more
PATIENCE = 5.0  # [s] for a thread to see that its process is gone; chosen: only a broken machine needs more
CHANGING = because("plan.scene.changing", remedy("plan_when_still"))
AGAIN = 3  # plans of one request, where the scene changes or the process dies meanwhile; chosen: then a person is told
MOST_DEATHS = 1  # after which a plan is made again; chosen: one that ends two processes may end every one
LOOK = 0.2  # [s] between two looks whether the scene has changed; chosen: an idle thread that costs nothing

Present = Callable[[], tuple[JointState | None, float]]
Scene = Callable[[], PlanningScene]


class Workers:
    """Hands requests to processes; `present` and `scene` are asked when a plan begins, from other threads."""

    def __init__(self, folder: Path, project: Path, present: Present, scene: Scene) -> None:
        self._folder, self._project = folder, project
        self._present, self._scene = present, scene
        self._tasks: SimpleQueue[PendingPlan | None] = SimpleQueue()
        self._processes: list[PlannerProcess] = []
        self._threads: list[threading.Thread] = []
        self._pending_plans = PendingPlans()
        self._lock = threading.Lock()
        str(CHANGING)  # reads the catalogue of reasons now: when a process dies there may be no descriptor left for it
        self._start_one()

    @property
    def are_ready(self) -> bool:
        """True while a process lives that plans: then a plan need not wait for one to start."""
        return any(process.is_ready for process in self._processes)

    def plan(self, request: PlanRequest, answer: Answer, on_inputs: OnInputs = nothing) -> None:
        """`answer` is called with the response, mostly in another thread; a second process starts for a second plan.

        `on_inputs` is told before, in the same thread, what a process has planned from: the last call counts.
        """
        pending_plan = self._pending_plans.add(request, answer, on_inputs)
        if pending_plan is None:
            return
        with self._lock:
            self._tasks.put(pending_plan)
            if len(self._pending_plans) > len(self._processes) < MOST:
                with suppress(OSError):  # no memory, or no descriptor: the plan waits for the process that there is
                    self._start_one()

    def cancel(self, request_id: str) -> PlanCancelResult:
        """Ends a plan that waits now, one that is being made soon."""
        return self._pending_plans.cancel(request_id)

    def progress(self, now: int) -> list[PlanProgress]:
        """Of every plan that is no short one; `now` [ns] UNIX."""
        return self._pending_plans.progress(now)

    def close(self) -> None:
        """Ends every process, in the midst of a plan too."""
        for process in self._processes:
            self._tasks.put(None)
            process.end()
        for thread in self._threads:
            thread.join(PATIENCE)

    def _start_one(self) -> None:
        process = PlannerProcess(self._folder, self._project)
        thread = threading.Thread(target=self._work, args=(process,), daemon=True, name="planner worker")
        self._processes.append(process)
        self._threads.append(thread)
        thread.start()

    def _work(self, process: PlannerProcess) -> None:
        prepared: PlanningScene | None = None
        while True:
            scene = self._scene()
            if scene is not prepared or not process.is_ready:
                self._prepare(process, scene)
                prepared = scene
            try:
                pending_plan = self._tasks.get(timeout=LOOK)
            except Empty:
                continue
            if pending_plan is None:
                break
            if pending_plan.begin():
                is_late = self._answer(process, pending_plan)
                if is_late:
                    process.settle(GRACE)
                prepared = None
        process.close()

    def _prepare(self, process: PlannerProcess, scene: PlanningScene) -> None:
        """Waits for it and its scene, before a plan would have to; what keeps it from that the next plan says."""
        with suppress(TimeoutError, WorkerDied):
            process.be_ready()
            process.set_scene(scene)

    def _answer(self, process: PlannerProcess, pending_plan: PendingPlan) -> bool:
        """True if the process is still at a plan that has been answered because its time was over."""
        try:
            pending_plan.end(self._planned(process, pending_plan))
        except Late:
            pending_plan.end(self._late(pending_plan))
            return True
        return False

    def _planned(self, process: PlannerProcess, pending_plan: PendingPlan) -> PlanResponse | None:
        """A plan in the scene as it is at the plan's end; None for one that was cancelled."""
        request, deaths = pending_plan.request, 0
        for _ in range(AGAIN):
            began: float | None = None  # [s] monotonic
            try:
                process.be_ready(pending_plan.require_wanted)
                scene = self._scene()
                process.set_scene(scene, pending_plan.require_wanted)
                present, age = self._present()
                job = Job(request=for_process(request), present=present, age=age)
                began = time.monotonic()
                response = process.plan(pending_plan, job, longest(request))
                pending_plan.on_inputs(inputs_of(job, scene, time.monotonic() - began))
            except Cancelled:
                return None
            except TimeoutError:
                return self._late(pending_plan)
            except WorkerDied as error:
                deaths += 1
                request = _with_what_is_left(request, began)
                if deaths > MOST_DEATHS or request.allowed_time <= 0.0:
                    would_do = remedy("plan_again_new_processes"), remedy("see_system_log")
                    return failed(because("plan.worker.died", error.reason, *would_do, count=deaths))
                continue
            if response.code is not PlanCode.SUCCESS or self._scene() is scene:
                return response
        return failed(CHANGING)

    def _late(self, pending_plan: PendingPlan) -> PlanResponse:
        """It was stopped, for it did not stop by itself."""
        allowed = pending_plan.request.allowed_time
        elapsed, would_do = pending_plan.elapsed, (remedy("more_time"), remedy("faster"), remedy("nearer_goal"))
        why = because("plan.time.stopped", *would_do, time=elapsed, phase=pending_plan.phase, allowed=allowed)
        refusal = refusal_of(why, "allowed time", "allowed_time", elapsed, allowed)
        scene = self._scene()
        return PlanResponse(
            code=PlanCode.TIMED_OUT, refusal=refusal, scene_version=scene.version, scene_epoch=scene.epoch
        )


def inputs_of(job: Job, scene: PlanningScene, elapsed: float) -> PlanInputs:
    """What `job` was planned from, in `elapsed` [s]."""
    return PlanInputs(
        planned=True,
        present=job.present,
        age=job.age if job.present is not None else 0.0,  # infinite before the first state
        scene_version=scene.version,
        scene_epoch=scene.epoch,
        jaws=tuple(each for each in scene.objects if each.name in JAWS),
        elapsed=elapsed,
    )


def for_process(request: PlanRequest) -> PlanRequest:
    """With the time that its process has of its own: what it says of a plan that is late is to leave in time."""
    return replace(request, allowed_time=request.allowed_time - min(WAY, MOST_WAY * max(0.0, request.allowed_time)))


def longest(request: PlanRequest) -> float:
    """[s] from the beginning of a plan to its answer."""
    allowed = min(max(0.0, request.allowed_time), LONGEST)
    return allowed + max(LATEST * allowed, LEAST_LATE)


def _with_what_is_left(request: PlanRequest, began: float | None) -> PlanRequest:
    """The request with the time that is left of its own; the time that a process takes to start is not its own."""
    spent = 0.0 if began is None else time.monotonic() - began
    return replace(request, allowed_time=request.allowed_time - spent)
