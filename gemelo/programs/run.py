"""A program that runs: started, paused, stepped, held and stopped by a person, and never by itself."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial

from gemelo.api.arm import Arm
from gemelo.api.errors import Error, Refused
from gemelo.programs.execution import Controls, Execution
from gemelo.programs.meaning import require_right
from gemelo.programs.points import Point
from gemelo.programs.program import Program
from gemelo.programs.sequence import Leg, called_programs, legs_of
from gemelo.programs.steps import StepPath, path_text, words_of
from gemelo.schemas.reasons import Reason, because


class RunStatus(StrEnum):
    """How a run stands; STOPPED, FAILED and DONE are its end."""

    READY = "ready"  # not started yet
    RUNNING = "running"
    PAUSED = "paused"  # until somebody says `resume` or `step`
    STOPPED = "stopped"  # by `stop`
    FAILED = "failed"  # `why` says it
    DONE = "done"

    @property
    def is_over(self) -> bool:
        return self in (RunStatus.STOPPED, RunStatus.FAILED, RunStatus.DONE)


@dataclass(frozen=True)
class RunState:
    """How a run stands."""

    program: str
    status: RunStatus = RunStatus.READY
    steps: tuple[StepPath, ...] = ()  # that are carried out now, several where they are blended; or were the last
    rounds: tuple[int, ...] = ()  # from 0, of every repeat around the first of them
    text: str = ""  # what they do, for a person
    done: int = 0  # steps that have been carried out, each as often as it was
    planned: int = 0  # legs that have been planned so far
    started_at: float = 0.0  # [s] UNIX; 0 before the start
    why: Reason | None = None  # it has paused, stopped or failed
    failure: Error | None = field(default=None, compare=False)  # that it has failed by

    @property
    def message(self) -> str:
        """Why it has paused, stopped or failed, in one sentence; empty otherwise."""
        return str(self.why or "")

    @property
    def step(self) -> StepPath:
        """The first of the steps that are carried out."""
        return self.steps[0] if self.steps else ()


class ProgramRun:
    """One program on one arm. Every method may be called from any thread but those that handle messages.

    While the arm is on one leg the next is planned and handed over, so that the arm does not wait between them.
    """

    def __init__(
        self,
        arm: Arm,
        program: Program,
        points: Mapping[str, Point],
        programs: Mapping[str, Program],
        *,
        on_change: Callable[[RunState], object] | None = None,
    ) -> None:
        """`on_change` is called with every new state, from the thread that caused it; it should return soon."""
        self._arm, self.program = arm, program
        self._points, self._programs = points, programs
        self._on_change = on_change
        self._lock = threading.RLock()
        self._state = RunState(program.name)
        self._controls = Controls()
        self.execution: Execution | None = None  # of the newest start
        self._thread: threading.Thread | None = None
        self._stops = 0

    @property
    def state(self) -> RunState:
        """The newest state."""
        return self._state

    def start(self, first: StepPath = (), *, one_step: bool = False) -> None:
        """Runs from the step `first` on, or only that step if `one_step`; returns at once.

        Raises `ProgramError` with the program's mistakes, `BadArgument` where there is no such step, and `Error` while
        it runs already. A `stop` that comes meanwhile lets nothing begin.
        """
        stops = self._stops
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                status = self._state.status
                raise Error(because("program.run.goes_on", program=self.program.name, status=str(status)))
            require_right(self.program, self._arm.description, self._points, self._programs)
            programs = called_programs(self.program, self._programs)
            legs = legs_of(self.program, programs, first)
            self._controls, clock = Controls(pauses_after_one=one_step), self._arm.node.clock
            self.execution = Execution(self._arm, legs, dict(self._points), self._controls, self._on_leg)
            if stops != self._stops:
                self._controls.stop.set()
            self._put(RunState(self.program.name, RunStatus.RUNNING, started_at=clock.unix() * 1e-9))
            self._thread = clock.thread(partial(self._run, self.execution), "program")
            self._thread.start()

    def pause(self) -> None:
        """Pauses at the end of the present step; a motion that was handed over already is that step."""
        with self._lock:
            self._require(RunStatus.RUNNING)
            self._controls.pauses = True
            self._arm.wake()

    def hold(self) -> None:
        """Pauses at once: the arm decelerates on its path and stands there until `resume` or `stop`."""
        with self._lock:
            self._require(RunStatus.RUNNING)
            execution = self.execution
            if execution is None or not (execution.is_moving or execution.is_starting):
                return self.pause()
            was_starting = execution.is_starting
            self._controls.holds = True
            try:
                self._arm.hold()
            except BaseException as error:
                if not (was_starting and isinstance(error, Refused)):  # else the motion is held as soon as it is known
                    self._controls.holds = False
                    raise
            self._put(replace(self._state, status=RunStatus.PAUSED, why=because("program.run.held")))

    def resume(self) -> None:
        """Goes on after `pause`, `hold` or `step`."""
        self._go_on(one_step=False)

    def step(self) -> None:
        """Carries out one step, and pauses; starts the program where it does not run."""
        if self._state.status is RunStatus.PAUSED:
            self._go_on(one_step=True)
        else:
            self.start(one_step=True)

    def stop(self) -> None:
        """The arm decelerates on its path, and the run is over; returns at once, `wait` when it rests."""
        self._stops += 1  # without the lock: a stop waits for nobody's answer
        self._controls.stop.set()
        if self.execution is not None:
            self.execution.cancel()
        self._arm.wake()

    def wait(self, timeout: float | None = None) -> RunState:
        """Returns when the run is over or has paused, with its state; TimeoutError after `timeout` [s]."""
        clock = self._arm.node.clock
        end = None if timeout is None else clock.monotonic() + timeout
        while self._goes_on:
            left = 1.0 if end is None else end - clock.monotonic()
            if timeout is not None and left <= 0.0:
                raise TimeoutError(str(because("program.run.still", program=self.program.name, time=timeout)))
            self._arm.wait_for(lambda: not self._goes_on, min(left, 1.0))
        if self._state.status.is_over and self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()  # it has said its last word
        return self._state

    @property
    def _goes_on(self) -> bool:
        """True until it is over, or has paused for a person."""
        status = self._state.status
        return status is RunStatus.RUNNING or (status is RunStatus.PAUSED and self._controls.stop.is_set())

    def _go_on(self, one_step: bool) -> None:
        with self._lock:
            self._require(RunStatus.PAUSED)
            if self._controls.holds:
                with suppress(Refused):  # the motion had ended when the hold came
                    self._arm.resume()
            self._controls.holds = self._controls.pauses = False
            self._controls.pauses_after_one = one_step
            self._put(replace(self._state, status=RunStatus.RUNNING, why=None))
            self._arm.wake()

    def _require(self, status: RunStatus) -> None:
        if self._state.status is not status:
            is_now = str(self._state.status)
            raise Error(because("program.run.other", program=self.program.name, status=is_now, required=str(status)))

    def _run(self, execution: Execution) -> None:
        """The run's own thread."""
        status, why = RunStatus.DONE, None
        failure: Error | None = None
        try:
            execution.run()
        except Error as error:
            status, why = RunStatus.FAILED, self._failed(error.reason)
            failure = error.__cause__ if isinstance(error.__cause__, Error) else error
        except BaseException as error:
            defect = because("program.run.defect", kind=type(error).__name__, error=str(error))
            status, why = RunStatus.FAILED, self._failed(defect)
            raise
        else:
            if self._controls.stop.is_set():
                status, why = RunStatus.STOPPED, self._stopped()
        finally:
            with self._lock:
                self._put(replace(self._state, status=status, why=why, failure=failure))

    def _on_leg(self, leg: Leg | None, done: int, planned: int, pause: Reason | None) -> None:
        """The execution tells what it is at."""
        with self._lock:
            state = replace(self._state, done=done, planned=planned)
            if leg is not None:
                state = replace(state, steps=leg.paths, rounds=leg.rounds, text="; ".join(map(words_of, leg.steps)))
            if pause is not None:
                state = replace(state, status=RunStatus.PAUSED, why=pause)
            self._put(state)

    def _failed(self, why: Reason) -> Reason:
        """With the present step, and the round of every repeat around it."""
        step, rounds, text = path_text(self._state.step), path_text(self._state.rounds), self._state.text
        if not step:
            return why
        if rounds:
            return because("program.step.failed_in_round", why, step=step, round=rounds, text=text)
        return because("program.step.failed", why, step=step, text=text)

    def _stopped(self) -> Reason:
        """With the present step, and the round of every repeat around it."""
        step, rounds, text = path_text(self._state.step), path_text(self._state.rounds), self._state.text
        if not step:
            return because("program.run.stopped_before")
        if rounds:
            return because("program.run.stopped_in_round", step=step, round=rounds, text=text)
        return because("program.run.stopped", step=step, text=text)

    def _put(self, state: RunState) -> None:
        if state != self._state:
            self._state = state
            if self._on_change is not None:
                self._on_change(state)
        self._arm.wake()
