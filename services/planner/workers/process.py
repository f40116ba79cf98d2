"""One worker's process as its planner sees it: a plan in, an answer out in time, another process where it fails."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TypeVar

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.planning import PlanPhase, PlanResponse, Timing
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.workers.jobs import (
    REPORTS,
    CancelPlan,
    Job,
    Order,
    PhaseQuestion,
    PhaseReport,
    Planned,
    Ready,
    SceneIsSet,
    SetScene,
    receive,
    send,
)
from gemelo.services.planner.workers.pending_plan import Cancelled, PendingPlan

START = 60.0  # [s] in which a worker must start, have a scene, or import toppra; chosen: cold small computers are slow
STOPS_WITHIN = 0.2  # [s] from a cancel to the answer of a process that lives on; chosen: else it is ended
TICK = 0.05  # [s] between two looks whether the plan is still wanted; chosen: short beside STOPS_WITHIN
CHILD = "gemelo.services.planner.workers.worker"

R = TypeVar("R", Ready, SceneIsSet, Planned)


def nothing(*_: object) -> None:
    """The callback of a caller that needs none."""


class Late(Exception):
    """The plan was not made in its time; its process is still at it, until `settle`."""


class WorkerDied(ReasonedError):
    """The process has ended; the reason says how."""


class PlannerProcess:
    """For one thread, but `end`."""

    def __init__(self, folder: Path, project: Path) -> None:
        self._folders = (str(folder), str(project))
        self._told: PlanningScene | None = None
        self._is_ready = self._has_toppra = self._is_over = False
        self._process = self._started()

    @property
    def is_ready(self) -> bool:
        """True from the process's first word until it has ended; from any thread."""
        return self._is_ready and self._process.poll() is None

    def be_ready(self, on_tick: Callable[[], None] = nothing) -> None:
        """Waits until it plans; raises as `plan`, and what `on_tick` raises: then it goes on starting."""
        with self._replaced_where_it_fails():
            if self._process.poll() is not None:
                raise EOFError("it has ended while it had nothing to do")
            if not self._is_ready:
                self._hear(Ready, START, on_tick)
                self._is_ready = True

    def set_scene(self, scene: PlanningScene, on_tick: Callable[[], None] = nothing) -> None:
        """Waits until it has the scene; raises as `be_ready`."""
        with self._replaced_where_it_fails():
            if self._told is not scene:
                self._send(SetScene(scene))
                self._hear(SceneIsSet, START, on_tick)
                self._told = scene

    def settle(self, seconds: float) -> None:
        """After `Late`: lets the process end its job within `seconds` [s], or replaces it."""
        with suppress(TimeoutError, WorkerDied), self._replaced_where_it_fails():
            self._send(CancelPlan())
            self._hear(Planned, seconds)

    def plan(self, pending_plan: PendingPlan, job: Job, seconds: float) -> PlanResponse:
        """The worker's response; raises `Late` after `seconds` [s], `Cancelled` or `WorkerDied`. A process that did not
        end its job after a cancel is replaced."""
        with self._replaced_where_it_fails():
            self._send(job)
            needs_toppra = job.request.timing is Timing.TIME_OPTIMAL
            importing = START if needs_toppra and not self._has_toppra else 0.0
            try:
                planned = self._hear(
                    Planned, seconds + importing, lambda: self._look_after(pending_plan), pending_plan.at
                )
            except Cancelled:
                self._send(CancelPlan())
                self._hear(Planned, STOPS_WITHIN)
                raise
            except TimeoutError as error:
                raise Late from error
            self._has_toppra = self._has_toppra or needs_toppra
            return planned.response

    def end(self) -> None:
        """At once, and for good; from any thread."""
        self._is_over = True
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Its pipes."""
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                _pipe(pipe).close()

    def _look_after(self, pending_plan: PendingPlan) -> None:
        pending_plan.require_wanted()
        self._send(PhaseQuestion())

    def _send(self, order: Order) -> None:
        send(_pipe(self._process.stdin), order)

    def _hear(
        self,
        kind: type[R],
        seconds: float,
        on_tick: Callable[[], None] = nothing,
        on_phase: Callable[[PlanPhase], None] = nothing,
    ) -> R:
        """The next report of this kind; raises `TimeoutError`."""
        pipe, end = _pipe(self._process.stdout), time.monotonic() + seconds
        while True:
            left = end - time.monotonic()
            if select.select([pipe], [], [], max(0.0, min(left, TICK)))[0]:
                report = receive(pipe, REPORTS)
                if isinstance(report, PhaseReport):
                    on_phase(report.phase)
                elif isinstance(report, kind):
                    return report
            elif left <= 0.0:
                raise TimeoutError(f"no answer within {seconds:g} s")
            else:
                on_tick()

    def _replace(self) -> Reason:
        """Another process in place of this one; returns how that has ended. Where none can be started (no memory, no
        descriptor), `be_ready` tries again."""
        self._process.kill()
        code = self._process.wait()
        ended = because("plan.worker.exit", code=code)
        self.close()
        self._told, self._is_ready, self._has_toppra = None, False, False
        if not self._is_over:
            try:
                self._process = self._started()
            except OSError as error:
                ended = because("plan.worker.none", code=code, detail=error.strerror or str(error))
        return ended

    def _started(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", CHILD, *self._folders]
        # Its matrices are small, and threads cost more than they do.
        alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        # Without buffers: what lies in one is not seen by `select`.
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=self._folders[1], env=alone, bufsize=0
        )

    @contextmanager
    def _replaced_where_it_fails(self) -> Iterator[None]:
        try:
            yield
        except TimeoutError:
            self._replace()
            raise
        except (OSError, EOFError, ValueError) as error:
            raise WorkerDied(self._replace()) from error


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None  # both are asked for when the process is started
    return pipe
