"""A worker: plans what comes on its standard input, answers on its standard output, ends with whoever started it."""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.process.priority import lower_priority
from gemelo.schemas.planning import PlanPhase, PlanResponse, Timing
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.collision.sphere_check import cancel_flag
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.request.deadline import Stopwatch
from gemelo.services.planner.request.refusals import failed
from gemelo.services.planner.timing.profile import NoProfile
from gemelo.services.planner.timing.toppra_speeds import load_toppra
from gemelo.services.planner.workers.jobs import (
    ORDERS,
    CancelPlan,
    Job,
    PhaseQuestion,
    PhaseReport,
    Planned,
    Ready,
    Report,
    SceneIsSet,
    SetScene,
    receive,
    send,
)


class RunningJob:
    """A job, and what is said about it while it is done."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.cancel = cancel_flag()
        self.watch = Stopwatch(time.monotonic)

    @property
    def phase(self) -> PlanPhase:
        return PlanPhase(self.watch.newest or PlanPhase.WAITING)


class Answers:
    """The way back, for two threads."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def put(self, report: Report) -> None:
        with self._lock:
            send(self._pipe, report)


def main() -> None:
    """`python -m gemelo.services.planner.workers.worker ROBOT_FOLDER PROJECT_FOLDER`."""
    lower_priority()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the planner, which closes this one's input
    answers = Answers(os.fdopen(os.dup(1), "wb"))
    os.dup2(2, 1)  # what a library prints is no answer
    folder, project = Path(sys.argv[1]), Path(sys.argv[2])
    jobs: SimpleQueue[RunningJob | SetScene] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, jobs, answers), daemon=True).start()
    logging.basicConfig(format="planner worker: %(message)s", level=logging.INFO)
    planner = Planner(load_arm(folder))
    planner.prepare()
    gc.freeze()  # else a collection looks through all that was loaded, 20 ms in the middle of a plan
    answers.put(Ready())
    while True:
        match jobs.get():
            case SetScene(scene):
                planner.set_world(World(planner.arm, planner.kinematics, scene, (project, folder)))
                planner.prepare()
                answers.put(SceneIsSet())
            case RunningJob() as running:
                if running.job.request.timing is Timing.TIME_OPTIMAL:
                    with suppress(NoProfile):  # which the plan itself will say
                        load_toppra()  # seconds, the first time, which are not the plan's
                answers.put(Planned(run_plan(planner, running)))


def run_plan(planner: Planner, running: RunningJob) -> PlanResponse:
    """The plan; a defect is a refusal, and its traceback goes to the log; the process goes on."""
    job = running.job
    try:
        return planner.plan(job.request, job.present, job.age, time.monotonic, running.cancel, running.watch)
    except Exception as error:
        with suppress(OSError):  # a disk that is full takes no words
            traceback.print_exc()
        would_do = remedy("ask_else"), remedy("report_with_log")
        return failed(because("plan.defect", *would_do, kind=type(error).__name__, detail=str(error)))


def _read(pipe: IO[bytes], jobs: SimpleQueue[RunningJob | SetScene], answers: Answers) -> None:
    """Ends the process at the end of its input, whatever it is planning."""
    running: RunningJob | None = None
    try:
        while True:
            match receive(pipe, ORDERS):
                case SetScene() as scene_order:
                    jobs.put(scene_order)
                case Job() as job:
                    running = RunningJob(job)
                    jobs.put(running)
                case CancelPlan() if running is not None:
                    running.cancel.set()
                case PhaseQuestion() if running is not None:
                    answers.put(PhaseReport(running.phase))
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
