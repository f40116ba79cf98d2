"""Taught points and the program that people edit and run at the page: one of each for all browsers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

import msgspec

import gemelo
from gemelo.programs import (
    AnyStep,
    Points,
    Program,
    ProgramCheck,
    ProgramRun,
    Programs,
    Repeat,
    RunState,
    RunStatus,
    StepPath,
    check_program,
    programs_folder,
)
from gemelo.schemas.reasons import because

NEW = "program_1"


class Teaching:
    """Points, the program that is open, its last check and its run. Methods raise `gemelo.Error`."""

    def __init__(self, arm: gemelo.Arm, on_change: Callable[[], object]) -> None:
        self._arm, self._on_change = arm, on_change
        folder = programs_folder(arm)
        self.points, self.programs = Points(folder, arm.description), Programs(folder)
        self.points_error: gemelo.Error | None = None  # why the file of points could not be read, if it could not
        try:
            self.points.reload()
        except gemelo.Error as error:  # the page is there all the same; nothing is written over that file
            self.points_error = error
        self._lock = threading.RLock()
        self.program = Program(NEW, ())
        self.is_saved = True
        self.check: ProgramCheck | None = None
        self.is_checking = False
        self.run: ProgramRun | None = None  # the newest
        self._stops = 0
        self.version = 0  # +1 with every change

    @property
    def state(self) -> RunState | None:
        """How the newest run stands."""
        return self.run.state if self.run is not None else None

    @property
    def is_running(self) -> bool:
        """True while a run moves, waits or has paused."""
        return self.state is not None and self.state.status in (RunStatus.RUNNING, RunStatus.PAUSED)

    # Points

    def remember(self, name: str, draw: Callable[[], bytes | None] | None = None, *, overwrite: bool = False) -> None:
        """Where the arm is now, under `name`, with the picture that `draw` makes, which may take seconds."""
        joints = self._arm.joints
        self.points.remember(name, joints, draw() if draw is not None else None, overwrite=overwrite)
        self._points_changed()

    def rename_point(self, old: str, new: str) -> None:
        """Programs that name it are not changed; their check says so."""
        self.points.rename(old, new)
        self._points_changed()

    def remove_point(self, name: str) -> None:
        """Forgets it."""
        self.points.remove(name)
        self._points_changed()

    def _points_changed(self) -> None:
        self.points_error = None  # each change reads the file first
        self.changed()

    # The program that is open

    def open(self, name: str) -> None:
        """Reads it from its file."""
        self.edit(self.programs.require(name), is_saved=True)

    def new(self, name: str) -> None:
        """An empty one, which no file has yet."""
        if name in self.programs:
            raise gemelo.BadArgument(because("program.exists.open", program=name))
        self.edit(Program(name, ()), is_saved=False)

    def save(self, name: str) -> None:
        """Writes it, under its own or another name."""
        with self._lock:
            if name != self.program.name and name in self.programs:
                raise gemelo.BadArgument(because("program.exists", program=name))
            program = replace(self.program, name=name)
            program.save(self.programs.folder)
            self.edit(program, is_saved=True, keep_check=True)

    def remove(self, name: str) -> None:
        """Deletes its file."""
        self.programs.remove(name)
        self.edit(Program(NEW, ()), is_saved=True)

    def insert(self, step: AnyStep, after: StepPath) -> StepPath:
        """Puts a step behind the one at `after`, or at the end where that is empty; the path where it stands."""
        with self._lock:
            path = (*after[:-1], after[-1] + 1) if after else (len(self.program.steps),)
            self._edit_steps(inserted(self.program.steps, path, step))
            return path

    def delete(self, path: StepPath) -> None:
        """Takes a step out, with those inside it."""
        with self._lock:
            self.program.step(path)
            self._edit_steps(deleted(self.program.steps, path))

    def shift(self, path: StepPath, by: int) -> StepPath:
        """Moves a step up (-1) or down (1) among its neighbours; it enters a repeat that is next to it, and leaves the
        one whose end it is at. The path where it stands then."""
        with self._lock:
            step = self.program.step(path)
            to = shifted(self.program.steps, path, by)
            self._edit_steps(inserted(deleted(self.program.steps, path), to, step))
            return to

    def change(self, path: StepPath, step: AnyStep) -> None:
        """Puts another step in its place."""
        with self._lock:
            self._edit_steps(inserted(deleted(self.program.steps, path), path, step))

    def plan_all(self, first: StepPath = ()) -> None:
        """Checks the whole program: every leg is planned from the end of the one before."""
        self.is_checking, self.check = True, None
        self.changed()
        try:
            self.check = check_program(self._arm, self.program, self.points, self.programs, first=first)
        finally:
            self.is_checking = False
            self.changed()

    def start(self, first: StepPath, *, one_step: bool = False) -> None:
        """Runs it from a step on. Only a person says so: nothing of the page starts it anew by itself."""
        stops = self._stops
        with self._lock:
            if self.is_running:
                raise gemelo.Error(because("program.run.already", program=self.program.name))
            run = ProgramRun(
                self._arm, self.program, self.points, self.programs, on_change=lambda state: self.changed()
            )
            self.run = run
        run.start(first, one_step=one_step)
        if stops != self._stops:
            run.stop()

    def step(self, first: StepPath) -> None:
        """One step, then it pauses."""
        run = self.run
        if run is not None and run.state.status is RunStatus.PAUSED:
            run.step()
        else:
            self.start(first, one_step=True)

    def pause(self) -> None:
        """At the end of the present step."""
        self._require_run().pause()

    def resume(self) -> None:
        """After a pause."""
        self._require_run().resume()

    def stop(self) -> None:
        """Ends the run, also one that is just being started; the arm decelerates."""
        self._stops += 1
        run = self.run
        if run is not None:
            run.stop()

    def _require_run(self) -> ProgramRun:
        if self.run is None or self.run.state.status.is_over:
            raise gemelo.Error(because("program.run.none"))
        return self.run

    def _edit_steps(self, steps: tuple[AnyStep, ...]) -> None:
        self.edit(replace(self.program, steps=steps, lines={}), is_saved=False)

    def edit(self, program: Program, *, is_saved: bool, keep_check: bool = False) -> None:
        """Another program in the place of the open one; `is_saved` says if its file is like it."""
        with self._lock:
            if self.is_running:
                raise gemelo.Error(because("program.run.no_change", program=self.program.name))
            self.program, self.is_saved = program, is_saved
            if not keep_check:
                self.check = None
        self.changed()

    def changed(self) -> None:
        """To be called once something of it is new, as a run does with each of its states."""
        self.version += 1
        self._on_change()


def inserted(steps: tuple[AnyStep, ...], path: StepPath, step: AnyStep) -> tuple[AnyStep, ...]:
    """The steps with one more, which stands at `path` then."""
    first, *rest = path
    if not rest:
        return (*steps[:first], step, *steps[first:])
    return _within(steps, first, lambda inner: inserted(inner, tuple(rest), step))


def deleted(steps: tuple[AnyStep, ...], path: StepPath) -> tuple[AnyStep, ...]:
    """The steps without the one at `path`."""
    first, *rest = path
    if not rest:
        return (*steps[:first], *steps[first + 1 :])
    return _within(steps, first, lambda inner: deleted(inner, tuple(rest)))


def shifted(steps: tuple[AnyStep, ...], path: StepPath, by: int) -> StepPath:
    """Where the step at `path` goes by a move up (-1) or down (1), as a path in the steps without it."""
    *around, index = path
    siblings = _steps_at(steps, tuple(around))
    beside = index + by
    if not 0 <= beside < len(siblings):
        if not around:
            return path
        *outer, repeat = around
        return (*outer, repeat + (1 if by > 0 else 0))
    neighbour = siblings[beside]
    if not isinstance(neighbour, Repeat):
        return (*around, beside)
    return (*around, index, 0) if by > 0 else (*around, beside, len(neighbour.steps))


def _steps_at(steps: tuple[AnyStep, ...], around: StepPath) -> tuple[AnyStep, ...]:
    for index in around:
        step = steps[index]
        assert isinstance(step, Repeat)
        steps = step.steps
    return steps


def _within(
    steps: tuple[AnyStep, ...], index: int, change: Callable[[tuple[AnyStep, ...]], tuple[AnyStep, ...]]
) -> tuple[AnyStep, ...]:
    repeat = steps[index]
    assert isinstance(repeat, Repeat)
    changed = msgspec.structs.replace(repeat, steps=change(repeat.steps))
    return (*steps[:index], changed, *steps[index + 1 :])


def target_names(points: Mapping[str, object], states: Mapping[str, object]) -> tuple[str, ...]:
    """What a motion can be told to go to: points, then named states that no point hides."""
    return (*points, *(name for name in states if name not in points))
