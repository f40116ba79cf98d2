"""A worker: plans what comes on its standard input, answers on its standard output, ends with whoever started it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from schemas.planning import PlanResponse, Refusal, Timing
from services.arm.description import load_arm
from services.planner.core import Planner
from services.planner.scene.world import World
from services.planner.timing.time_optimal import load_toppra
from services.planner.workers.jobs import Job, Ready, receive, send


def main() -> None:
    """`python -m services.planner.workers.worker ROBOT_FOLDER PROJECT_FOLDER`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the planner, which closes this one's input
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    folder, project = Path(sys.argv[1]), Path(sys.argv[2])
    jobs: SimpleQueue[Job] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, jobs), daemon=True).start()
    planner = Planner(load_arm(folder))
    planner.prepare()
    send(answers, Ready())
    while True:
        job = jobs.get()
        if job.scene is not None:
            planner.set_world(World(planner.arm, planner.kinematics, job.scene, (project, folder)))
        if job.request.timing is Timing.TIME_OPTIMAL:
            load_toppra()  # seconds, the first time, which are not the plan's
        send(answers, _planned(planner, job))


def _planned(planner: Planner, job: Job) -> PlanResponse:
    """A defect costs the plan, and its traceback goes to the log; the process goes on."""
    try:
        return planner.plan(job.request, job.present, job.age, time.monotonic)
    except Exception as error:
        traceback.print_exc()
        message = f"a defect of the planner: {type(error).__name__}: {error}"
        remedy = "ask for something else, and report this with what the planner's log says"
        return PlanResponse(refusal=Refusal(check="planner", subject="worker", message=message, remedy=remedy))


def _read(pipe: IO[bytes], jobs: SimpleQueue[Job]) -> None:
    """Ends the process at the end of its input, whatever it is planning."""
    try:
        while True:
            jobs.put(receive(pipe, Job))
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
