"""Plans in processes of their own: several at a time, each stopped when its time is over, whatever it is doing."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from schemas.joints import JointState
from schemas.planning import PlanCode, PlanRequest, PlanResponse, Refusal, Timing
from schemas.scene import PlanningScene
from services.planner.core import LONGEST
from services.planner.goals.goals import timed_out
from services.planner.workers.jobs import Job, Ready, receive, send

MOST = 2  # processes: as many as small computers have cores for it
GRACE = 1.0  # [s] beyond the allowed time in which a worker ends its plan by itself
START = 60.0  # [s] in which a worker must have started, or have imported toppra for the first time
PATIENCE = 5.0  # [s] for a thread to see that its process is gone
AGAIN = 3  # plans of one request, where the scene changes meanwhile
CHILD = "services.planner.workers.worker"

Present = Callable[[], tuple[JointState | None, float]]
Scene = Callable[[], PlanningScene]
Answer = Callable[[PlanResponse], None]
Task = tuple[PlanRequest, Answer]


class WorkerDied(Exception):
    """The process has ended, or does not answer."""


class Workers:
    """Hands requests to processes; `present` and `scene` are asked when a plan begins, from other threads."""

    def __init__(self, folder: Path, project: Path, present: Present, scene: Scene) -> None:
        self._folder, self._project = folder, project
        self._present, self._scene = present, scene
        self._tasks: SimpleQueue[Task | None] = SimpleQueue()
        self._workers: list[_Worker] = []
        self._threads: list[threading.Thread] = []
        self._busy = 0
        self._lock = threading.Lock()
        self._start_one()

    def plan(self, request: PlanRequest, answer: Answer) -> None:
        """`answer` is called with the response, in another thread; a second process is started for a second plan."""
        with self._lock:
            self._busy += 1
            if self._busy > len(self._workers) < MOST:
                self._start_one()
        self._tasks.put((request, answer))

    def close(self) -> None:
        """Ends every process, in the midst of a plan too."""
        for worker in self._workers:
            self._tasks.put(None)
            worker.end()
        for thread in self._threads:
            thread.join(PATIENCE)

    def _start_one(self) -> None:
        worker = _Worker(self._folder, self._project)
        thread = threading.Thread(target=self._work, args=(worker,), daemon=True, name="planner worker")
        self._workers.append(worker)
        self._threads.append(thread)
        thread.start()

    def _work(self, worker: _Worker) -> None:
        while (task := self._tasks.get()) is not None:
            request, answer = task
            try:
                response = self._planned(worker, request)
            finally:
                with self._lock:
                    self._busy -= 1
            answer(response)
        worker.close()

    def _planned(self, worker: _Worker, request: PlanRequest) -> PlanResponse:
        """A plan in the scene as it is at the plan's end."""
        for _ in range(AGAIN):
            try:
                worker.be_ready()
                scene = self._scene()
                present, age = self._present()
                response = worker.plan(Job(request=request, present=present, age=age), scene)
            except TimeoutError:
                no_plan = timed_out()
                return PlanResponse(code=no_plan.code, refusal=no_plan.refusal, scene_version=self._scene().version)
            except WorkerDied as error:
                return _failed(f"the planner's worker process has ended ({error})", "plan again: a new one is started")
            if response.code is not PlanCode.SUCCESS or self._scene() is scene:
                return response
        return _failed("the scene changes faster than a plan can be made in it", "plan again when it stays as it is")


class _Worker:
    """One process, and another after it has ended or was too late."""

    def __init__(self, folder: Path, project: Path) -> None:
        self._folders = (str(folder), str(project))
        self._told: PlanningScene | None = None
        self._is_ready = self._has_toppra = self._is_over = False
        self._process = self._started()

    def plan(self, job: Job, scene: PlanningScene) -> PlanResponse:
        """Raises `TimeoutError` after the allowed time and `GRACE`, and `WorkerDied`; the process is gone then."""
        with self._replaced_where_it_fails():
            send(_pipe(self._process.stdin), job if self._told is scene else _with_scene(job, scene))
            self._told = scene
            needs_toppra = job.request.timing is Timing.TIME_OPTIMAL
            importing = START if needs_toppra and not self._has_toppra else 0.0
            self._wait(min(max(0.0, job.request.allowed_time), LONGEST) + GRACE + importing)
            self._has_toppra = self._has_toppra or needs_toppra
            return receive(_pipe(self._process.stdout), PlanResponse)

    def be_ready(self) -> None:
        """Waits until the process plans; raises as `plan`."""
        with self._replaced_where_it_fails():
            if not self._is_ready:
                self._wait(START)
                receive(_pipe(self._process.stdout), Ready)
                self._is_ready = True

    def end(self) -> None:
        """At once, and for good."""
        self._is_over = True
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Its pipes."""
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                _pipe(pipe).close()

    def _replace(self) -> int | None:
        """Another process in place of this one, whose exit code is returned."""
        self._process.kill()
        code = self._process.wait()
        self.close()
        if not self._is_over:
            self._process, self._told = self._started(), None
            self._is_ready = self._has_toppra = False
        return code

    def _started(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", CHILD, *self._folders]
        alone = {
            **os.environ,
            "OPENBLAS_NUM_THREADS": "1",
        }  # its matrices are small, and threads cost more than they do
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=self._folders[1], env=alone)

    @contextmanager
    def _replaced_where_it_fails(self) -> Iterator[None]:
        try:
            yield
        except TimeoutError:
            self._replace()
            raise
        except (OSError, EOFError, ValueError) as error:
            raise WorkerDied(f"exit code {self._replace()}") from error

    def _wait(self, seconds: float) -> None:
        if not select.select([_pipe(self._process.stdout)], [], [], seconds)[0]:
            raise TimeoutError(f"no answer within {seconds:g} s")


def _with_scene(job: Job, scene: PlanningScene) -> Job:
    return Job(request=job.request, present=job.present, age=job.age, scene=scene)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None  # both are asked for when the process is started
    return pipe


def _failed(message: str, remedy: str) -> PlanResponse:
    refusal = Refusal(check="planner", subject="worker", message=message, remedy=remedy)
    return PlanResponse(code=PlanCode.FAILURE, refusal=refusal)
